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
"""Check for faults while the robot is driven, and renew manual control in time."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import math
from typing import Protocol

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.scan_watch import ScanWatch
from kachaka_simple_control.control.speed_factor import MOVED, OVERRIDE, PAUSE, SpeedFactor
from kachaka_simple_control.control.standstill import PausePose, StandstillDetector
from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.control.timing import (
    FEEDBACK_TIMEOUT,
    GRAPH_CHECK_PERIOD,
    GRAPH_COUNT_PERIOD,
    GRAPH_COUNT_SHARE,
    HEARTBEAT_TIMEOUT,
    LEASE_RENEW_AT_REST,
    LEASE_RENEW_LATEST,
)
from kachaka_simple_control.errors import (
    HELD_UP_ADVICE,
    PauseTimeoutError,
    RobotMovedError,
    RunFaultError,
)
from kachaka_simple_control.motion.geometry import Velocity


class PendingResponse(Protocol):
    """The robot's response to a request for manual control; it may not have arrived yet."""

    @property
    def done(self) -> bool:
        """Whether the robot has responded to the request for manual control."""

    @property
    def refusal(self) -> str | None:
        """Why the robot refused manual control, once it has answered; None if it did not."""


class LeaseRenewer:
    """
    Requests manual control again before it expires.

    The robot processes no velocity while it processes a request: longer than the command timeout,
    and it stops.  So the request is sent in a rest of the plan, if there is one in time.

    :param request: sends a request, and does not wait for the response
    """

    def __init__(
            self, request: Callable[[], PendingResponse], command_timeout: float) -> None:
        self._request = request
        self._command_timeout = self._response_timeout = command_timeout
        self._requested = float('-inf')
        self._pending: PendingResponse | None = None

    def begin(self, period: float) -> None:
        """
        Prepare for a drive with a period [s].

        A response and a period together must not exceed the command timeout.
        """
        self._response_timeout = self._command_timeout - period

    def granted(self, requested: float) -> None:
        """Record that the robot has granted manual control, for some time from the request on."""
        self._requested = requested
        self._pending = None

    def is_stale(self, now: float) -> bool:
        """Return whether manual control must be requested again before a drive."""
        return now - self._requested >= LEASE_RENEW_AT_REST

    def is_due(self, now: float, rest: float) -> bool:
        """
        Return whether to request manual control again: at rest if possible, else in motion.

        :param rest: how long the robot stays at rest from now on [s]; 0 if it moves
        """
        age = now - self._requested
        can_wait = rest >= self._response_timeout
        return age >= LEASE_RENEW_LATEST or (age >= LEASE_RENEW_AT_REST and can_wait)

    def renew(self, now: float) -> None:
        """Request manual control again; this may have to wait for DDS."""
        self._requested = now
        self._pending = self._request()

    def poll(self, now: float) -> None:
        """
        Check that the robot grants the last request in time, if it has not answered yet.

        :raises RunFaultError: if the answer takes too long, or if the robot refuses
        """
        if self._pending is None:
            return
        if not self._pending.done:
            if now - self._requested > self._response_timeout:
                raise RunFaultError(
                    'manual control was not renewed within '
                    f'{self._response_timeout * 1e3:.0f} ms: the robot may have stopped, so '
                    'the motion was ended')
            return
        refusal, self._pending = self._pending.refusal, None
        if refusal is not None:
            raise RunFaultError(f'the robot took manual control away: {refusal}')


class RobotPort(Protocol):
    """The robot in the ROS graph; each call may have to wait for DDS."""

    def check_identity(self) -> None:
        """
        Check that the same robot still subscribes to the velocity topic.

        :raises RunFaultError: if only another one does, or none
        """

    def check_exclusive(self) -> None:
        """
        Check that only one robot receives the velocities.

        :raises RunFaultError: if there are several robots
        """

    def has_changed(self) -> bool:
        """
        Return whether a number of publishers or subscribers has changed since the last call.

        It is quick: the other questions take as long as ten of these.
        """


class OtherPublishers(Protocol):
    """An interface to detect velocities that other programs send to the robot."""

    def update(self) -> bool:
        """
        Search for other publishers of velocities; subscribe if there are any, to see if they send.

        :returns: whether there are any
        """


class DriveTimeouts(Protocol):
    """Two time limits: how long a drive may be paused, and how long odometry may be silent."""

    @property
    def odometry_timeout(self) -> float:
        """Return how long odometry may be silent during a drive [s]; 0 means without limit."""

    @property
    def pause_timeout(self) -> float:
        """Return how long a drive may be paused before it ends [s]."""


class DriveMonitor:
    """
    Checks for faults during a drive, and renews manual control.

    The thread that drives calls it after each message, and at least every CHECK_PERIOD.  Each call
    is short, and raises an error if a fault must end the drive.

    :param lease: None for a robot without manual control
    """

    def __init__(
            self, guardian: Guardian | NullGuardian, lease: LeaseRenewer | None,
            robot: RobotPort, others: OtherPublishers, odometry: StandstillDetector,
            timeouts: DriveTimeouts, speed_factor: SpeedFactor) -> None:
        self._guardian = guardian
        self._lease = lease
        self._robot = robot
        self._others = others
        self._odometry = odometry
        self._odometry_timeout = timeouts.odometry_timeout
        self._pause_timeout = timeouts.pause_timeout
        self._speed_factor = speed_factor
        self._feedback: PoseFeedback | None = None
        self._has_plan = True
        #: since when a speed factor of 0 has held the robot at rest [s]; None if it is not held
        self._held_since: float | None = None
        #: until when the robot stays at rest, according to the newest velocity [s]
        self._rest_end = float('-inf')
        #: whether a held robot may move again: the factor was set, and the checks allowed it
        self._is_released = False
        #: called with the reason if the robot stays held although the speed factor was set again
        self.on_kept_hold: Callable[[str], object] = lambda _: None
        #: calls a function that may wait for DDS; a ``RobotDrive`` sets its velocity gate's
        self.wait_for_dds: Callable[[Callable[[], None]], None] = lambda ask: ask()
        #: holds the robot before obstacles; None without
        self.watch: ScanWatch | None = None
        #: how far the robot was moved from outside while it was held
        self.pause_pose = PausePose()
        self._checked = float('-inf')
        self._graph_counted = self._graph_checked = float('-inf')
        self._count_period, self._check_period = GRAPH_COUNT_PERIOD, GRAPH_CHECK_PERIOD
        #: whether other programs have publishers of velocities
        self._has_others = False

    @property
    def speed_factor(self) -> float:
        """
        Return the speed factor.

        After a hold, by a pause or another source, it stays 0 until ``check`` has found that the
        robot may move again.
        """
        if self._speed_factor.is_hold:
            self._is_released = False
            return 0.0
        is_held = self._held_since is not None and not self._is_released
        if is_held:
            return 0.0
        return self._speed_factor.value if self._has_plan else self._speed_factor.without(OVERRIDE)

    def correct(self, tick: Tick, now: float) -> Velocity:
        """
        Return the velocity to send: the planned velocity, corrected if there is a closed loop.

        :raises RunFaultError: if the robot is too far from its planned pose
        """
        return tick.velocity if self._feedback is None else self._feedback.correct(tick, now)

    def on_sent(self, now: float, rest: float, plan_time: float | None = None) -> None:
        """
        Record how long the robot stays at rest; call this after each velocity.

        :param rest: 0 while it moves, infinite while a speed factor of 0 holds it [s]
        :param plan_time: the point in the plan [s]; None without a plan
        """
        if self.watch is not None:
            self.watch.on_sent(now, plan_time)
        is_held = rest == math.inf
        if not is_held:
            self._held_since, self._is_released = None, False
        elif self._held_since is None:
            self._held_since = now
        self.pause_pose.on_sent(is_held)
        self._rest_end = now + rest if rest else float('-inf')

    def begin(
            self, now: float, feedback: PoseFeedback | None, period: float,
            has_plan: bool = True) -> None:
        """
        Prepare the monitor for a new drive.

        :param feedback: the closed loop; None to send the velocities as planned
        :param period: the time between two velocities of the drive [s]
        :param has_plan: whether a plan is driven, to which the speed of a person is relative; the
            hand chooses its own speed
        """
        self._feedback, self._has_plan = feedback, has_plan
        if self._lease is not None:
            self._lease.begin(period)
        self._checked = now
        self._held_since, self._is_released = None, False
        self._rest_end = float('-inf')
        self._speed_factor.set(MOVED, 1.0)
        self.pause_pose.on_sent(is_paused=False)

    def check_resume(self, now: float) -> None:
        """
        Check, as before a drive, that a paused drive may continue.

        The same robot must subscribe, alone, and odometry must not be silent.

        :raises RunFaultError: if the drive must not continue
        """
        self._robot.check_identity()
        self._robot.check_exclusive()
        if self.has_lost_robot(now):
            raise RunFaultError('odometry is silent: the robot or the link to it is lost')

    def check(self, now: float) -> None:
        """
        Check for faults, renew manual control, and end a hold that is over.

        The first check of a drive makes the guardian watch the robot.

        :raises RunFaultError: if the drive must end
        """
        self._guardian.check()
        held_up, self._checked = now - self._checked, now
        if self._lease is not None:
            self._lease.poll(now)
            if self._lease.is_due(now, max(0.0, self._rest_end - now)):
                self.wait_for_dds(partial(self._lease.renew, now))
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
        if now - self._graph_counted >= self._count_period:
            self.wait_for_dds(partial(self.check_graph, now))
        if self.watch is not None:
            self.watch.poll(now, is_at_rest=(
                now < self._rest_end and PAUSE not in self._speed_factor.factors))
        self._check_hold(now)

    def _check_hold(self, now: float) -> None:
        if self._held_since is None:
            return
        if now - self._held_since > self._pause_timeout:
            raise PauseTimeoutError(
                f'paused for {self._pause_timeout:g} s (parameter pause_timeout): the motion was '
                'ended, and the robot released')
        if not (self._is_released or self._speed_factor.is_hold):
            self.wait_for_dds(partial(self._release, now))

    def _release(self, now: float) -> None:
        """
        Allow the robot to move again after a hold, unless somebody has moved it meanwhile.

        Then it takes another resume.

        :raises RunFaultError: if the drive must not continue
        """
        # This takes time.  So the thread that drives the robot calls it, without a lock, and the
        # thread that ends the pause does not wait.
        self.check_resume(now)
        try:
            self.pause_pose.require_not_moved()
        except RobotMovedError as error:
            self._speed_factor.set(MOVED, 0.0)
            self.on_kept_hold(f'{error}. Resume to go on all the same')
        else:
            self._is_released = True

    def has_lost_robot(self, now: float) -> bool:
        """
        Return whether odometry has been silent for longer than ``odometry_timeout``.

        False if it has never arrived, or if the parameter is 0.
        """
        age = self._odometry.age(now)
        return age is not None and 0.0 < self._odometry_timeout < age

    def share_graph(self, number: int, count: int) -> None:
        """
        Ask the graph as one of many robots, which do so one after the other.

        :param number: of this robot, from 0
        """
        self._count_period = max(GRAPH_COUNT_PERIOD, count * GRAPH_COUNT_SHARE)
        self._check_period = GRAPH_CHECK_PERIOD / GRAPH_COUNT_PERIOD * self._count_period
        self._graph_counted -= number / count * self._count_period
        self._graph_checked -= number / count * self._check_period

    def check_graph(self, now: float) -> None:
        """
        Check by the ROS graph that the same robot subscribes, alone; ``check`` does so as well.

        :raises RunFaultError: if the drive must not begin, or must end
        """
        self._graph_counted = now
        # While there are others, this node subscribes as well: if that began when the robot left,
        # no number has changed.
        if (self._robot.has_changed() or self._has_others
                or now - self._graph_checked >= self._check_period):
            self._graph_checked = now
            self._robot.check_identity()
            self._robot.check_exclusive()
            self._has_others = self._others.update()
