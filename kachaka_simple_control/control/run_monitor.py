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
"""The checks for faults during a run, and the renewal of manual control."""

from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import Protocol

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.speed_factor import MOVED, SpeedFactor
from kachaka_simple_control.control.standstill import PausePose, StandstillDetector
from kachaka_simple_control.control.tick_scheduler import Tick
from kachaka_simple_control.control.timing import (
    FEEDBACK_TIMEOUT,
    GRAPH_CHECK_PERIOD,
    GRAPH_COUNT_PERIOD,
    HEARTBEAT_TIMEOUT,
    LEASE_RENEW_AT_REST,
    LEASE_RENEW_LATEST,
    SUBSCRIBER_CHECK_PERIOD,
)
from kachaka_simple_control.errors import (
    HELD_UP_ADVICE,
    PauseTimeoutError,
    RobotMovedError,
    RunFaultError,
)
from kachaka_simple_control.motion.geometry import Velocity


class PendingResponse(Protocol):
    """The response to a request for manual control; it may not have arrived yet."""

    @property
    def done(self) -> bool:
        """Whether the response has arrived."""

    @property
    def refusal(self) -> str | None:
        """Why manual control was refused; None if it was granted."""


class LeaseRenewer:
    """
    Requests manual control again before it expires, if possible while the plan is at rest.

    A robot grants manual control for a limited time (a lease).  It processes a request between two
    velocities.  If the response takes longer than the robot's command timeout, the robot has
    stopped in the middle of the motion.

    :param request: sends a request, and does not wait for the response
    :param response_timeout: how long a response may take in a run [s]
    """

    def __init__(
            self, request: Callable[[], PendingResponse], response_timeout: float) -> None:
        self._request = request
        self._response_timeout = response_timeout
        self._requested = float('-inf')
        self._pending: PendingResponse | None = None

    def granted(self, requested: float) -> None:
        """
        Record that manual control was granted.

        :param requested: when it was requested [s]; the age of the lease counts from this time
        """
        self._requested = requested
        self._pending = None

    def is_stale(self, now: float) -> bool:
        """Return whether manual control must be renewed before a run, because of its age."""
        return now - self._requested >= LEASE_RENEW_AT_REST

    def on_sent(self, now: float, rest: float) -> None:
        """
        Request manual control again if it will expire soon; call this after each velocity.

        :param now: the time [s]
        :param rest: how long the plan stays at rest from now on [s]; 0 while moving
        """
        age = now - self._requested
        can_wait = rest >= self._response_timeout
        if age >= LEASE_RENEW_LATEST or (age >= LEASE_RENEW_AT_REST and can_wait):
            self._requested = now
            self._pending = self._request()

    def poll(self, now: float) -> None:
        """
        Check that the last request for manual control is answered in time and granted.

        :param now: the time [s]
        :raises RunFaultError: if the response took too long, or manual control was refused
        """
        if self._pending is None:
            return
        if not self._pending.done:
            if now - self._requested > self._response_timeout:
                raise RunFaultError(
                    'manual control was not renewed within '
                    f'{self._response_timeout * 1e3:.0f} ms; the robot may have stopped '
                    'meanwhile, so the motion was given up')
            return
        refusal, self._pending = self._pending.refusal, None
        if refusal is not None:
            raise RunFaultError(f'the robot took manual control away: {refusal}')


class RobotPort(Protocol):
    """Checks on the robot's endpoints in the ROS graph; each call may have to wait for DDS."""

    def check_subscribed(self) -> None:
        """
        Check that the robot still subscribes to the velocity topic.

        :raises RunFaultError: if it does not
        """

    def check_identity(self) -> None:
        """
        Check that the subscriber of the velocities is still the robot that this program claimed.

        :raises RunFaultError: if it is another robot, or the robot has left the ROS graph
        """

    def check_exclusive(self) -> None:
        """
        Check that only one robot receives the velocities.

        :raises RunFaultError: if there are several robots
        """

    def has_changed(self) -> bool:
        """Return whether the number of publishers or subscribers changed since the last call."""


class OtherPublishers(Protocol):
    """Detects velocities that other programs send to the robot."""

    def update(self) -> bool:
        """Find velocity publishers of other programs and subscribe; return whether any exist."""


class RunTimeouts(Protocol):
    """How long a run may be paused, and how long odometry may be silent during a run."""

    @property
    def odometry_timeout(self) -> float:
        """Return how long odometry may be silent [s]; 0 means no limit."""

    @property
    def pause_timeout(self) -> float:
        """Return how long a run may be paused [s]."""


class RunMonitor:
    """
    Checks for faults during a run, sends heartbeats and renews manual control.

    If a fault must end the run, the object raises an error.

    The thread that drives calls the methods after each message, and at least every CHECK_PERIOD.
    Each call is short.

    :param guardian: receives the heartbeats
    :param lease: renews manual control; None for a robot without manual control
    :param robot: checks the robot's endpoints in the ROS graph
    :param others: detects the velocities of other publishers
    :param odometry: detects from odometry whether the robot stands still
    :param timeouts: the timeouts for silent odometry and for a pause
    :param speed_factor: the speed relative to the plan
    """

    def __init__(
            self, guardian: Guardian | NullGuardian, lease: LeaseRenewer | None,
            robot: RobotPort, others: OtherPublishers, odometry: StandstillDetector,
            timeouts: RunTimeouts, speed_factor: SpeedFactor) -> None:
        self._guardian = guardian
        self._lease = lease
        self._robot = robot
        self._others = others
        self._odometry = odometry
        self._odometry_timeout = timeouts.odometry_timeout
        self._pause_timeout = timeouts.pause_timeout
        self._speed_factor = speed_factor
        #: the steady clock [s]
        self.clock: Callable[[], float] = lambda: time.monotonic()  # noqa: PLW0108
        self._feedback: PoseFeedback | None = None
        #: since when a speed factor of 0 has held the robot at rest [s]; None if it is not held
        self._held_since: float | None = None
        #: whether a held robot may move again: the factor was set, and the checks allowed it
        self._is_released = False
        #: called with the reason if the robot stays held although the speed factor was set again
        self.on_kept_hold: Callable[[str], object] = lambda _: None
        #: how far the robot was moved from outside while it was held
        self.pause_pose = PausePose()
        self._checked = float('-inf')
        self._subscriber_checked = self._graph_counted = self._graph_checked = float('-inf')

    @property
    def speed_factor(self) -> float:
        """Return the speed factor, 0 to 1; after a pause it is 0 until the checks allow motion."""
        if self._speed_factor.is_hold:
            self._is_released = False
            return 0.0
        is_held = self._held_since is not None and not self._is_released
        return 0.0 if is_held else self._speed_factor.value

    def correct(self, tick: Tick, now: float) -> Velocity:
        """
        Return the velocity to send for a tick; a closed loop corrects the planned velocity.

        :param tick: the tick
        :param now: when the velocity is sent [s on the steady clock]
        :raises RunFaultError: if the robot is too far from its planned pose
        """
        return tick.velocity if self._feedback is None else self._feedback.correct(tick, now)

    def on_sent(self, rest: float) -> None:
        """
        Record whether the robot is held at rest, and renew manual control if necessary.

        Call this after each velocity.

        :param rest: how long the robot stays at rest from now on [s]; 0 while moving, infinite
            while a speed factor of 0 holds the robot
        """
        is_held = rest == math.inf
        if not is_held:
            self._held_since, self._is_released = None, False
        elif self._held_since is None:
            self._held_since = self.clock()
        self.pause_pose.on_sent(is_held)
        if self._lease is not None:
            self._lease.on_sent(self.clock(), rest)

    def begin(self, feedback: PoseFeedback | None) -> None:
        """
        Reset the state for a new run.

        :param feedback: corrects the velocities of the new run; None to send them as planned
        """
        self._feedback = feedback
        self._checked = self.clock()
        self._held_since, self._is_released = None, False
        self._speed_factor.set(MOVED, 1.0)
        self.pause_pose.on_sent(is_paused=False)

    def check_resume(self) -> None:
        """
        Repeat the checks of a start before a run continues after the robot was held at rest.

        :raises RunFaultError: if the run must not continue
        """
        self._robot.check_subscribed()
        self._robot.check_identity()
        self._robot.check_exclusive()
        if self.has_lost_robot(self.clock()):
            raise RunFaultError('odometry is silent: the robot or the link to it is lost')

    def check(self) -> None:
        """
        Send a heartbeat, and check for faults.

        :raises RunFaultError: if the run must end
        """
        now = self.clock()
        self._guardian.heartbeat()
        held_up, self._checked = now - self._checked, now
        if self._lease is not None:
            self._lease.poll(now)
        if now - self._subscriber_checked >= SUBSCRIBER_CHECK_PERIOD:
            self._subscriber_checked = now
            self._robot.check_subscribed()
        if self.has_lost_robot(now):
            age = self._odometry.age(now) or 0.0
            if held_up > HEARTBEAT_TIMEOUT and age - held_up <= self._odometry_timeout:
                # Odometry arrived until this program could no longer receive it.
                raise RunFaultError(
                    f'odometry has been silent for {age:.1f} s: the program was held up, '
                    f'{HELD_UP_ADVICE}')
            raise RunFaultError(
                f'odometry has been silent for {age:.1f} s: the robot or the link to it is lost')
        if self._feedback is not None:
            age = self._feedback.age(now)
            # Messages may still arrive, but with old time stamps.
            if age > (self._odometry_timeout or FEEDBACK_TIMEOUT):
                raise RunFaultError(
                    f'odometry has had nothing new for {age:.1f} s: a closed loop needs it')
        if self._held_since is not None and now - self._held_since > self._pause_timeout:
            raise PauseTimeoutError(
                f'paused for {self._pause_timeout:g} s (parameter pause_timeout): the motion was '
                'given up, and the robot released')
        if now - self._graph_counted >= GRAPH_COUNT_PERIOD:
            self._graph_counted = now
            self._check_graph(now)
        if self._held_since is not None and not (
                self._is_released or self._speed_factor.is_hold):
            self._release()

    def _release(self) -> None:
        """
        Continue the run after the robot was held at rest, unless it was moved in this time.

        The thread that drives calls this, and no lock is held.  So the thread that sets the speed
        factor does not wait for the checks.

        :raises RunFaultError: if the run must not continue
        """
        self.check_resume()
        try:
            self.pause_pose.require_not_moved()
        except RobotMovedError as error:
            self._speed_factor.set(MOVED, 0.0)
            self.on_kept_hold(f'{error}. Resume to go on all the same')
        else:
            self._is_released = True

    def has_lost_robot(self, now: float) -> bool:
        """Return whether odometry arrived before, and is now silent for too long."""
        age = self._odometry.age(now)
        return age is not None and 0.0 < self._odometry_timeout < age

    def _check_graph(self, now: float) -> None:
        if self._robot.has_changed() or now - self._graph_checked >= GRAPH_CHECK_PERIOD:
            self._graph_checked = now
            self._robot.check_identity()
            self._robot.check_exclusive()
            self._others.update()
