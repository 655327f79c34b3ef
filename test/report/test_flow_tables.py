# Copyright 2026 kachaka_simple_control contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Tables and plots of plans with corners, and reports of drives of them."""

from dataclasses import replace
import math
import re

from flow_motions import QUARTER, ROUNDED, ROUNDS, SIDE, STRAIGHT, TIGHT, TWO
from golden import compare
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import Displacement
from kachaka_simple_control.motion.steps import Forward, Motion, Turn, Wait
from kachaka_simple_control.report.html_page import render_page
from kachaka_simple_control.report.json_export import fields
from kachaka_simple_control.report.plan_plot import draw_plans
from kachaka_simple_control.report.text_tables import drive_table, plan_table
from plans import preview, SQUARE
import pytest
from simulated_drive import SimulatedDrive


@pytest.fixture
def matplotlib():
    """Return matplotlib."""
    return pytest.importorskip('matplotlib', reason='needs matplotlib')


def driven(motion, until=math.inf, parameters=None, rate=20.0, **options):
    """Return the log of a drive of a motion, and the drive."""
    simulated = SimulatedDrive(
        rate, lambda number: 0.0, parameters or SimulationParameters(), **options)
    simulated.drive(motion, until, None if until == math.inf else 'stopped by a test')
    return simulated


def corner_lines(motion, rate=10.0):
    """Return the lines about corners below the table of a plan."""
    lines = plan_table([preview(motion, rate=rate)]).splitlines()
    return [line.strip() for line in lines if 'orner' in line]


def test_the_tables_of_flows():
    motions = (ROUNDED, TIGHT, TWO, STRAIGHT, ROUNDS)
    compare('flows', '\n\n'.join(
        [plan_table([preview(motion, rate=10.0)]) for motion in motions]
        + [drive_table(driven(ROUNDED).close(), 0.1)]) + '\n')


def test_equal_corners_share_a_line_and_few_lines_are_shown():
    legs = [0.11, 0.12, 0.13, 0.14, 0.15, 0.16]
    motion = Motion('zigzag', (
        Forward(1.0), *(step for leg in legs for step in (
            Turn(QUARTER), Forward(leg), Turn(-QUARTER), Forward(1.0)))), corners=0.1)
    _, *lines = corner_lines(motion)
    assert len(lines) == 5
    assert lines[-1].endswith('more corners with a short leg')
    said = sum(len(re.findall(r'\d+', line.split(':')[0])) for line in lines[:-1])
    assert said + int(lines[-1].split()[0]) == 12
    _, line = corner_lines(ROUNDS)
    assert re.fullmatch(
        r'corners 2, 4, 6, \.\.\. \(199 in all\): 4\.9 cm, a leg of 0\.5 m is short', line)


def test_tiny_corners_are_not_called_stops():
    motion = Motion('', (*SIDE, Forward(0.001), Turn(QUARTER), Forward(0.5)), corners=0.05)
    assert corner_lines(motion) == [
        'Corners: 2 of 2 cut by less than 0.1 mm; 0.3 s less than with stops',
        'corners 1, 2: less than 0.1 mm, a leg of 0.001 m is short']


def stopping():
    """Return the view of a square that has no room for its corners."""
    view = preview(ROUNDED)
    steps = [replace(step, cut=step.cut and step.cut._replace(deviation=0.0, is_shrunk=True))
             for step in view.plan.steps]
    return replace(view, plan=replace(view.plan, steps=tuple(steps), saved_time=0.0))


def test_corners_with_a_stop_are_not_called_cut():
    lines = plan_table([stopping()]).splitlines()
    assert 'Corners: 0 of 3 cut; 0.0 s less than with stops' in lines
    assert '        corners 1, 2, 3: a stop, a leg of 0.5 m is short' in lines


def marked(figure, gid):
    """Return the artists of a kind."""
    return figure.findobj(lambda artist: artist.get_gid() == gid)


def legend_of(figure):
    """Return the texts of the legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_a_plot_has_thin_legs_and_the_path_over_them(matplotlib):
    figure = draw_plans([preview(ROUNDED)])
    (legs,), (path,) = marked(figure, 'legs'), marked(figure, 'path')
    assert legs.get_linewidth() < path.get_linewidth()
    assert legs.get_zorder() < path.get_zorder()
    corner = (0.5, 0.0)
    distances = [min(math.dist(point, corner) for point in zip(*line.get_data()))
                 for line in (legs, path)]
    assert distances == [pytest.approx(0.0, abs=1e-9), pytest.approx(0.05, abs=1e-3)]
    assert 'legs' in legend_of(figure)


def test_only_the_last_turn_of_the_square_is_drawn_as_a_turn_in_place(matplotlib):
    figure = draw_plans([preview(ROUNDED)])
    (turns,) = marked(figure, 'turns')
    assert len(turns.get_paths()) == 1
    # An arrow for each of the seven parts of the flow, and one for the turn.
    assert len(marked(figure, 'arrow')) == 8
    numbers = ', '.join(text.get_text() for text in marked(figure, 'step number'))
    assert sorted(map(int, re.findall(r'\d+', numbers))) == [*range(1, 9)]


def test_odometry_is_that_of_the_flow():
    steps = Summary(driven(ROUNDED).close()).steps
    assert [step.is_in_flow for step in steps] == [True] * 7 + [False]
    assert [step.odometry for step in steps[:7]] == [None] * 7
    assert [step.error for step in steps[:7]] == [None] * 7
    assert [step.flow is not None for step in steps] == [False] * 6 + [True, False]
    flow = steps[6].flow
    assert flow.count == 7
    for total, part in ((flow.requested, 'requested'), (flow.sent, 'sent')):
        assert total == Displacement(
            pytest.approx(math.fsum(getattr(step, part).distance for step in steps[:7])),
            pytest.approx(math.fsum(getattr(step, part).angle for step in steps[:7])))
    assert flow.requested == Displacement(pytest.approx(1.832, abs=0.001),
                                          pytest.approx(3 * QUARTER))
    assert flow.error == Displacement(pytest.approx(0.0, abs=0.005),
                                      pytest.approx(0.0, abs=0.01))
    assert steps[7].odometry.angle == pytest.approx(QUARTER, abs=0.01)


def test_the_error_of_a_flow_does_not_depend_on_the_delay_of_odometry():
    """Single steps would be off by velocity times delay: here 6 cm."""
    motion = Motion('rests', (Wait(1.0), *SIDE, Forward(0.5), Wait(1.0)), corners=0.05)
    errors = [Summary(driven(motion, parameters=SimulationParameters(dead_time=delay)).close())
              .steps[3].flow.error.distance for delay in (0.0, 0.2)]
    assert errors == [pytest.approx(0.0, abs=0.006)] * 2


def test_a_flow_that_is_cut_short_is_compared_with_what_was_sent():
    log = driven(ROUNDED, until=4.0).close()
    steps = Summary(log).steps
    assert len(steps) == 4
    flow = steps[-1].flow
    assert (flow.count, flow.is_complete) == (4, False)
    assert flow.sent.distance < flow.requested.distance
    assert abs(flow.error.distance) < 0.05
    lines = drive_table(log, 0.1).splitlines()
    assert lines[5].startswith('turn 90 deg; cut short ')
    assert lines[5].endswith('  in flow')
    assert lines[6].startswith('4 steps without a stop; cut short ')


def test_a_paused_flow_is_still_one_flow():
    simulated = SimulatedDrive(20.0, lambda number: 0.0, SimulationParameters())
    simulated.drive(ROUNDED, factors=[(2.0, {'pause': 0.0}), (6.0, {})])
    steps = Summary(simulated.close()).steps
    flow = steps[6].flow
    assert flow.sent == Displacement(pytest.approx(flow.requested.distance, abs=1e-6),
                                     pytest.approx(flow.requested.angle, abs=1e-6))
    assert flow.error == Displacement(pytest.approx(0.0, abs=0.005),
                                      pytest.approx(0.0, abs=0.01))


def test_run_json_has_the_flow_with_its_last_step():
    steps = fields(Summary(driven(ROUNDED).close()), None)['steps']
    assert [step.get('in_flow') for step in steps] == [True] * 7 + [None]
    assert [step['odometry'] for step in steps[:7]] == [None] * 7
    (flow,) = (step['flow'] for step in steps if 'flow' in step)
    assert [*flow] == ['steps', 'requested', 'sent', 'odometry', 'error']
    assert flow['steps'] == 7
    assert flow['error']['distance_m'] == pytest.approx(
        flow['odometry']['distance_m'] - flow['requested']['distance_m'])


@pytest.mark.needs('jinja2')
def test_the_page_has_a_row_for_the_whole_flow():
    page = render_page(Summary(driven(ROUNDED).close()), {}, None, None)
    assert page.count('<td class="n" colspan="2">in flow</td>') == 7
    (row,) = re.findall(r'<tr class="flow">.*?</tr>', page, re.DOTALL)
    assert '7 steps without a stop' in row
    assert row.count('<td class="n">') == 5
    assert page.count('<dt>in flow</dt>') == 1
    page = render_page(Summary(driven(SQUARE).close()), {}, None, None)
    assert 'in flow' not in page
    assert 'without a stop' not in page
