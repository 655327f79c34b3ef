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
"""The status of a fleet, its lines and its panel, from events and the time."""

from dataclasses import replace
import io
import os
import time

from fleet_drive import STARTS
from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.events import (
    DriveState,
    FleetMember,
    FleetStarted,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OVERVIEW,
    ProgressMade,
    RobotEvent,
    SessionEnded,
    SessionStarted,
    SpeedFactorChanged,
    StateChanged,
    WatchChanged,
    WatchState,
)
from kachaka_simple_control.display.fleet_status import FleetLogger, FleetTracker
from kachaka_simple_control.motion.geometry import ORIGIN, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion, Turn, Wait
from kachaka_simple_control.telemetry.subscriber_process import decode, encode
import pytest

START = 100.0
#: At full speed at once: 2 s forward, 1 s to the left, 1 s of rest.
ABRUPT = Limits(0.25, 1.0)
THREE = Motion('three', (Forward(0.5), Turn(1.0), Wait(1.0)))
SESSION = SessionStarted(
    'three', 'kachaka', ABRUPT, 0.3, 0.0, '/r/cmd_vel', None,
    settings={'guardian': True, 'robot_timeout': 10.0}, has_keys=True)
TRIO = ('r1', 'r2', 'r3')
HINT = 'space pauses, Ctrl+C stops all'
TIMES = st.floats(0.0, 1000.0)


class ShownFleet:
    """A fleet of some robots, and the tracker that gets its events."""

    def __init__(self, names=TRIO, repeat=1):
        self.names = names
        self.tracker = FleetTracker(FleetStarted('minuet', tuple(
            FleetMember(name, ORIGIN, 'three') for name in names), repeat))
        self.send(SESSION)
        self.send(MotionPlanned(THREE, ABRUPT, 20.0, START - 5.0, plan(THREE, ABRUPT, 20.0)))
        self.send(StateChanged(START - 5.0, DriveState.WAITING))

    def send(self, event, *names):
        """Send an event of some robots, or of all."""
        for name in names or self.names:
            self.tracker.on_event(RobotEvent(name, event))

    def drive(self, elapsed=0.0, *names):
        """Let robots drive, or all: their newest velocity was sent at a time."""
        self.send(MotionStarted(START), *names)
        self.send(StateChanged(START, DriveState.DRIVING), *names)
        self.send(ProgressMade(START + elapsed, elapsed, Velocity(0.25), 0.0012), *names)

    def status(self, elapsed=0.0):
        """Return the status at a time after t = 0."""
        return self.tracker.status_at(START + elapsed)

    def rows(self, elapsed=0.0):
        """Return name, state and trouble of each row at a time after t = 0."""
        return [(row.name, row.status.state, row.trouble) for row in self.status(elapsed).rows]


def driving(elapsed=0.8, names=TRIO, repeat=1):
    """Return a fleet that drives."""
    fleet = ShownFleet(names, repeat)
    fleet.drive(elapsed)
    return fleet


@pytest.fixture
def drawn():
    """Return a function that draws a panel without colours."""
    pytest.importorskip('rich', reason='needs rich')
    from kachaka_simple_control.display.fleet_panel import render_fleet
    from rich.console import Console

    def draw(status, columns=100, rows=24, encoding='utf-8', hint=HINT):
        file = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        return render_fleet(Console(file=file, highlight=False, markup=False),
                            os.terminal_size((columns, rows)), status, hint)
    return draw


def test_each_robot_has_the_state_and_the_progress_of_its_own_events():
    fleet = driving(0.8)
    fleet.send(ProgressMade(START + 1.0, 1.0, Velocity(0.1), 0.003), 'r2')
    one, two, _ = fleet.status(1.0).rows
    assert (one.name, two.name) == ('r1', 'r2')
    assert one.status.commanded == Velocity(0.25)
    assert two.status.commanded == Velocity(0.1)
    assert (one.status.lateness, two.status.lateness) == (0.0012, 0.003)
    assert one.status.fraction == pytest.approx(0.25)
    assert two.status.fraction == pytest.approx(0.25)
    assert fleet.status(1.0).state is DriveState.DRIVING


def test_robots_in_trouble_come_first_and_the_others_in_the_order_of_the_file():
    fleet = driving(0.8, tuple(f'r{number}' for number in range(1, 8)))
    fleet.send(ProgressMade(START + 0.8, 0.8, Velocity(0.25), 0.02), 'r6')
    fleet.send(StateChanged(START + 0.8, DriveState.STOPPING), 'r3')
    drives = DriveState.DRIVING
    assert fleet.rows(0.9) == [
        ('r3', DriveState.STOPPING, 'stopped early, the others drive on'),
        ('r6', drives, 'late by 20.0 ms'),
        *((f'r{number}', drives, '') for number in (1, 2, 4, 5, 7))]


def test_who_had_the_fault_comes_before_those_that_were_stopped_with_it():
    fleet = driving(0.8)
    fleet.send(MotionEnded(START + 0.9, 'r2: odometry is silent'))
    fleet.send(StateChanged(START + 1.3, DriveState.CUT_SHORT))
    cut = DriveState.CUT_SHORT
    assert fleet.rows(2.0) == [
        ('r2', cut, 'odometry is silent'), ('r1', cut, 'r2: odometry is silent'),
        ('r3', cut, 'r2: odometry is silent')]
    fleet = driving(0.8)
    fleet.send(MotionEnded(START + 0.9, 'stopped by SIGINT'))
    fleet.send(StateChanged(START + 1.3, DriveState.CUT_SHORT))
    assert [name for name, *_ in fleet.rows(2.0)] == [*TRIO]


def test_a_robot_that_is_not_ready_while_others_are_is_in_trouble():
    fleet = ShownFleet()
    assert not any(trouble for *_, trouble in fleet.rows(-4.0))
    fleet.send(StateChanged(START - 4.0, DriveState.CONNECTING), 'r1', 'r2')
    assert fleet.rows(-4.0)[0] == (
        'r3', DriveState.WAITING, 'not ready: /r/cmd_vel, 9 s left')


def test_only_a_robot_that_should_drive_is_called_silent():
    fleet = driving(0.8)
    fleet.send(ProgressMade(START + 3.0, 3.0, Velocity(), 0.0), 'r1')
    fleet.send(StateChanged(START + 1.0, DriveState.STOPPING), 'r3')
    assert fleet.rows(3.0) == [
        ('r2', DriveState.DRIVING, 'no message for 2 s'),
        ('r3', DriveState.STOPPING, 'stopped early, the others drive on'),
        ('r1', DriveState.DRIVING, '')]


def test_a_robot_that_has_ended_its_plan_before_the_others_is_not_in_trouble():
    fleet = driving(3.9)
    fleet.send(StateChanged(START + 4.0, DriveState.STOPPING), 'r3')
    assert [row.name for row in fleet.status(4.5).rows if row.trouble] == []
    assert fleet.status(9.0).rows[-1].status.fraction == pytest.approx(1.0)


def test_the_head_says_what_the_robot_with_the_longest_way_does(drawn):
    fleet = driving(0.8, repeat=3)
    fleet.send(ProgressMade(START + 0.8, 0.7, Velocity(0.1), 0.0), 'r3')
    status = fleet.status(0.8)
    assert (status.elapsed, status.duration) == (pytest.approx(0.8), pytest.approx(4.0))
    assert drawn(status)[0].startswith('minuet  0.8 s of 4.0 s  round 1 of 3 ')
    assert drawn(status)[0].endswith(HINT)
    fleet.send(MotionPlanned(THREE, ABRUPT, 20.0))
    fleet.send(SpeedFactorChanged(START, {'override': 0.5}), 'r2')
    assert ' round 2 of 3  speed 50 % ' in drawn(fleet.status(0.8))[0]
    assert not fleet.status(0.8).waits_for_resume
    fleet.send(SpeedFactorChanged(START, {'pause': 0.0}), 'r2')
    assert fleet.status(0.8).waits_for_resume


def test_who_is_held_by_an_obstacle_comes_first_and_the_others_say_of_whom(drawn):
    fleet, logger = driving(0.8), FleetLogger()
    assert len(logger.update(fleet.status(0.8), START + 0.8)) == 1
    fleet.send(WatchChanged(START + 0.9, WatchState.OBSTACLE, 0.31, 0.0), 'r2')
    fleet.send(SpeedFactorChanged(START + 0.9, {'obstacle': 0.0}), 'r2')
    fleet.send(SpeedFactorChanged(START + 0.9, {'obstacle of r2': 0.0}), 'r1', 'r3')
    fleet.send(StateChanged(START + 0.9, DriveState.PAUSED))
    status = fleet.status(1.0)
    head, *rows = drawn(status)
    assert 'obstacle' not in head
    assert [row.split()[:2] for row in rows] == [['r2', 'HELD'], ['r1', 'HELD'], ['r3', 'HELD']]
    assert rows[0].endswith(' obstacle 0.31 m ahead, goes on by itself')
    assert rows[1].endswith(' obstacle of r2')
    assert not status.waits_for_resume


def test_a_pause_keeps_the_progress_between_two_events():
    fleet = driving(0.8)
    fleet.send(SpeedFactorChanged(START + 0.8, {'pause': 0.0}))
    fleet.send(StateChanged(START + 0.8, DriveState.PAUSED))
    assert fleet.status(1.6).elapsed == pytest.approx(0.8)


def test_a_panel_has_a_row_a_robot_with_all_figures(drawn):
    fleet = driving(0.8)
    fleet.send(ProgressMade(START + 0.8, 0.8, Velocity(0.0, -0.5), 0.0131), 'r2')
    lines = drawn(fleet.status(0.8))
    assert len(lines) == 4
    assert lines[2].startswith('r1  DRIVING      20 %   0.25 m/s     1.2 ms  ')
    assert lines[2].count('\u2501') == 8
    assert lines[1] == 'r2  DRIVING      20 %  late by 13.1 ms'
    fleet.send(ProgressMade(START + 0.8, 0.8, Velocity(0.0, -0.5), 0.0), 'r2')
    assert '-0.50 rad/s   0.0 ms' in drawn(fleet.status(0.8))[2]
    assert '####----' in drawn(fleet.status(0.8), encoding='ascii')[1]


@pytest.mark.parametrize('rows, shown, more', [
    (12, 4, 'and 46 more: driving'), (24, 16, 'and 34 more: driving'), (60, 50, None)])
def test_a_panel_leaves_room_for_log_lines(drawn, rows, shown, more):
    names = tuple(f'r{number}' for number in range(50))
    lines = drawn(driving(0.8, names).status(0.8), rows=rows)
    assert len(lines) == 1 + shown + (more is not None) <= rows - 6
    assert sum(' DRIVING ' in line for line in lines) == shown
    if more is not None:
        assert lines[-1] == more


def test_what_is_not_shown_is_counted_by_state(drawn):
    fleet = driving(0.8, tuple(f'r{number}' for number in range(20)))
    fleet.send(StateChanged(START + 0.8, DriveState.PAUSED), 'r18', 'r19')
    assert drawn(fleet.status(0.8), rows=12)[-1] == 'and 16 more: 14 driving, 2 paused'


def test_lines_say_which_round_begins_who_is_awaited_and_who_has_a_fault():
    fleet, logger = ShownFleet(repeat=2), FleetLogger()

    def lines(elapsed):
        return logger.update(fleet.status(elapsed), START + elapsed)

    assert lines(-5.0) == lines(-3.5) == []
    fleet.send(StateChanged(START - 3.0, DriveState.CONNECTING), 'r2')
    assert lines(-2.9) == ['minuet: waiting for r1, r3']
    assert lines(-2.0) == []
    fleet.drive()
    assert lines(0.1) == ['minuet: round 1 of 2: 3 robots for 4.0 s']
    assert lines(0.2) == []
    fleet.send(MotionPlanned(THREE, ABRUPT, 20.0))
    fleet.drive()
    assert lines(0.3) == ['minuet: round 2 of 2: 3 robots for 4.0 s']
    fleet.send(MotionEnded(START + 0.9, 'r2: odometry is silent'))
    fleet.send(StateChanged(START + 1.3, DriveState.CUT_SHORT))
    assert lines(1.4) == ['r2: odometry is silent']
    assert lines(1.5) == []


def test_the_guardian_is_said_to_stop_them_only_if_each_has_it():
    fleet = driving()
    assert fleet.tracker.is_guarded
    assert fleet.tracker.is_under_way
    assert fleet.tracker.has_keys
    fleet.send(replace(SESSION, settings={'guardian': False}), 'r3')
    assert not fleet.tracker.is_guarded
    assert fleet.tracker.session_ended is None
    fleet.tracker.on_event(SessionEnded(1.0))
    assert fleet.tracker.session_ended is not None


EVENTS = st.builds(RobotEvent, st.sampled_from([*STARTS, 'stranger']), st.one_of(
    st.just(SESSION), st.just(MotionPlanned(THREE, ABRUPT, 20.0)),
    st.builds(MotionStarted, TIMES, st.booleans()),
    st.builds(StateChanged, TIMES, st.sampled_from(DriveState)),
    st.builds(ProgressMade, TIMES, st.none() | TIMES, st.builds(
        Velocity, st.floats(-1, 1), st.floats(-2, 2)), st.floats(0.0, 100.0)),
    st.builds(SpeedFactorChanged, TIMES, st.dictionaries(
        st.sampled_from(['pause', 'override']), st.floats(0.0, 1.0))),
    st.builds(MotionEnded, TIMES, st.none() | st.text())))


@given(columns=st.integers(60, 250), rows=st.integers(12, 60), title=st.text(max_size=60),
       events=st.lists(EVENTS, max_size=8), now=TIMES, count=st.integers(1, 60))
@settings(max_examples=50)
def test_no_line_of_a_panel_is_wider_than_the_terminal(columns, rows, title, events, now, count):
    pytest.importorskip('rich', reason='needs rich')
    from kachaka_simple_control.display.fleet_panel import render_fleet
    from rich.cells import cell_len
    from rich.console import Console
    names = [*STARTS, *(f'a_robot_with_a_long_name_{number}' for number in range(count))]
    tracker = FleetTracker(FleetStarted(title, tuple(
        FleetMember(name, ORIGIN, 'three') for name in names)))
    console = Console(file=io.StringIO(), highlight=False, markup=False)
    size, logger, heights = os.terminal_size((columns, rows)), FleetLogger(), set()
    for event in events:
        tracker.on_event(event)
        status = tracker.status_at(now)
        logger.update(status, now)
        lines = render_fleet(console, size, status, HINT)
        heights.add(len(lines))
        assert max(map(cell_len, lines)) < columns
        assert all(line.isprintable() for line in lines)
        assert HINT in lines[0]
    assert len(heights) <= 1, 'the height does not change'
    assert max(heights, default=0) <= rows - 6


def test_fifty_robots_at_ten_frames_a_second_take_little_of_a_core(drawn):
    """A second of events, and ten frames: 5 % of a core is 50 ms, and 80 ms of a slow one."""
    names = tuple(f'r{number}' for number in range(50))
    fleet = driving(0.8, names)
    packets = [packet for tick in range(4) for packet in encode(*(
        RobotEvent(name, ProgressMade(START + 0.8 + 0.25 * tick, 0.8 + 0.25 * tick,
                                      Velocity(0.25), 0.001)) for name in names))]
    drawn(fleet.status(0.8), 100, 60)
    times = []
    for _ in range(5):
        began = time.thread_time()
        for event in decode(io.BytesIO(b''.join(packets))):
            fleet.tracker.on_event(event)
        for frame in range(10):
            drawn(fleet.status(1.0 + 0.05 * frame), 100, 60)
        times.append(time.thread_time() - began)
    assert min(times) < 0.08


def test_a_display_of_many_robots_gets_no_event_of_each_velocity():
    assert {kind.__name__ for kind in OVERVIEW} & {'VelocitySent', 'OdometryReceived'} == set()
    assert {ProgressMade, StateChanged, MotionEnded, SessionStarted, FleetStarted} <= OVERVIEW
