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
"""The status of a drive, its lines and its panel, from events and the time."""

from dataclasses import replace
import io
from itertools import pairwise

from hypothesis import assume, given
from hypothesis import strategies as st
from kachaka_simple_control.control.events import (
    DriveState,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SessionEnded,
    SessionStarted,
    SpeedFactorChanged,
    StateChanged,
    VelocityKind,
    VelocitySent,
    WatchChanged,
    WatchState,
)
from kachaka_simple_control.display.display_program import (
    LineRenderer,
    MIN_LINE_PERIOD,
    StepLogger,
)
from kachaka_simple_control.display.drive_status import DriveTracker, PLAN_RATE
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import ORIGIN, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion, Move, Turn, Wait
from messages import of_plan, of_stop
import pytest
from strategies import LIMITS, MOTIONS

START = 100.0
#: At full speed at once: 2 s forward, 1 s to the left, 1 s of rest.
ABRUPT = Limits(0.25, 1.0)
THREE = Motion('three', (Forward(0.5), Turn(1.0), Wait(1.0)))
STARTED = SessionStarted('three', 'kachaka', ABRUPT, 0.3, 0.0, 'cmd_vel', 'odometry')
TIMES = st.floats(0.0, 1000.0)
VELOCITIES = st.builds(Velocity, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
EVENTS = st.one_of(
    st.just(STARTED), st.builds(MotionPlanned, st.just(THREE), st.just(ABRUPT), st.just(10.0)),
    st.just(MotionPlanned(Motion('empty', ()), ABRUPT, 10.0)),
    st.builds(MotionStarted, TIMES, st.booleans()),
    st.builds(StateChanged, TIMES, st.sampled_from(DriveState)),
    st.builds(VelocitySent, TIMES, VELOCITIES, st.sampled_from(VelocityKind), TIMES,
              st.none() | TIMES),
    st.builds(OdometryReceived, TIMES, st.builds(Pose, st.floats(-9, 9), st.floats(-9, 9)),
              VELOCITIES, st.booleans()),
    st.builds(SpeedFactorChanged, TIMES, st.dictionaries(
        st.sampled_from(['obstacle', 'obstacle of r1', 'pause']), st.floats(0.0, 0.9))),
    st.builds(WatchChanged, TIMES, st.sampled_from(WatchState), st.none() | st.floats(0.0, 9.0),
              st.none() | st.floats(0.0, 9.0)),
    st.builds(MotionEnded, TIMES, st.none() | st.text()), st.builds(SessionEnded, TIMES))


def started(motion=THREE, limits=ABRUPT, session=STARTED):
    """Return the tracker of a motion whose first velocity was sent."""
    tracker = DriveTracker()
    for event in (session, MotionPlanned(motion, limits, 10.0),
                  MotionStarted(START), StateChanged(START, DriveState.DRIVING),
                  of_plan(START, Velocity(0.25), START)):
        tracker.on_event(event)
    return tracker


def driven(until, step=0.1, gain=1.0):
    """Return the tracker of a drive that goes as planned, with odometry at each message."""
    tracker, pose = started(), ORIGIN
    for tick in range(round(until / step) + 1):
        elapsed = tick * step
        velocity = Velocity(0.25) if elapsed < 2.0 - 1e-9 else (
            Velocity(0.0, 1.0) if elapsed < 3.0 - 1e-9 else ZERO)
        tracker.on_event(of_plan(START + elapsed, velocity, START))
        pose = Pose(0.25 * gain * min(elapsed, 2.0), 0.0, max(0.0, min(elapsed - 2.0, 1.0)))
        tracker.on_event(OdometryReceived(START + elapsed, pose, velocity))
    return tracker


@given(st.lists(EVENTS, max_size=12), TIMES)
def test_any_events_in_any_order_give_a_status(events, now):
    """A display must not fail in the middle of a drive, whatever it receives."""
    tracker = DriveTracker()
    for event in events:
        tracker.on_event(event)
        status = tracker.status_at(now)
        assert 0.0 <= status.fraction <= 1.0 + 1e-9
        assert status.odometry_age >= 0.0
        if status.step is not None:
            assert 0.0 <= status.step.time_left <= status.step.duration
            assert status.step.time_left <= status.time_left + 1e-9
            assert all(left is None or left >= 0.0
                       for left in (status.step.remaining.distance, status.step.remaining.angle))


@given(MOTIONS, LIMITS, st.floats(5.0, 100.0))
def test_when_steps_are_due_does_not_depend_on_the_rate(motion, limits, rate):
    try:
        fine, coarse = plan(motion, limits, rate), plan(motion, limits, PLAN_RATE)
    except InvalidMotionError:
        assume(False)
    assert [(one.start, one.end) for one in fine.steps] == [
        (one.start, one.end) for one in coarse.steps]


@given(MOTIONS, LIMITS, st.floats(0.0, 1.0))
def test_the_remaining_time_is_that_of_the_plan(motion, limits, part):
    try:
        planned = plan(motion, limits, 10.0)
    except InvalidMotionError:
        assume(False)
    assume(planned.steps)
    now = START + part * planned.duration
    status = started(motion, limits).status_at(now)
    elapsed = now - START
    assert status.time_left == pytest.approx(planned.duration - elapsed, abs=1e-9)
    step = planned.steps[status.step.number - 1] if status.step.count else None
    if step is not None:
        assert step.start - 1e-9 <= elapsed <= step.end + 1e-9
        assert status.step.time_left == pytest.approx(step.end - elapsed, abs=1e-9)


def test_a_step_has_its_number_its_description_and_what_remains():
    for elapsed, number, description in (
            (0.0, 1, 'forward 0.5 m'), (1.9, 1, 'forward 0.5 m'),
            (2.1, 2, 'turn 57.296 deg'), (3.5, 3, 'wait 1 s')):
        step = driven(elapsed).status_at(START + elapsed).step
        assert (step.number, step.count, step.description) == (number, 3, description)
    step = driven(0.8).status_at(START + 0.8).step
    assert step.time_left == pytest.approx(1.2)
    assert (step.remaining.distance, step.remaining.angle) == (pytest.approx(0.3), None)
    step = driven(2.4).status_at(START + 2.4).step
    assert (step.remaining.distance, step.remaining.angle) == (None, pytest.approx(0.6))


def test_by_commands_a_calibrated_robot_does_what_was_planned():
    tracker = started()
    for tick in range(11):
        tracker.on_event(of_plan(
            START + tick / 10, Velocity(0.3), START, expected=Velocity(0.25)))
    status = tracker.status_at(START + 1.0)
    assert status.step.remaining.distance == pytest.approx(0.25)
    assert status.commanded == Velocity(0.3)


def test_the_state_is_the_one_that_was_published():
    tracker = DriveTracker()
    assert tracker.status_at(0.0).state is DriveState.READY
    for state in DriveState:
        tracker.on_event(StateChanged(1.0, state))
        assert tracker.status_at(9.0).state is state


def test_a_complete_drive_has_nothing_left():
    tracker = driven(4.0)
    for event in (StateChanged(START + 4.0, DriveState.STOPPING), MotionEnded(START + 4.0)):
        tracker.on_event(event)
        assert tracker.status_at(START + 5.0).fraction == pytest.approx(1.0)


def test_a_stop_is_shown_from_its_first_zeros():
    """Its MotionEnded comes 0.4 s later; until then no further step must be shown."""
    tracker = driven(1.9)
    tracker.on_event(StateChanged(START + 1.95, DriveState.STOPPING))
    tracker.on_event(of_stop(START + 1.95))
    status = tracker.status_at(START + 2.03)
    assert status.state is DriveState.STOPPING
    assert status.step.number == 1
    assert StepLogger().update(status, START + 2.03) == []


def test_as_long_as_odometry_sees_it_move_it_is_stopping():
    """Even when the program has given up, and sends no more zeros."""
    tracker = driven(1.0)
    tracker.on_event(MotionEnded(START + 1.0, 'stopped by SIGINT'))
    tracker.on_event(StateChanged(START + 1.0, DriveState.CUT_SHORT))
    assert tracker.status_at(START + 1.2).state is DriveState.STOPPING
    tracker.on_event(OdometryReceived(START + 1.2, Pose(0.3), ZERO, is_still=True))
    status = tracker.status_at(START + 1.2)
    assert (status.state, status.reason) == (DriveState.CUT_SHORT, 'stopped by SIGINT')
    assert status.fraction == pytest.approx(0.25)


def test_a_program_that_sends_nothing_is_shown_as_silent():
    tracker = driven(1.0)
    assert tracker.status_at(START + 1.5).silent_for is None
    assert tracker.status_at(START + 3.0).silent_for == pytest.approx(2.0)
    tracker.on_event(MotionEnded(START + 3.0))
    assert tracker.status_at(START + 5.0).silent_for is None


@pytest.mark.parametrize('count, labels', [
    (None, ['movement 1', 'movement 2']), (2, ['movement 1 of 2', 'movement 2 of 2']),
    (1, ['movement 1 of 1', 'movement 2'])])
def test_motions_by_call_are_counted(count, labels):
    """Their total is that of the session, unless there are more; none has passed unseen."""
    lesson = SessionStarted(
        'lesson', 'kachaka', ABRUPT, 0.3, 0.0, 'cmd_vel', None, movement_count=count)
    moves = (Move(0.1, 0.0, 1.0), Move(0.0, 0.5, 1.0))
    tracker, logger, lines = DriveTracker(), StepLogger(), []
    tracker.on_event(lesson)
    for start, move in zip((START, START + 1.0), moves):
        tracker.on_event(StateChanged(start, DriveState.WAITING))
        tracker.on_event(MotionPlanned(Motion('move_robot', (move,)), ABRUPT, 10.0))
        lines += logger.update(tracker.status_at(start), start)
        tracker.on_event(MotionStarted(start))
        tracker.on_event(StateChanged(start, DriveState.DRIVING))
        lines += logger.update(tracker.status_at(start), start)
        tracker.on_event(MotionEnded(start + 1.0))
    assert lines == [f'{labels[0]}: move 0.1 m/s, 0 rad/s (1 s)',
                     f'{labels[1]}: move 0 m/s, 0.5 rad/s (1 s)']


@given(st.lists(st.floats(0.01, 3.0), min_size=1, max_size=20))
def test_each_step_has_one_line_and_lines_are_not_too_fast(durations):
    tracker = started(Motion('three', tuple(map(Wait, durations))))
    logger, lines = StepLogger(), []
    for tick in range(round(sum(durations) * 20) + 1):
        now = START + tick / 20
        lines += [(now, line) for line in logger.update(tracker.status_at(now), now)]
    assert lines[0][1].startswith('step 1 of ')
    assert all(two - one >= MIN_LINE_PERIOD - 1e-9 for (one, _), (two, _) in pairwise(lines))
    numbers = [int(line.split()[1]) for _, line in lines]
    assert numbers == sorted(set(numbers))
    for before, (_, line), number in zip([0, *numbers], lines, numbers):
        passed = number - before - 1
        assert line.endswith(
            f'; {passed} {"step" if passed == 1 else "steps"} before it passed'
            if passed else ' s)')
    if min(durations) >= 0.6:
        assert numbers == list(range(1, len(durations) + 1))


def waiting(began=START):
    """Return the tracker of a drive that waits for its robot, 10 s at most."""
    tracker = DriveTracker()
    tracker.on_event(replace(
        STARTED, velocity_topic='/kachaka/cmd_vel', settings={'robot_timeout': 10.0}))
    tracker.on_event(MotionPlanned(THREE, ABRUPT, 10.0, began))
    tracker.on_event(StateChanged(began, DriveState.WAITING))
    return tracker


@pytest.fixture
def drawn():
    """Return a function that draws a panel without colours."""
    pytest.importorskip('rich', reason='needs rich')
    from kachaka_simple_control.display.panel import render_panel
    from rich.console import Console

    def draw(status, columns, encoding='utf-8', hint='Ctrl+C stops the robot'):
        file = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        return render_panel(
            Console(file=file, highlight=False, markup=False), columns, status, hint)
    return draw


@pytest.mark.parametrize('columns', [60, 100, 200])
def test_a_panel_has_all_figures(drawn, columns):
    text = '\n'.join(drawn(driven(0.8).status_at(START + 0.88), columns))
    for figure in ('three on kachaka', 'Ctrl+C stops the robot', 'DRIVING',
                   'step 1 of 3: forward 0.5 m', '1.1 s, 0.300 m left by odometry', '22 %',
                   '3.1 s left of 4.0 s', 'commanded    0.250 m/s    0.000 rad/s',
                   'odometry     0.250 m/s    0.000 rad/s   0.1 s ago'):
        assert figure in text
    assert '\u2026' not in text


@pytest.mark.parametrize('factors, state, texts', [
    ({'override': 0.5}, 'DRIVING', (
        'forward 0.5 m (speed 50 %)', '6.2 s left, planned: 4.0 s', '2.2 s, 0.300 m left')),
    ({'pause': 0.0, 'override': 0.5}, 'PAUSED', (
        'forward 0.5 m (speed 50 %)', '6.2 s left, planned: 4.0 s', '2.2 s, 0.300 m left')),
    ({'pause': 0.0}, 'PAUSED', ('forward 0.5 m\n', '3.1 s left, planned: 4.0 s')),
    ({'obstacle': 0.05, 'override': 0.1}, 'PAUSED', (
        'forward 0.5 m (obstacle 5 %, speed 10 %)', '3.1 s left, planned: 4.0 s'))])
def test_what_is_left_takes_longer_at_less_speed(drawn, factors, state, texts):
    tracker = driven(0.8)
    tracker.on_event(SpeedFactorChanged(START + 0.88, factors))
    tracker.on_event(StateChanged(START + 0.88, DriveState[state]))
    text = '\n'.join(drawn(tracker.status_at(START + 0.88), 100))
    assert f' {state} ' in text
    for part in texts:
        assert part in text


@pytest.mark.parametrize('factors', [{}, {'override': 0.5}])
def test_after_an_early_end_nothing_is_left(drawn, factors):
    tracker = driven(0.8)
    tracker.on_event(SpeedFactorChanged(START + 0.88, factors))
    tracker.on_event(MotionEnded(START + 0.88, 'stop requested'))
    tracker.on_event(StateChanged(START + 0.88, DriveState.CUT_SHORT))
    text = '\n'.join(drawn(tracker.status_at(START + 5.0), 100))
    assert ' CUT SHORT ' in text
    assert '22 %   planned: 4.0 s' in text
    assert 'left' not in text


def held(said, factor=0.0, **others):
    """Return the events of a watch that holds a robot, or slows it down."""
    state = DriveState.PAUSED if factor == 0.0 else DriveState.DRIVING
    return (WatchChanged(START + 0.9, *said),
            SpeedFactorChanged(START + 0.9, {'obstacle': factor, **others}),
            StateChanged(START + 0.9, state))


OBSTACLE, SILENT = (WatchState.OBSTACLE, 0.31, 0.0), (WatchState.NO_SCAN,)


@pytest.mark.parametrize('events, shown, is_resumed', [
    (held(OBSTACLE), ' HELD   obstacle 0.31 m ahead, goes on by itself\n', False),
    (held(OBSTACLE, override=0.5),
     ' HELD   obstacle 0.31 m ahead, goes on by itself (speed 50 %)\n', False),
    (held(SILENT), ' HELD   no scan of the laser, goes on with the next one; r goes on slowly\n',
     True),
    (held(OBSTACLE, pause=0.0), ' PAUSED   step 1 of 3: forward 0.5 m (obstacle 0 %)\n', True),
    (held((WatchState.BLIND,), 0.3),
     (' DRIVING   step 1 of 3: forward 0.5 m '
      '(no scan of the laser: at 30 % until one comes)\n'), False)])
def test_who_is_held_by_an_obstacle_goes_on_by_itself(drawn, events, shown, is_resumed):
    tracker = driven(0.8)
    for event in events:
        tracker.on_event(event)
    status = tracker.status_at(START + 0.9)
    assert shown in '\n'.join(drawn(status, 100))
    assert status.waits_for_resume is is_resumed


def test_lines_say_once_how_to_stop_and_only_to_somebody_at_a_terminal():
    for has_hint in (True, False):
        lines = []
        renderer = LineRenderer(lines.append, has_hint)
        renderer.show(waiting().status_at(START), START, 'q stops')
        assert lines == []
        for elapsed in (0.1, 0.2, 2.5):
            renderer.show(driven(elapsed).status_at(START + elapsed), START + elapsed, 'q stops')
        assert lines == [*has_hint * ['q stops\n'], 'step 1 of 3: forward 0.5 m (2 s)\n',
                         'step 2 of 3: turn 57.296 deg (1 s)\n']


@given(columns=st.integers(60, 250), events=st.lists(EVENTS, max_size=8), now=TIMES,
       title=st.text(max_size=80))
def test_no_line_of_a_panel_is_wider_than_the_terminal(columns, events, now, title):
    pytest.importorskip('rich', reason='needs rich')
    from kachaka_simple_control.display.panel import HEIGHT, render_panel
    from rich.cells import cell_len
    from rich.console import Console
    tracker = DriveTracker()
    for event in (SessionStarted(title, 'kachaka', ABRUPT, 0.3, 0.0, 'a', None), *events):
        tracker.on_event(event)
    console = Console(file=io.StringIO(), highlight=False, markup=False)
    lines = render_panel(console, columns, tracker.status_at(now), 'Ctrl+C stops the robot')
    assert len(lines) == HEIGHT
    assert max(map(cell_len, lines)) < columns
    assert all(line.isprintable() for line in lines)
    assert 'Ctrl+C stops the robot' in lines[0]
