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
"""The plan runner: what it sends, and when, by a clock that the test advances."""

from itertools import groupby, pairwise
import math

from fake_time import FakePublisher, FakeTime
from kachaka_simple_control.control.drive_loop import DriveLoop
from kachaka_simple_control.control.events import (
    DriveState,
    MotionStarted,
    StateChanged,
    VelocitySent,
)
from kachaka_simple_control.control.guardian_memory import Latch
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.control.timing import CHECK_PERIOD, max_gap
from kachaka_simple_control.control.velocity_gate import VelocityGate
from kachaka_simple_control.errors import RunFaultError
from kachaka_simple_control.motion.geometry import Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move
import pytest

LIMITS = Limits(0.3, 1.57)
COMMAND_TIMEOUT = 0.3


class CountingMonitor:
    """A run monitor that counts its checks."""

    speed_factor, watch = 1.0, None

    def __init__(self):
        """Start at zero."""
        self.checks = 0

    def correct(self, tick, now):
        """Return what was planned."""
        return tick.velocity

    def on_sent(self, now, rest, plan_time):
        """Do nothing."""

    def check(self, now):
        """Count a check."""
        self.checks += 1


class Bench:
    """A plan, a velocity gate and a clock."""

    def __init__(self, *moves, rate=10.0):
        """Open the gate."""
        self.time = FakeTime()
        self.wire = FakePublisher(self.time)
        self.latch = Latch()
        self.gate = VelocityGate(
            self.wire.transmit, LIMITS, self.latch, None,
            self.time.clock, self.time.clock)
        self.gate.open()
        self.plan = plan(Motion('test', moves), LIMITS, rate)
        self.monitor = CountingMonitor()
        self.factor = SpeedFactor(self.time.clock)
        self.drive = RobotDrive(self.gate, self.monitor, self.factor, COMMAND_TIMEOUT)
        self.events = []
        self.gate.publish = self.events.append

    def run(self):
        """Run the plan."""
        self.drive.request(self.time.now, 'test', self.plan)
        self.drive.begin(TickScheduler(self.plan), self.time.now, self.plan.period)
        DriveLoop(self.time.clock, self.time.sleep).run([self.drive])
        self.drive.finish(self.time.now)

    @property
    def sent(self):
        """Return the events of what was sent."""
        return [event for event in self.events if isinstance(event, VelocitySent)]

    @property
    def states(self):
        """Return the states that were published; the last one is that of the progress."""
        states = [event.state for event in self.events if isinstance(event, StateChanged)]
        assert states[-1] is self.drive.progress.state
        return states


def test_a_move_is_held_for_its_duration_and_ends_in_a_zero():
    bench = Bench(Move(0.1, 0.0, 1.0))
    start = bench.time.now
    bench.run()
    times = [at - start for at, _ in bench.wire.sent]
    assert times == pytest.approx([0.1 * k for k in range(11)])
    assert [v for _, v in bench.wire.sent] == [Velocity(0.1, 0.0)] * 10 + [ZERO]


def test_a_delayed_run_tells_where_on_the_plan_each_message_is_to_the_last_zero():
    bench = Bench(Move(0.1, 0.0, 1.0))
    bench.monitor.speed_factor = 0.5
    bench.run()
    plan_times = [event.plan_time for event in bench.sent]
    assert len(plan_times) > 15
    assert plan_times[1:] == sorted(plan_times[1:])
    assert plan_times[-1] == bench.plan.duration


def test_late_wakeups_do_not_add_up():
    """Deadlines are absolute: 5 ms late each time, and still 1 s in all, not 1.05 s."""
    bench = Bench(Move(0.1, 0.0, 1.0))
    start, sleep = bench.time.now, bench.time.sleep
    bench.time.sleep = lambda duration: sleep(duration + 0.005)
    bench.run()
    assert bench.wire.sent[-1][0] - start == pytest.approx(1.0, abs=0.006)
    assert len(bench.wire.sent) == 11


def test_it_checks_for_faults_between_velocities():
    bench, checks = Bench(Move(0.1, 0.0, 1.0), rate=5.0), []
    bench.monitor.check = lambda now: checks.append(bench.time.now)
    bench.run()
    assert max(after - before for before, after in pairwise(checks)) <= CHECK_PERIOD + 1e-9
    assert len(checks) < 50


def test_it_checks_for_faults_even_if_every_message_is_late():
    """Publishing takes longer than a period, as while other participants join."""
    bench = Bench(Move(0.1, 0.0, 1.0), rate=50.0)
    transmit, checks, late = bench.gate._transmit, [], 0.03

    def held_up(velocity):
        transmit(velocity)
        bench.time.now += late

    bench.gate._transmit = held_up
    bench.monitor.check = lambda now: checks.append(bench.time.now)
    bench.run()
    gaps = [after - before for before, after in pairwise(checks)]
    assert max(gaps) <= late + 2.0 * CHECK_PERIOD + 1e-6


@pytest.mark.parametrize('is_dds', [True, False])
def test_a_slow_check_ends_the_run_unless_it_waits_for_dds(is_dds):
    bench = Bench(Move(0.1, 0.0, 1.0), rate=50.0)

    def wait():
        bench.time.now += 0.25 if bench.monitor.checks % 10 == 5 else 0.0

    def check(now):
        bench.monitor.checks += 1
        bench.monitor.wait_for_dds(wait) if is_dds else wait()

    bench.monitor.check = check
    if is_dds:
        bench.run()
    else:
        with pytest.raises(RunFaultError, match='nothing was sent for 2.. ms'):
            bench.run()
    assert bench.wire.sent[-1][1] == ZERO


def test_a_gap_within_the_limit_does_not_end_the_run():
    bench = Bench(Move(0.1, 0.0, 1.0))
    frozen = []

    def freeze():
        if len(bench.wire.sent) == 3 and not frozen:
            frozen.append(True)
            bench.time.now += 0.09

    bench.time.on_sleep = freeze
    bench.run()
    assert bench.wire.sent[-1][1] == ZERO


@pytest.mark.parametrize('period, gap', [(0.1, 0.2), (0.01, 0.11), (0.2, 0.3), (0.25, 0.3)])
def test_the_largest_gap_is_a_period_and_100_ms_but_at_most_the_command_timeout(period, gap):
    assert gap == pytest.approx(max_gap(period, COMMAND_TIMEOUT))


def test_a_run_begins_before_its_first_velocity_and_each_says_when_it_was_due():
    bench = Bench(Move(0.1, 0.0, 0.35))
    start = bench.time.now
    bench.run()
    before, = (place for place, event in enumerate(bench.events) if event == MotionStarted(start))
    assert bench.events.index(bench.sent[0]) > before
    assert [event.due for event in bench.sent] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.35])
    assert [event.plan_time for event in bench.sent] == [event.due for event in bench.sent]
    assert not any(event.is_delayed for event in bench.sent)


@pytest.mark.parametrize('delays, late, skipped', [
    ({}, 0, 0), ({2: 0.0249}, 0, 0), ({2: 0.0251}, 1, 0),
    # Due at 0.1 and never sent; that of 0.2 comes 10 ms late, or 30 ms.
    ({1: 0.11}, 0, 1), ({1: 0.13}, 1, 1)])
def test_late_and_skipped_velocities_are_counted(delays, late, skipped):
    bench = Bench(Move(0.1, 0.0, 1.0))
    bench.drive._command_timeout = 1.0
    transmit, count = bench.gate._transmit, iter(range(99))

    def slow(velocity):
        transmit(velocity)
        # Until the velocity after this one is late by that.
        bench.time.now += 0.1 + delays.pop(number) if (number := next(count) + 1) in delays else 0

    bench.gate._transmit = slow
    bench.run()
    progress = bench.drive.progress
    assert (progress.late, progress.skipped) == (late, skipped)
    assert sum(event.skipped for event in bench.sent) == skipped


def test_its_progress_shows_the_run_from_the_request_to_the_end():
    bench = Bench(Move(0.1, 0.0, 1.0), Move(0.0, 0.5, 1.0))
    seen = []
    bench.time.on_sleep = lambda: seen.append(bench.drive.progress)
    start = bench.time.now
    bench.drive.request(start, 'test', bench.plan)
    assert bench.drive.progress.step == (0, 2)
    bench.run()
    assert {progress.state for progress in seen} == {DriveState.DRIVING}
    assert {progress.began for progress in seen} == {start}
    assert [step for step, _ in groupby(progress.step for progress in seen)] == [(1, 2), (2, 2)]
    assert max(progress.way.x for progress in seen) == pytest.approx(0.1)
    bench.drive.request(bench.time.now, 'next', bench.plan)
    bench.drive.finish(bench.time.now, 'the robot left')
    assert bench.drive.progress.ended_by == 'the robot left'


@pytest.mark.parametrize('factor, state', [
    (1.0, DriveState.DRIVING), (0.01, DriveState.DRIVING), (0.005, DriveState.PAUSED),
    (0.0, DriveState.PAUSED)])
def test_a_drive_that_is_held_is_paused(factor, state):
    bench = Bench(Move(0.1, 0.0, 1.0))
    bench.factor.set('obstacle', factor)
    bench.run()
    assert bench.states == [DriveState.WAITING, state, DriveState.STOPPING]
    for _ in range(2):
        bench.factor.set('obstacle', 1.0 - bench.factor.value)
    assert bench.states[-1] is DriveState.STOPPING


def test_a_drive_is_stopped_when_it_is_over_and_all_zeros_are_sent():
    """Whichever comes first, and however often a stop is interrupted."""
    for reason in (None, 'the robot left'):
        bench = Bench(Move(0.1, 0.0, 1.0))
        bench.drive.request(bench.time.now, 'test', bench.plan)
        bench.drive.connect(bench.time.now)
        run = bench.drive.begin(TickScheduler(bench.plan), bench.time.now, bench.plan.period)
        bench.drive.step(bench.time.now)
        for has_ended in (False, True, False, True):
            bench.drive.on_stop(bench.time.now, run, has_ended)
        bench.drive.finish(bench.time.now, reason)
        assert bench.states == [
            DriveState.WAITING, DriveState.CONNECTING, DriveState.DRIVING, DriveState.STOPPING,
            DriveState.STOPPED if reason is None else DriveState.CUT_SHORT]


def test_the_stop_of_a_drive_is_not_that_of_the_next():
    """It is still sent while the next one waits for its robot, and perhaps a moment longer."""
    bench = Bench(Move(0.1, 0.0, 1.0))
    bench.run()
    before = bench.gate.permit
    bench.drive.request(bench.time.now, 'next', bench.plan)
    bench.drive.on_stop(bench.time.now, before, False)
    assert bench.states[-1] is DriveState.WAITING
    bench.drive.begin(TickScheduler(bench.plan), bench.time.now, bench.plan.period)
    bench.drive.step(bench.time.now)
    bench.drive.on_stop(bench.time.now, before, False)
    assert bench.states[-2:] == [DriveState.WAITING, DriveState.DRIVING]
    DriveLoop(bench.time.clock, bench.time.sleep).run([bench.drive])
    bench.drive.finish(bench.time.now)
    bench.drive.on_stop(bench.time.now, before, True)
    assert bench.states[-1] is DriveState.STOPPING


def test_the_planned_pose_is_as_odometry_would_show_it():
    bench = Bench(Move(0.1, 0.0, 1.0))
    bench.drive.request(bench.time.now, 'test', bench.plan)
    assert bench.drive.progress.planned_pose is None
    bench.drive.begin(
        TickScheduler(bench.plan), bench.time.now, bench.plan.period, None,
        Pose(1.0, 2.0, math.pi / 2.0))
    for _ in range(2):
        bench.drive.step(bench.time.now)
        bench.time.now += 0.1
    assert bench.drive.progress.planned_pose == Pose(
        pytest.approx(1.0), pytest.approx(2.01), pytest.approx(math.pi / 2.0))


def test_a_run_that_is_ended_from_outside_has_its_zero_at_once():
    bench = Bench(Move(0.1, 0.0, 1.0))
    bench.time.on_sleep = lambda: (
        bench.drive.end(RunFaultError('enough')) if len(bench.wire.sent) == 3 else None)
    with pytest.raises(RunFaultError, match='enough'):
        bench.run()
    assert [velocity for _, velocity in bench.wire.sent] == [Velocity(0.1, 0.0)] * 3 + [ZERO]
