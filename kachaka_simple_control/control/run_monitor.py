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
"""The fault checks during a run."""

from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import Protocol

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.manual_control_lease import LeaseRenewer
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.speed_factor import MOVED, SpeedFactor
from kachaka_simple_control.control.standstill import PausePose, StandstillDetector
from kachaka_simple_control.control.tick_scheduler import Tick
from kachaka_simple_control.control.timing import (
    FEEDBACK_TIMEOUT,
    GRAPH_CHECK_PERIOD,
    GRAPH_COUNT_PERIOD,
    HEARTBEAT_TIMEOUT,
    SUBSCRIBER_CHECK_PERIOD,
)
from kachaka_simple_control.errors import (
    HELD_UP_ADVICE,
    PauseTimeoutError,
    RobotMovedError,
    RunFaultError,
)
from kachaka_simple_control.motion.geometry import Velocity


class RobotPort(Protocol):
    """What the network shows of the robot; each call may have to wait for DDS."""

    def check_subscribed(self) -> None:
        """
        Check that the robot still subscribes.

        :raises RunFaultError: if it does not
        """

    def check_identity(self) -> None:
        """
        Check that the robot is the one that was taken.

        :raises RunFaultError: if it is another, or has left
        """

    def check_exclusive(self) -> None:
        """
        Check that there is one robot.

        :raises RunFaultError: if there are more
        """

    def has_changed(self) -> bool:
        """Return whether a number of endpoints has changed since the last call."""


class OtherPublishers(Protocol):
    """Watches for velocities of other programs."""

    def update(self) -> bool:
        """Find other publishers, and listen to them; return whether there are any."""


class RunTimeouts(Protocol):
    """How long a run waits."""

    @property
    def odometry_timeout(self) -> float:
        """Return how long odometry may be silent [s]; 0: for ever."""

    @property
    def pause_timeout(self) -> float:
        """Return how long a run may be paused [s]."""


class RunMonitor:
    """
    Sends heartbeats, renews manual control and raises the faults that end a run.

    Called after each message and at least every CHECK_PERIOD; each call is short.

    :param guardian: gets the heartbeats
    :param lease: renews manual control; None for a robot that needs none
    :param robot: what the network shows of the robot
    :param others: detects the velocities of other publishers
    :param odometry: what odometry shows of the robot
    :param timeouts: how long odometry may be silent, and a run paused
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
        #: since when the robot stands, held by a speed factor of 0 [s]; None if it is not held
        self._held_since: float | None = None
        #: whether the hold was released, and may be
        self._is_released = False
        #: called with why a hold that was released goes on, if it does
        self.on_kept_hold: Callable[[str], object] = lambda _: None
        #: how far the robot was moved from outside while it was held
        self.pause_pose = PausePose()
        self._checked = float('-inf')
        self._subscriber_checked = self._graph_counted = self._graph_checked = float('-inf')

    @property
    def speed_factor(self) -> float:
        """Return the speed factor, from 0 to 1; 1: as planned; 0 until a release is checked."""
        if self._speed_factor.is_hold:
            self._is_released = False
            return 0.0
        is_held = self._held_since is not None and not self._is_released
        return 0.0 if is_held else self._speed_factor.value

    def correct(self, tick: Tick, now: float) -> Velocity:
        """
        Return the velocity to send for a tick: its own, or in a closed loop the corrected one.

        :param now: when it is sent [s on the steady clock]
        :raises RunFaultError: if the robot is too far from where it should be
        """
        return tick.velocity if self._feedback is None else self._feedback.correct(tick, now)

    def on_sent(self, rest: float) -> None:
        """
        Renew manual control when it is time to.

        :param rest: how long the robot stays at rest from here [s]; 0 while moving, infinite
            while it is held by a speed factor of 0
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
        Forget the run before.

        :param feedback: corrects the velocities of the run that begins; None: sent as planned
        """
        self._feedback = feedback
        self._checked = self.clock()
        self._held_since, self._is_released = None, False
        self._speed_factor.set(MOVED, 1.0)
        self.pause_pose.on_sent(is_paused=False)

    def check_resume(self) -> None:
        """
        Check what a start would check, before a run that is held goes on.

        :raises RunFaultError: if there is a reason not to go on
        """
        self._robot.check_subscribed()
        self._robot.check_identity()
        self._robot.check_exclusive()
        if self.has_lost_robot(self.clock()):
            raise RunFaultError('odometry is silent: the robot or the link to it is lost')

    def check(self) -> None:
        """
        Send a heartbeat, and look for faults.

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
                # Odometry came as long as this program could receive it.
                raise RunFaultError(
                    f'odometry has been silent for {age:.1f} s: the program was held up, '
                    f'{HELD_UP_ADVICE}')
            raise RunFaultError(
                f'odometry has been silent for {age:.1f} s: the robot or the link to it is lost')
        if self._feedback is not None:
            age = self._feedback.age(now)
            # Messages may still arrive, with an old stamp.
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
        Go on after a hold, whoever held the robot, unless it was moved meanwhile.

        Called in the thread that drives, while no lock is held: who releases a hold waits for
        nothing.

        :raises RunFaultError: if there is a reason not to go on
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
        """Return whether odometry, received before, has been silent for too long."""
        age = self._odometry.age(now)
        return age is not None and 0.0 < self._odometry_timeout < age

    def _check_graph(self, now: float) -> None:
        if self._robot.has_changed() or now - self._graph_checked >= GRAPH_CHECK_PERIOD:
            self._graph_checked = now
            self._robot.check_identity()
            self._robot.check_exclusive()
            self._others.update()
