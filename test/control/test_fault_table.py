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
"""
Every fault of a run that needs no operating system, and how it ends: with a stop, at any moment.

The rows of "Who stops it" in docs/safety.md, with ports that record, and a clock that is set: the
gate, the monitor, the lease, the loop and the stop are the real ones.
"""

from __future__ import annotations

from itertools import pairwise
import math
import re
from types import SimpleNamespace

from fake_time import FakePublisher, FakeTime
from kachaka_simple_control.control.drive_loop import DriveLoop
from kachaka_simple_control.control.drive_monitor import DriveMonitor, LeaseRenewer
from kachaka_simple_control.control.events import (
    DriveState,
    MotionEnded,
    MotionStarted,
    ProgressMade,
    SpeedFactorChanged,
    StateChanged,
    StopConfirmed,
    VelocityKind,
    VelocitySent,
)
from kachaka_simple_control.control.guardian import NullGuardian
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.speed_factor import PAUSE, SpeedFactor
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.stop import StopController
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.control.timing import (
    CHECK_PERIOD,
    FEEDBACK_TIMEOUT,
    LEASE_RENEW_LATEST,
    STOP_BURST_COUNT,
)
from kachaka_simple_control.control.velocity_gate import VelocityGate
from kachaka_simple_control.errors import (
    ControlError,
    MotionRefusedError,
    MotionStoppedError,
    PauseTimeoutError,
    RunFaultError,
)
from kachaka_simple_control.motion.geometry import integrate, ORIGIN, ZERO
from kachaka_simple_control.motion.limits import CLOSED_LOOP_SHARE, Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion, Turn
import pytest

LIMITS = Limits(0.3, 1.5, 0.5, 2.5)
COMMAND_TIMEOUT = 0.3
PLAN = plan(Motion('there', (Forward(1.0), Turn(1.5))), LIMITS.scaled(CLOSED_LOOP_SHARE), 20.0)
#: When the fault comes [s after t = 0]: while it speeds up, cruises, brakes, turns.
MOMENTS = [0.06, 0.4, 1.9, 3.1, 4.6]


class Robot:
    """A robot that does what it is sent, its odometry, and the ports of its drive."""

    def __init__(self, is_closed_loop=False):
        """Take the robot."""
        self.time = FakeTime()
        self.wire = FakePublisher(self.time)
        self.guardian = NullGuardian()
        self.heartbeats = []
        self.events = []
        self.gate = VelocityGate(
            self.transmit, LIMITS, self.guardian.latch, self.guardian.sending, self.time.clock,
            self.time.clock)
        self.gate.publish = self.events.append
        self.gate.open()
        self.factor, self.odometry = SpeedFactor(self.time.clock), StandstillDetector()
        self.port = SimpleNamespace(
            check_identity=lambda: None, check_exclusive=lambda: None,
            has_changed=lambda: False, update=lambda: False)
        self.response = SimpleNamespace(done=True, refusal=None)
        self.lease = LeaseRenewer(lambda: self.response, COMMAND_TIMEOUT)
        self.lease.granted(self.time.now)
        self.monitor = DriveMonitor(
            self.guardian, self.lease, self.port, self.port, self.odometry,
            SimpleNamespace(odometry_timeout=1.0, pause_timeout=600.0), self.factor)
        self.feedback = PoseFeedback(0.1) if is_closed_loop else None
        self.drive = RobotDrive(self.gate, self.monitor, self.factor, COMMAND_TIMEOUT)
        self.stopper = StopController(
            self.gate, COMMAND_TIMEOUT, self.guardian,
            lambda: self.odometry.is_moving(self.time.now), self.time.clock, self.time.sleep,
            self.events.append)
        self.stopper.on_stop = self.drive.on_stop
        #: what odometry does
        self.has_odometry, self.is_odometry_new, self.drift = True, True, 0.0
        self.pose, self.velocity, self.moved = ORIGIN, ZERO, self.time.now
        self.obeys = True
        self.time.on_sleep = self.on_sleep
        self.at, self.happen = math.inf, lambda: None
        for _ in range(30):
            self.time.sleep(0.02)

    def transmit(self, velocity):
        """Take a velocity."""
        self.wire.transmit(velocity)
        self.roll()
        if self.obeys or not velocity.is_zero:
            self.velocity = velocity

    def roll(self):
        """Go on by the velocity."""
        self.pose = integrate(self.pose, self.velocity, self.time.now - self.moved)
        self.moved = self.time.now

    def on_sleep(self):
        """Let odometry come, and the fault."""
        if self.time.now >= self.at:
            self.at, happen = math.inf, self.happen
            happen()
        self.roll()
        if self.has_odometry:
            self.odometry.on_odometry(self.time.now, self.velocity)
            self.monitor.pause_pose.on_odometry(
                self.time.now, self.pose, self.odometry.still_since(self.time.now))
            if self.feedback is not None and self.is_odometry_new:
                pose = type(self.pose)(self.pose.x + self.drift, self.pose.y, self.pose.theta)
                self.feedback.on_odometry(
                    self.time.now, pose, self.odometry.is_moving(self.time.now))

    def run(self, at, happen):
        """Drive; at a time after t = 0 something happens.  Return the error that ends it."""
        if self.feedback is not None:
            self.feedback.begin(PLAN, LIMITS)
        self.monitor.begin(self.time.now, self.feedback, PLAN.period)
        self.drive.request(self.time.now, 'there', PLAN)
        start = self.time.now
        self.at, self.happen = start + at, happen
        self.drive.begin(TickScheduler(PLAN), start, PLAN.period)
        try:
            # As a thread that is woken: at most a check apart.
            DriveLoop(
                self.time.clock, lambda left: self.time.sleep(min(left, 0.01)),
                lambda: self.heartbeats.append(self.time.now)).run([self.drive])
        except ControlError as error:
            self.stopper.stop(error)
            self.drive.finish(self.time.now, str(error))
            return error
        self.drive.finish(self.time.now)
        self.stopper.stop(MotionStoppedError('over'))
        return None

    @property
    def states(self):
        """Return the states of the drive, as they were published."""
        return [event.state for event in self.events if isinstance(event, StateChanged)]


def raising(error):
    """Return a port that raises."""
    def port():
        raise error
    return port


def fault(robot, name, value):
    """Return what sets an attribute of a robot or its port."""
    return lambda: setattr(robot, name, value)


def stands(robot):
    """Freeze the program for 0.5 s."""
    robot.time.now += 0.5


LEFT = RunFaultError('the robot left')
#: What happens, and which error ends the run [class, text].
FAULTS = {
    'the subscription disappears': (
        lambda robot: (setattr(robot.port, 'has_changed', lambda: True),
                       setattr(robot.port, 'check_identity', raising(LEFT))),
        RunFaultError, 'the robot left'),
    'another robot takes its place': (
        lambda robot: setattr(robot.port, 'check_identity', raising(RunFaultError('another'))),
        RunFaultError, 'another'),
    'a second robot appears': (
        lambda robot: setattr(robot.port, 'check_exclusive', raising(RunFaultError('two'))),
        RunFaultError, 'two'),
    'odometry falls silent': (
        lambda robot: setattr(robot, 'has_odometry', False),
        RunFaultError, r'odometry has been silent for 1\.0 s'),
    'the program is held up': (stands, RunFaultError, 'nothing was sent for 5.* ms'),
    'the guardian is gone': (
        lambda robot: setattr(robot.guardian, 'check', raising(RunFaultError('gone'))),
        RunFaultError, 'gone'),
    'the guardian stops the robot': (
        lambda robot: robot.guardian.latch.trip(robot.time.now),
        MotionRefusedError, 'stopped permanently'),
    'a signal': (
        lambda robot: robot.guardian.latch.trip(), MotionRefusedError, 'stopped permanently'),
    'another program sends': (
        lambda robot: robot.drive.end(RunFaultError('another program sends')),
        RunFaultError, 'another program sends'),
    'a stop is asked for': (
        lambda robot: robot.drive.end(MotionStoppedError('by ~/stop')),
        MotionStoppedError, 'by ~/stop'),
    'manual control is refused': (
        lambda robot: (robot.lease.granted(robot.time.now - LEASE_RENEW_LATEST),
                       setattr(robot, 'response', SimpleNamespace(done=True, refusal='low'))),
        RunFaultError, 'took manual control away: low'),
    'manual control is not answered': (
        lambda robot: (robot.lease.granted(robot.time.now - LEASE_RENEW_LATEST),
                       setattr(robot, 'response', SimpleNamespace(done=False, refusal=None))),
        RunFaultError, 'manual control was not renewed within'),
    'a pause takes too long': (
        lambda robot: (robot.factor.set(PAUSE, 0.0),
                       setattr(robot.monitor, '_pause_timeout', 2.0)),
        PauseTimeoutError, 'paused for 2 s'),
}
#: Those of a closed loop alone.
LOOP_FAULTS = {
    'the robot is not where it should be': (
        lambda robot: setattr(robot, 'drift', 0.5), RunFaultError, 'from where it should be'),
    'odometry says nothing new': (
        lambda robot: setattr(robot, 'is_odometry_new', False),
        RunFaultError, f'nothing new for {FEEDBACK_TIMEOUT:.1f} s'),
}


def assert_stopped(robot, error):
    """Assert that all promises of a stop are kept."""
    sent = [event for event in robot.events if isinstance(event, VelocitySent)]
    last = max(place for place, event in enumerate(sent) if event.is_of_run)
    zeros = sent[last + 1:]
    # Nothing of the run follows the first zero, and each zero says what it is.
    assert all(event.velocity == ZERO for event in zeros)
    assert {event.kind for event in zeros} <= {VelocityKind.STOP, VelocityKind.GUARDIAN}
    assert len(zeros) >= STOP_BURST_COUNT
    assert zeros[-1].time - zeros[0].time >= COMMAND_TIMEOUT
    paused = [DriveState.PAUSED] * isinstance(error, PauseTimeoutError)
    assert robot.states == [
        DriveState.WAITING, DriveState.DRIVING, *paused, DriveState.STOPPING,
        DriveState.CUT_SHORT]
    # Our first zero, which is sent at once, comes before the event, and no other.
    stopping = robot.events.index(StateChanged(robot.stopper.stop_started, DriveState.STOPPING))
    assert sum(event in zeros and event.kind is VelocityKind.STOP
               for event in robot.events[:stopping]) == 1
    assert [type(event) for event in robot.events
            if not isinstance(event, (
                VelocitySent, StateChanged, SpeedFactorChanged, ProgressMade))] == [
        MotionStarted, StopConfirmed, MotionEnded]
    assert StopConfirmed(pytest.approx(robot.time.now)) in robot.events
    assert robot.velocity == ZERO
    with pytest.raises(type(error)):
        robot.drive.step(robot.time.now)
    # A new run begins, unless nothing may move any more.
    if not robot.guardian.latch.is_set:
        robot.gate.begin(0.2)


@pytest.mark.parametrize('at', MOMENTS)
@pytest.mark.parametrize('is_closed_loop', [False, True])
@pytest.mark.parametrize('name', FAULTS)
def test_each_fault_ends_the_run_and_stops_the_robot(name, is_closed_loop, at):
    happen, kind, text = FAULTS[name]
    robot = Robot(is_closed_loop)
    error = robot.run(at, lambda: happen(robot))
    assert isinstance(error, kind)
    assert re.search(text, str(error))
    assert_stopped(robot, error)


@pytest.mark.parametrize('at', MOMENTS)
@pytest.mark.parametrize('name', LOOP_FAULTS)
def test_each_fault_of_a_closed_loop_ends_the_run_and_stops_the_robot(name, at):
    happen, kind, text = LOOP_FAULTS[name]
    robot = Robot(is_closed_loop=True)
    error = robot.run(at, lambda: happen(robot))
    assert isinstance(error, kind)
    assert text in str(error)
    assert_stopped(robot, error)


@pytest.mark.parametrize('is_closed_loop', [False, True])
@pytest.mark.parametrize('happen', [
    lambda _: None,
    # Nobody depends on what is optional.
    lambda robot: robot.factor.set('obstacle', 0.5),
    lambda robot: robot.lease.granted(robot.time.now - LEASE_RENEW_LATEST),
], ids=['nothing', 'less speed', 'manual control is renewed'])
def test_without_a_fault_it_is_driven_to_its_end(happen, is_closed_loop):
    robot = Robot(is_closed_loop)
    assert robot.run(0.5, lambda: happen(robot)) is None
    assert robot.pose.x == pytest.approx(PLAN.pose.x, abs=0.01)
    assert robot.states == [
        DriveState.WAITING, DriveState.DRIVING, DriveState.STOPPING, DriveState.STOPPED]
    kinds = {event.kind for event in robot.events
             if isinstance(event, VelocitySent) and event.is_of_run}
    assert kinds == {VelocityKind.PLAN} | ({VelocityKind.CORRECTION} if is_closed_loop else set())
    assert max(two - one for one, two in pairwise(robot.heartbeats)) <= CHECK_PERIOD + 0.011


def test_a_robot_that_does_not_obey_gets_zeros_for_a_second_more():
    robot = Robot()
    error = robot.run(1.0, lambda: (
        setattr(robot, 'obeys', False), robot.drive.end(MotionStoppedError('enough'))))
    assert isinstance(error, MotionStoppedError)
    zeros = [event.time for event in robot.events
             if isinstance(event, VelocitySent) and event.kind is VelocityKind.STOP]
    assert zeros[-1] - zeros[0] == pytest.approx(COMMAND_TIMEOUT + 1.1, abs=0.1)
    assert not any(isinstance(event, StopConfirmed) for event in robot.events)
