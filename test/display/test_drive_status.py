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
"""What a person is told of a drive while it goes on: worked out from events, told the time."""

import io
from itertools import pairwise
import math

from hypothesis import assume, given
from hypothesis import strategies as st
from kachaka_simple_control.display.drive_status import COARSE, DriveState, DriveTracker
from kachaka_simple_control.display.renderers import APART, StepLogger
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import ORIGIN, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion, Move, Turn, Wait
from kachaka_simple_control.telemetry.events import (
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SessionEnded,
    SessionStarted,
    VelocitySent,
)
import pytest
from strategies import LIMITS, MOTIONS, UNHURRIED

START = 100.0
#: At full speed at once: 2 s forward, 1 s to the left, 1 s of rest.
ABRUPT = Limits(0.25, 1.0)
THREE = Motion('three', (Forward(0.5), Turn(1.0), Wait(1.0)))
OPENED = SessionStarted('three', 'kachaka', ABRUPT, 0.3, 0.0, 'cmd_vel', 'odometry')
TIMES = st.floats(0.0, 1000.0)
VELOCITIES = st.builds(Velocity, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
EVENTS = st.one_of(
    st.just(OPENED), st.builds(MotionPlanned, st.just(THREE), st.just(ABRUPT), st.just(10.0)),
    st.just(MotionPlanned(Motion('empty', ()), ABRUPT, 10.0)),
    st.builds(MotionStarted, TIMES), st.builds(VelocitySent, TIMES, VELOCITIES),
    st.builds(OdometryReceived, TIMES, st.builds(Pose, st.floats(-9, 9), st.floats(-9, 9)),
    VELOCITIES),
    st.builds(MotionEnded, TIMES, st.none() | st.text()), st.builds(SessionEnded, TIMES))


def begun(motion=THREE, limits=ABRUPT, opened=OPENED):
    """Return the progress of a motion whose first velocity was sent."""
    progress = DriveTracker()
    for event in (opened, MotionPlanned(motion, limits, 10.0), VelocitySent(START, Velocity(0.25)),
                  MotionStarted(START)):
        progress.on_event(event)
    return progress


def driven(until, step=0.1, gain=1.0):
    """Return the progress of a drive that goes as planned, with odometry at each message."""
    progress, pose = begun(), ORIGIN
    for tick in range(round(until / step) + 1):
        elapsed = tick * step
        velocity = Velocity(0.25) if elapsed < 2.0 - 1e-9 else (
            Velocity(0.0, 1.0) if elapsed < 3.0 - 1e-9 else ZERO)
        progress.on_event(VelocitySent(START + elapsed, velocity))
        pose = Pose(0.25 * gain * min(elapsed, 2.0), 0.0, max(0.0, min(elapsed - 2.0, 1.0)))
        progress.on_event(OdometryReceived(START + elapsed, pose, velocity))
    return progress


@given(st.lists(EVENTS, max_size=12), TIMES)
def test_any_events_in_any_order_are_looked_at(told, now):
    """A display must not fail in the middle of a drive, whatever it is told."""
    progress = DriveTracker()
    for event in told:
        progress.on_event(event)
        glance = progress.status_at(now)
        assert 0.0 <= glance.fraction <= 1.0 + 1e-9
        assert glance.seen_ago >= 0.0
        if glance.step is not None:
            assert 0.0 <= glance.step.time_left <= glance.step.duration
            assert glance.step.time_left <= glance.time_left + 1e-9
            assert all(left is None or left >= 0.0
                       for left in (glance.step.left.distance, glance.step.left.angle))


@UNHURRIED
@given(MOTIONS, LIMITS, st.floats(5.0, 100.0))
def test_when_steps_are_due_does_not_depend_on_the_rate(motion, limits, rate):
    try:
        fine, coarse = plan(motion, limits, rate), plan(motion, limits, COARSE)
    except InvalidMotionError:
        assume(False)
    assert [(one.start, one.end) for one in fine.steps] == [
        (one.start, one.end) for one in coarse.steps]


@UNHURRIED
@given(MOTIONS, LIMITS, st.floats(0.0, 1.0))
def test_time_runs_off_as_planned(motion, limits, part):
    try:
        planned = plan(motion, limits, 10.0)
    except InvalidMotionError:
        assume(False)
    assume(planned.steps)
    now = START + part * planned.duration
    glance = begun(motion, limits).status_at(now)
    elapsed = now - START
    assert glance.time_left == pytest.approx(planned.duration - elapsed, abs=1e-9)
    stage = planned.steps[glance.step.number - 1] if glance.step.count else None
    if stage is not None:
        assert stage.start - 1e-9 <= elapsed <= stage.end + 1e-9
        assert glance.step.time_left == pytest.approx(stage.end - elapsed, abs=1e-9)


def test_each_step_is_told_with_its_number_its_words_and_what_is_left():
    for elapsed, number, words in ((0.0, 1, 'forward 0.5 m'), (1.9, 1, 'forward 0.5 m'),
                                   (2.1, 2, 'turn 57.296 deg'), (3.5, 3, 'wait 1 s')):
        step = driven(elapsed).status_at(START + elapsed).step
        assert (step.number, step.count, step.words) == (number, 3, words)
    step = driven(0.8).status_at(START + 0.8).step
    assert step.time_left == pytest.approx(1.2)
    assert (step.left.distance, step.left.angle) == (pytest.approx(0.3), None)
    step = driven(2.4).status_at(START + 2.4).step
    assert (step.left.distance, step.left.angle) == (None, pytest.approx(0.6))


def test_what_is_left_is_what_odometry_says_as_long_as_it_speaks():
    """Of a robot that goes half as far as it is told."""
    progress = driven(1.0, gain=0.5)
    left = progress.status_at(START + 1.0).step.left
    assert (left.distance, left.is_seen) == (pytest.approx(0.375), True)
    for tick in range(11, 18):
        progress.on_event(VelocitySent(START + tick / 10, Velocity(0.25)))
    left = progress.status_at(START + 1.7).step.left
    assert (left.distance, left.is_seen) == (pytest.approx(0.075), False)


def test_a_stretch_over_two_steps_is_shared_between_them():
    progress = begun()
    progress.on_event(OdometryReceived(START + 1.9, Pose(0.475), Velocity(0.25)))
    progress.on_event(OdometryReceived(START + 2.1, Pose(0.5, 0.0, 0.1), Velocity(0.0, 1.0)))
    assert progress.status_at(START + 2.1).step.left.angle == pytest.approx(0.95)


def test_states_follow_each_other():
    progress = DriveTracker()
    assert progress.status_at(0.0).state is DriveState.READY
    progress.on_event(OPENED)
    progress.on_event(MotionPlanned(THREE, ABRUPT, 10.0))
    assert progress.status_at(1.0).state is DriveState.WAITING
    progress.on_event(VelocitySent(2.0, ZERO))
    assert progress.status_at(2.05).state is DriveState.CONNECTING
    progress.on_event(VelocitySent(2.1, Velocity(0.25)))
    progress.on_event(MotionStarted(2.1))
    assert progress.status_at(2.1).state is DriveState.DRIVING
    progress.on_event(VelocitySent(6.1, ZERO))
    progress.on_event(MotionEnded(6.1))
    assert progress.status_at(6.15).state is DriveState.STOPPING
    assert progress.status_at(6.3).state is DriveState.STOPPED
    assert progress.status_at(6.3).fraction == 1.0


def test_a_stop_is_seen_from_its_first_zeros():
    """Its end is told 0.4 s later; until then no step begins that never will."""
    progress = driven(1.9)
    for number in range(10):
        progress.on_event(VelocitySent(START + 1.95 + 0.0001 * number, ZERO))
    progress.on_event(VelocitySent(START + 1.99, ZERO))
    glance = progress.status_at(START + 2.03)
    assert glance.state is DriveState.STOPPING
    assert glance.step.number == 1
    assert StepLogger().update(glance, START + 2.03) == []
    progress.on_event(MotionEnded(START + 2.35, 'stopped by SIGINT'))
    assert progress.status_at(START + 2.5).state is DriveState.CUT_SHORT


def test_zeros_of_a_plan_are_no_stop():
    assert driven(3.5).status_at(START + 3.5).state is DriveState.DRIVING


def test_as_long_as_odometry_sees_it_move_it_is_stopping():
    progress = driven(1.0)
    progress.on_event(MotionEnded(START + 1.0, 'stopped by SIGINT'))
    assert progress.status_at(START + 1.2).state is DriveState.STOPPING
    progress.on_event(OdometryReceived(START + 1.2, Pose(0.3), ZERO))
    glance = progress.status_at(START + 1.2)
    assert (glance.state, glance.reason) == (DriveState.CUT_SHORT, 'stopped by SIGINT')
    assert glance.fraction == pytest.approx(0.25)


def test_a_program_that_says_nothing_is_held_up():
    progress = driven(1.0)
    assert progress.status_at(START + 1.5).silent_for is None
    assert progress.status_at(START + 3.0).silent_for == pytest.approx(2.0)
    progress.on_event(MotionEnded(START + 3.0))
    assert progress.status_at(START + 5.0).silent_for is None


def test_movements_by_call_are_counted_without_an_end():
    """Nobody knows how many a program has in mind."""
    lesson = SessionStarted('lesson', 'kachaka', ABRUPT, 0.3, 0.0, 'cmd_vel', None)
    progress = begun(Motion('move_robot', (Move(0.1, 0.0, 1.0),)), ABRUPT, lesson)
    assert progress.status_at(START).step.number == 1
    progress.on_event(MotionEnded(START + 1.0))
    progress.on_event(MotionPlanned(Motion('move_robot', (Move(0.0, 0.5, 1.0),)), ABRUPT, 10.0))
    step = progress.status_at(START + 1.0).step
    assert (step.number, step.count, step.words) == (2, None, 'move 0 m/s, 0.5 rad/s')


@UNHURRIED
@given(st.lists(st.floats(0.01, 3.0), min_size=1, max_size=20))
def test_lines_tell_each_step_once_and_not_too_fast(durations):
    progress = begun(Motion('three', tuple(map(Wait, durations))))
    lines, told = StepLogger(), []
    for tick in range(round(sum(durations) * 20) + 1):
        now = START + tick / 20
        told += [(now, line) for line in lines.update(progress.status_at(now), now)]
    assert told[0][1].startswith('step 1 of ')
    assert all(two - one >= APART - 1e-9 for (one, _), (two, _) in pairwise(told))
    numbers = [int(line.split()[1]) for _, line in told]
    assert numbers == sorted(set(numbers))
    for before, (_, line), number in zip([0, *numbers], told, numbers):
        passed = number - before - 1
        assert line.endswith(
            f'; {passed} {"step" if passed == 1 else "steps"} before it passed'
            if passed else ' s)')
    if min(durations) >= 0.6:
        assert numbers == list(range(1, len(durations) + 1))


def test_a_line_has_what_there_is_to_know():
    assert StepLogger().update(begun().status_at(START), START) == [
        'step 1 of 3: forward 0.5 m (2 s)']


def test_a_motion_that_is_driven_again_is_told_again():
    progress, lines, told = begun(), StepLogger(), []
    for run in range(2):
        start = START + 10.0 * run
        progress.on_event(MotionPlanned(THREE, ABRUPT, 10.0))
        told += lines.update(progress.status_at(start - 0.1), start - 0.1)
        progress.on_event(MotionStarted(start))
        told += lines.update(progress.status_at(start), start)
        progress.on_event(MotionEnded(start + 4.0))
    assert told == ['step 1 of 3: forward 0.5 m (2 s)'] * 2


def test_a_robot_that_does_not_come_is_told_of_once():
    progress, lines = DriveTracker(), StepLogger()
    progress.on_event(OPENED)
    progress.on_event(MotionPlanned(THREE, ABRUPT, 10.0))
    told = [line for tick in range(100) for line
        in lines.update(progress.status_at(tick), float(tick))]
    assert told == ['three: waiting for the robot']


@pytest.fixture
def drawn():
    """Return what draws a panel without colours."""
    pytest.importorskip('rich', reason='needs rich')
    from kachaka_simple_control.display.panel import render_panel
    from rich.console import Console

    def draw(glance, columns, encoding='utf-8', hint='Ctrl+C stops the robot'):
        file = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        return render_panel(
            Console(file=file, highlight=False, markup=False), columns, glance, hint)
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


@UNHURRIED
@given(columns=st.integers(60, 250), told=st.lists(EVENTS, max_size=8), now=TIMES,
       title=st.text(max_size=80))
def test_no_line_of_a_panel_is_wider_than_the_terminal(columns, told, now, title):
    pytest.importorskip('rich', reason='needs rich')
    from kachaka_simple_control.display.panel import HEIGHT, render_panel
    from rich.cells import cell_len
    from rich.console import Console
    progress = DriveTracker()
    for event in (SessionStarted(title, 'kachaka', ABRUPT, 0.3, 0.0, 'a', None), *told):
        progress.on_event(event)
    console = Console(file=io.StringIO(), highlight=False, markup=False)
    lines = render_panel(console, columns, progress.status_at(now), 'Ctrl+C stops the robot')
    assert len(lines) == HEIGHT
    assert max(map(cell_len, lines)) < columns
    assert all(line.isprintable() for line in lines)
    assert 'Ctrl+C stops the robot' in lines[0]


@pytest.mark.parametrize('encoding', ['utf-8', 'latin-1'])
def test_the_bar_can_be_read_without_colours(drawn, encoding):
    bar = drawn(driven(3.0).status_at(START + 3.0), 100, encoding)[3]
    done, rest = ('\u2501', '\u2500') if encoding == 'utf-8' else ('#', '-')
    assert bar.count(done) == pytest.approx(3 * bar.count(rest), abs=3)
    assert math.isclose(bar.count(done) + bar.count(rest), 99 - 30, abs_tol=6)


def test_a_long_reason_takes_two_lines(drawn):
    progress = driven(1.0)
    reason = 'the guardian stopped the robot: the node fell silent, and stayed so'
    progress.on_event(MotionEnded(START + 1.0, reason))
    lines = drawn(progress.status_at(START + 5.0), 60)
    assert ' '.join(' '.join(lines[1:3]).split()) == f'CUT SHORT {reason}'
