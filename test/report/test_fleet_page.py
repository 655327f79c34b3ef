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
"""The page, the figures and the plot of a fleet's report."""

import html
from itertools import chain
import json
import math
import re

from fleet_drive import driven, ENDED, events_of, log_of, STARTS
from kachaka_simple_control.analysis.fleet_summary import FleetLog, FleetSummary
from kachaka_simple_control.analysis.message_timing import quantile
from kachaka_simple_control.analysis.summary import OutcomeKind
from kachaka_simple_control.control.events import (
    MotionEnded,
    RobotEvent,
    RobotsApart,
    SessionEnded,
)
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.geometry import compose, relative_to
from kachaka_simple_control.report.comparison import read_drive
from kachaka_simple_control.report.fleet_page import render_fleet_page
from kachaka_simple_control.report.json_export import fleet_json
from kachaka_simple_control.report.report_program import write_report
import pytest

needs_jinja2 = pytest.mark.needs('jinja2')
APART = (RobotsApart(5007.0, 5.25, 0.0123, 3), RobotsApart(5012.0, 7.5, 0.5, 2))
EVIL = '<script>alert("x")</script>&$x_1$'
SILENT = 'odometry has been silent for 0.5 s'


@pytest.fixture(scope='module')
def trio():
    """Return the drives of three robots that were paused for a second."""
    return driven(pause=(2.0, 3.0))


def cells(page):
    """Return the rows of the table of robots, as texts."""
    table = page[page.index('<table class="robots">'):]
    rows = table[:table.index('</table>')].split('<tr')[2:]
    return [[html.unescape(re.sub('<[^>]*>', ' ', cell)).split()
             for cell in re.findall(r'<t[hd][^>]*>(.*?)</t[hd]>', row)] for row in rows]


@needs_jinja2
def test_the_page_has_a_row_for_each_robot_with_its_figures(trio):
    fleet = FleetSummary(log_of(trio, *APART))
    rows = cells(render_fleet_page(fleet, {}, None, None))
    assert [row[0] for row in rows] == [
        ['r1', 'square'], ['r2', 'square_cw'], ['r3', 'square']]
    for row, robot in zip(rows, fleet.robots):
        assert row[1] == ['Done']
        error = robot.error_from_plan
        assert row[2] == [
            f'{1e3 * error.distance:.1f}', f'{math.degrees(error.angle) + 0.0:.2f}°']
        late = sorted(
            abs(message.time - motion.began - message.due) for motion in robot.log.motions
            for message in motion.own_messages if message.due is not None)
        assert 0.0 < robot.lateness.p99 == quantile(late, 0.99)
        assert row[3] == [f'{1e3 * robot.lateness.p99:.2f}']
        assert row[4] == ['1.00']


@needs_jinja2
def test_the_page_says_how_far_they_were_apart_and_where_near_by_plan(trio):
    near = 'r1 and r2 come as near as 4 cm at 3.2 s'
    page = render_fleet_page(
        FleetSummary(log_of(trio, *APART, near_passes=(near,), text='robots: {}')), {}, None, None)
    text = page.replace('\N{NO-BREAK SPACE}', ' ')
    assert near in text
    assert '<td class="n">1</td><td class="n">5.25</td><td class="n">3</td>' in text
    assert '<td class="n">12.3</td>' in text
    assert '500.0 ms<small>at most, at 2 rests' in text
    assert '<pre>robots: {}</pre>' in text
    page = render_fleet_page(FleetSummary(log_of(trio)), {}, None, None)
    assert 'none had to wait' in page
    assert 'near each other by plan' not in page


def test_rests_are_counted_by_their_round():
    log = FleetLog()
    drives = driven(rounds=2)
    first = max(drive.drive_log.motions[1].began for drive in drives.values())
    for event in events_of(drives, RobotsApart(first - 1.0, 1.0, 0.01, 3),
                           RobotsApart(first + 2.0, 2.0, 0.01, 3)):
        log.on_event(event)
    assert [number for number, _ in log.apart] == [1, 2]
    assert log.rounds == 2


@pytest.mark.parametrize('goes_on, kinds', [
    (False, [OutcomeKind.STOPPED, OutcomeKind.FAULTED, OutcomeKind.STOPPED]),
    (True, [OutcomeKind.DONE, OutcomeKind.FAULTED, OutcomeKind.DONE])])
def test_a_fault_belongs_to_the_robot_that_had_it(goes_on, kinds):
    fleet = FleetSummary(log_of(
        driven(fault_at=4.0, goes_on=goes_on), goes_on=goes_on,
        ended=SessionEnded(5100.0, error=f'r2: {SILENT}')))
    assert [robot.outcome.kind for robot in fleet.robots] == kinds
    assert fleet.outcome.headline == 'Faulted'
    done = 2 if goes_on else 0
    assert fleet.outcome.reason == (
        f'r2: {SILENT}. Of 3 robots {done} drove to the end.')
    first, second, _ = (robot.outcome for robot in fleet.robots)
    assert second.reason.startswith(f'{SILENT.capitalize()}. The motion ended in step ')
    if not goes_on:
        assert first.headline == 'Stopped with another robot'
        assert first.reason.startswith(f'Stopped because of r2: {SILENT}. ')


@pytest.mark.parametrize('ended, headline, reason', [
    (ENDED, 'Done', '3 robots drove 2 of 2 rounds to the end.'),
    (SessionEnded(5100.0, signal=2), 'Stopped by SIGINT',
     'SIGINT ended the program. 3 robots drove 2 of 2 rounds to the end.'),
    (None, 'Killed', 'without a report process. 3 robots drove 2 of 2 rounds to the end.')])
def test_how_the_program_ended_is_the_outcome(ended, headline, reason):
    outcome = FleetSummary(log_of(driven(rounds=2), ended=ended, repeat=2)).outcome
    assert outcome.headline == headline
    assert outcome.reason.endswith(reason)


def test_what_stopped_all_is_said_once():
    log, reason = FleetLog(), 'the movement was ended by ~/stop'
    for event in events_of(driven(fault_at=4.0)):
        is_end = isinstance(event, RobotEvent) and isinstance(event.event, MotionEnded)
        log.on_event(event if not is_end else RobotEvent(
            event.robot, MotionEnded(event.event.time, reason, is_fault=False)))
    assert FleetSummary(log).outcome.reason == (
        'The movement was ended by ~/stop. Of 3 robots 0 drove to the end.')


@needs_jinja2
def test_a_fleet_without_a_robot_has_a_page_that_says_why(tmp_path):
    error = 'r3: no robot listens: nobody subscribes to /r3/cmd_vel'
    log = FleetLog()
    for event in events_of(driven(), ended=None):
        if not isinstance(event, RobotEvent) or not hasattr(event.event, 'time'):
            log.on_event(event)
    log.on_event(SessionEnded(5100.0, error=error))
    assert FleetSummary(log).outcome.reason == f'{error}.'
    write_report(log, tmp_path, 'nothing was recorded')
    page = (tmp_path / 'report.html').read_text()
    assert '<h1>' in page
    assert 'Never began' in page
    assert 'nothing was recorded' in page


@needs_jinja2
def test_nothing_that_comes_from_outside_is_markup(tmp_path, trio):
    log = log_of(trio, near_passes=(EVIL,), text=EVIL, source=EVIL,
                 ended=SessionEnded(5100.0, error=EVIL))
    write_report(log, tmp_path, EVIL)
    page = (tmp_path / 'report.html').read_text()
    assert '<script' not in page
    assert html.escape(EVIL, quote=False).replace('"', '&#34;') in page


@needs_jinja2
def test_run_json_has_each_robot_as_if_it_were_alone(tmp_path, trio):
    fleet = FleetSummary(log_of(trio, *APART, repeat=1, goes_on=True))
    told = json.loads(fleet_json(fleet, None))
    assert (told['fleet'], told['on_fault']) == ('trio', 'go_on')
    assert told['apart'][0] == {
        'round': 1, 'plan_time_s': 5.25, 'apart_s': 0.0123, 'robots': 3}
    assert [*told['robots']] == [*STARTS]
    for name, robot in told['robots'].items():
        assert robot['start']['x_m'] == STARTS[name].x
        assert robot['verdict']['ending'] == 'done'
        assert robot['longest_pause_s'] == pytest.approx(1.0)
        assert len(robot['steps']) == 8
    (tmp_path / 'run.json').write_text(json.dumps(told))
    with pytest.raises(UsageError, match='a fleet'):
        read_drive(tmp_path)


def test_the_plot_shows_paths_where_the_robots_were_on_the_floor(trio):
    """Odometry begins elsewhere: what counts is where a robot was relative to its t = 0."""
    pytest.importorskip('matplotlib', reason='plots need matplotlib')
    from kachaka_simple_control.report.fleet_drive_plot import draw_fleet_paths
    from kachaka_simple_control.report.plot_style import draw_figure
    fleet = FleetSummary(log_of(trio))
    (axes,) = draw_figure(lambda figure: draw_fleet_paths(figure, fleet.robots)).axes
    for name in ('planned', 'odometry'):
        lines = [line for line in axes.lines if line.get_gid() == name]
        assert len(lines) == 3
        for line, robot in zip(lines, fleet.robots):
            first, last = (tuple(point) for point in line.get_xydata()[[0, -1]])
            start, motion = STARTS[robot.member.name], robot.log.motions[0]
            assert first == pytest.approx((start.x, start.y), abs=2e-3)
            end = compose(start, motion.plan.pose)
            assert last == pytest.approx((end.x, end.y), abs=0.1)
            if name == 'odometry':
                seen = robot.log.odometry
                moved = relative_to(seen[0].pose, seen[-1].pose)
                there = compose(start, moved)
                assert last == pytest.approx((there.x, there.y), abs=2e-3)
    assert {'r1', 'r2', 'r3'} <= {text.get_text() for text in axes.texts}
    inside = [axes.get_xlim()[0] <= x <= axes.get_xlim()[1]
              and axes.get_ylim()[0] <= y <= axes.get_ylim()[1]
              for x, y in chain.from_iterable(line.get_xydata() for line in axes.lines)]
    assert all(inside)


@needs_jinja2
def test_the_files_of_a_fleet_s_report_are_there(tmp_path, trio):
    pytest.importorskip('matplotlib', reason='plots need matplotlib')
    write_report(log_of(trio, *APART), tmp_path, None)
    assert {file.name for file in tmp_path.iterdir()} == {'report.html', 'path.png', 'run.json'}
    page = (tmp_path / 'report.html').read_text()
    assert '<figure id="floor">' in page
    assert page.count('<svg') == 2
    assert '{{' not in page
