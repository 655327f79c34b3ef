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
"""Pictures of what stands on a floor, and of holds."""

import json
import math

import fleet_drive
from held_drives import held_drive, log_of, NEAR
from kachaka_simple_control.analysis.clearance import FleetView, FloorRobot
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.control.events import RobotEvent, WatchChanged, WatchState
from kachaka_simple_control.motion.floor import Floor, Person, Post
from kachaka_simple_control.motion.geometry import ORIGIN
from kachaka_simple_control.report.obstacle_plot import floor_points
from kachaka_simple_control.report.report_program import write_report
from kachaka_simple_control.report.text_tables import drive_table
from outcome_logs import done
from plans import BOX, preview, SQUARE
import pytest

HOLD = (1.0, 4.0, (NEAR, (WatchState.OBSTACLE, 0.06, 0.0)))
FLOOR = Floor(
    walls=(((0.8, -30.0), (0.8, 30.0)), ((20.0, 0.0), (21.0, 0.0))),
    posts=(Post((0.3, 0.4), 0.03), Post((9.0, 9.0), 0.03)),
    people=(Person((0.2, -0.6), 0.2, 0.0, 9.0, (0.2, -0.4)),))


def marked(figure, gid):
    """Return the artists of a kind."""
    return figure.findobj(lambda artist: artist.get_gid() == gid)


@pytest.fixture
def drawn():
    """Return a function that draws the map of a drive."""
    pytest.importorskip('matplotlib', reason='needs matplotlib')
    from kachaka_simple_control.report.map_plot import draw_drive_path
    from kachaka_simple_control.report.plot_style import draw_figure

    def draw(log, footprint=BOX, floor=None):
        summary = Summary(log)
        return draw_figure(lambda figure: draw_drive_path(
            figure, summary.aligned, footprint, summary.holds, floor))
    return draw


@pytest.mark.parametrize('footprint', [BOX, None])
def test_the_map_shows_where_it_was_held_and_what_it_saw(drawn, footprint):
    log = log_of(held_drive(HOLD))
    (hold,) = Summary(log).holds
    figure = drawn(log, footprint)
    (held,), (scan,) = marked(figure, 'held'), marked(figure, 'scan')
    assert (scan.get_xdata()[0], scan.get_ydata()[0]) == hold.points[0]
    if footprint is None:
        assert (held.get_xdata()[0], held.get_ydata()[0]) == (hold.pose.x, hold.pose.y)
    else:
        assert max(held.get_paths()[0].vertices[:, 0]) == pytest.approx(
            hold.pose.x + footprint.front, abs=1e-3)
    # All of it is on the map, and named below it.
    axes = figure.axes[0]
    assert axes.get_xlim()[1] > hold.points[0][0]
    figure.canvas.draw()
    (legend,) = figure.legends
    assert {'held here', 'laser, when held'} <= {text.get_text() for text in legend.get_texts()}
    box = legend.get_window_extent()
    assert box.y1 < axes.xaxis.label.get_window_extent().y0
    assert marked(drawn(done()), 'held') == marked(drawn(done()), 'scan') == []


def test_the_map_shows_what_stands_near_the_path(drawn):
    figure = drawn(done(), floor=FLOOR)
    assert [len(marked(figure, kind)) for kind in ('wall', 'post', 'person', 'walk')] == 4 * [1]
    axes = figure.axes[0]
    assert 0.8 < axes.get_xlim()[1] < 2.0
    assert -3.0 < axes.get_ylim()[0] < -0.8


def test_only_what_is_near_makes_a_map_larger():
    points = floor_points(FLOOR, [(0.0, 0.0), (0.5, 0.5)])
    assert points[:2] == [pytest.approx((0.8, -0.5)), pytest.approx((0.8, 1.0))]
    assert max(math.hypot(*point) for point in points) < 2.0
    assert floor_points(None, []) == []
    assert floor_points(Floor(walls=(((-5.0, 3.0), (5.0, 3.0)),)), [(0.0, 0.0)]) == []


@pytest.mark.needs('matplotlib')
def test_the_plot_of_a_plan_shows_its_floor():
    from dataclasses import replace

    from kachaka_simple_control.report.fleet_plot import draw_fleet
    from kachaka_simple_control.report.plan_plot import draw_plans
    view = preview(SQUARE, footprint=BOX)
    figure = draw_plans([replace(view, obstacles=FLOOR)])
    assert len(marked(figure, 'wall')) == 1
    assert {'wall', 'post', 'person'} <= {
        text.get_text() for text in figure.legends[0].get_texts()}
    assert marked(draw_plans([view]), 'wall') == []
    fleet = FleetView('one', (FloorRobot('r1', view.plan, ORIGIN, BOX),), 0.1, (), FLOOR)
    assert len(marked(draw_fleet(fleet), 'wall')) == 1


def test_the_table_lists_each_hold():
    log = log_of(held_drive(HOLD))
    (hold,) = Summary(log).holds
    lines = drive_table(log, 0.1).splitlines()
    place = next(index for index, line in enumerate(lines) if line.startswith('held by'))
    assert lines[place + 3].split()[:7] == ['obstacle', '0.06', 'm', 'ahead', '1.000', '3.000', (
        f'{hold.plan_time:.3f}')]
    assert lines[place + 3].split()[7] == f'{hold.pose.x:.3f}'
    assert lines[place + 5].startswith('Stop: ')
    assert 'held by' not in drive_table(done(), 0.1)


@pytest.mark.needs('jinja2', 'matplotlib')
def test_page_and_json_have_each_hold_and_nothing_of_it_without_one(tmp_path):
    for name, log, is_held in (
            ('held', log_of(held_drive(HOLD)), True), ('plain', done(), False)):
        folder = tmp_path / name
        folder.mkdir()
        write_report(log, folder, None)
        page = (folder / 'report.html').read_text().replace('\N{NO-BREAK SPACE}', ' ')
        told = json.loads((folder / 'run.json').read_text())
        assert ('<h2>Held by obstacles</h2>' in page) is is_held
        assert ('obstacle 0.06 m ahead' in page) is is_held
        assert ('obstacle 0 %' in page) is is_held
        assert ('holds' in told) is is_held
    (hold,) = json.loads((tmp_path / 'held' / 'run.json').read_text())['holds']
    assert (hold['motion'], hold['step'], hold['state']) == (1, 1, 'obstacle')
    assert (hold['begin_s'], hold['end_s']) == (pytest.approx(1.0), pytest.approx(4.0))
    assert (hold['distance_m'], hold['angle_rad']) == (0.06, 0.0)
    assert hold['pose'].keys() == {'x_m', 'y_m', 'heading_rad'}


@pytest.mark.needs('jinja2', 'matplotlib')
def test_the_page_of_a_fleet_names_the_robot_that_was_held(tmp_path):
    log = fleet_drive.log_of(fleet_drive.driven(pause=(3.0, 6.0)))
    began = log.robots['r2'].motions[0].began
    for time, *said in ((3.0, *NEAR), (6.0, WatchState.CLEAR)):
        log.on_event(RobotEvent('r2', WatchChanged(began + time, *said)))
    write_report(log, tmp_path, None)
    page = (tmp_path / 'report.html').read_text().replace('\N{NO-BREAK SPACE}', ' ')
    row = next(line for line in page.splitlines() if 'obstacle 0.30 m ahead' in line)
    assert row.startswith('<tr><th scope="row">r2</th>')
    told = json.loads((tmp_path / 'run.json').read_text())['robots']
    assert [name for name, robot in told.items() if 'holds' in robot] == ['r2']
