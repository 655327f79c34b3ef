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
Check for faults while the robot is driven, and renew manual control in time.

Manual control is the mode in which a robot such as a Kachaka accepts velocities.
"""

from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import Protocol

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.speed_factor import MOVED, OVERRIDE, SpeedFactor
from kachaka_simple_control.control.standstill import PausePose, StandstillDetector
from kachaka_simple_control.control.tick_scheduler import Tick
from kachaka_simple_control.control.timing import (
    FEEDBACK_TIMEOUT,
    GRAPH_CHECK_PERIOD,
    GRAPH_COUNT_PERIOD,
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
    """
    The robot's response to a request for manual control; it may not have arrived yet.

    Manual control is the mode in which the robot accepts velocities.
    """

    @property
    def done(self) -> bool:
        """Whether the robot has responded to the request for manual control."""

    @property
    def refusal(self) -> str | None:
        """
        Why the robot refused manual control; None if it granted manual control.

        Manual control is the mode in which the robot accepts velocities.  The value is valid only
        after the response has arrived.
        """


class LeaseRenewer:
    """
    Requests manual control again before it expires.

    Manual control is the mode in which a robot accepts velocities.  The robot grants it for a
    limited time (a lease).  While the robot processes a request for manual control, it processes
    no velocity.  If this takes longer than the robot's command timeout, the robot stops.  So if
    the plan contains a long enough rest before manual control expires, the request is sent during
    this rest.

    :param request: a function that sends a request, and does not wait for the response
    :param command_timeout: how long the robot keeps a velocity without a new one [s]
    """

    def __init__(
            self, request: Callable[[], PendingResponse], command_timeout: float) -> None:
        self._request = request
        self._command_timeout = self._response_timeout = command_timeout
        self._requested = float('-inf')
        self._pending: PendingResponse | None = None

    def begin(self, period: float) -> None:
        """
        Prepare for a drive: a response and a period together must not exceed the command timeout.

        :param period: the time between two velocities of this drive [s]
        """
        self._response_timeout = self._command_timeout - period

    def granted(self, requested: float) -> None:
        """
        Record that the robot has granted manual control, the mode in which it accepts velocities.

        :param requested: when manual control was requested [s]; manual control expires some time
            after this request
        """
        self._requested = requested
        self._pending = None

    def is_stale(self, now: float) -> bool:
        """
        Return whether manual control must be requested again before a drive.

        Manual control, the mode in which the robot accepts velocities, expires some time after it
        was requested.  The value is True from LEASE_RENEW_AT_REST after the last request on.

        :param now: the time [s]
        """
        return now - self._requested >= LEASE_RENEW_AT_REST

    def renew_if_due(self, now: float, rest: float) -> None:
        """
        Request manual control again if it will expire soon.

        Manual control is the mode in which the robot accepts velocities.  If possible, the new
        request is sent at rest: when the planned velocity will be zero until the response arrives.
        If the last request is older than LEASE_RENEW_LATEST, the new request is sent even in
        motion.

        :param now: the time [s]
        :param rest: how long the robot stays at rest from now on [s]; 0 if it moves
        """
        age = now - self._requested
        can_wait = rest >= self._response_timeout
        if age >= LEASE_RENEW_LATEST or (age >= LEASE_RENEW_AT_REST and can_wait):
            self._requested = now
            self._pending = self._request()

    def poll(self, now: float) -> None:
        """
        Check that the robot answers the last request for manual control in time, and grants it.

        Manual control is the mode in which the robot accepts velocities.  Do nothing if no request
        is waiting for an answer.

        :param now: the time [s]
        :raises RunFaultError: if the answer takes too long, or if the robot refuses manual control
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
    """
    An interface to check the robot in the ROS graph, for example whether it still subscribes.

    Each call may have to wait for DDS.
    """

    def check_subscribed(self) -> None:
        """
        Check that the robot still subscribes to the velocity topic.

        :raises RunFaultError: if no robot subscribes
        """

    def check_identity(self) -> None:
        """
        Check that the robot which this program drives still subscribes to the velocity topic.

        :raises RunFaultError: if only another robot subscribes, or if the robot has left the ROS
            graph
        """

    def check_exclusive(self) -> None:
        """
        Check that only one robot receives the velocities.

        :raises RunFaultError: if there are several robots
        """

    def has_changed(self) -> bool:
        """
        Return whether the number of publishers or subscribers has changed since the last call.

        Only the topics of the robot are counted: velocities and odometry.
        """


class OtherPublishers(Protocol):
    """An interface to detect velocities that other programs send to the robot."""

    def update(self) -> bool:
        """
        Search the ROS graph for other programs that publish velocities on the topic of this robot.

        If there are any, subscribe to the topic, to detect whether these programs really send.

        :returns: whether there are any such programs
        """


class RunTimeouts(Protocol):
    """Two time limits: how long a drive may be paused, and how long odometry may be silent."""

    @property
    def odometry_timeout(self) -> float:
        """Return how long odometry may be silent during a drive [s]; 0 means without limit."""

    @property
    def pause_timeout(self) -> float:
        """Return how long a drive may be paused before it is given up [s]."""


class RunMonitor:
    """
    Checks for faults during a run, sends heartbeats and renews manual control.

    A run is one drive of the robot.  If a fault must end the run, a method of this class raises an
    error.  The thread that drives the robot calls the methods after each message, and at least
    every CHECK_PERIOD.  Each call is short.

    :param guardian: the object that receives the heartbeats; it stops the robot if they do not
        come
    :param lease: the object that renews manual control, the mode in which the robot accepts
        velocities; None for a robot without this mode
    :param robot: the object that checks the robot in the ROS graph
    :param others: the object that detects velocities that other programs send to the robot
    :param odometry: the object that detects from odometry whether the robot stands still
    :param timeouts: how long odometry may be silent, and how long a run may be paused
    :param speed_factor: the speed of the robot relative to its plan, from 0 to 1
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
        self._has_plan = True
        #: since when a speed factor of 0 has held the robot at rest [s]; None if it is not held
        self._held_since: float | None = None
        #: until when the robot stays at rest, according to the newest velocity [s]
        self._rest_end = float('-inf')
        #: whether a held robot may move again: the factor was set, and the checks allowed it
        self._is_released = False
        #: called with the reason if the robot stays held although the speed factor was set again
        self.on_kept_hold: Callable[[str], object] = lambda _: None
        #: how far the robot was moved from outside while it was held
        self.pause_pose = PausePose()
        self._checked = float('-inf')
        self._graph_counted = self._graph_checked = float('-inf')

    @property
    def speed_factor(self) -> float:
        """
        Return the speed of the robot relative to its plan, from 0 to 1.

        The value is 0 during a pause, so that the robot stays at rest.  After the end of the
        pause, the value stays 0 until ``check`` has found that the robot may move again.  All this
        is also true for any other source of slower speed that sets its factor to 0.
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

        :param tick: the planned velocity, with the time when it is due
        :param now: when the velocity is sent [s on the steady clock]
        :raises RunFaultError: if the robot is too far from its planned pose
        """
        return tick.velocity if self._feedback is None else self._feedback.correct(tick, now)

    def on_sent(self, rest: float) -> None:
        """
        Record whether the robot is held at rest, and how long it stays at rest.

        Call this after each velocity.

        :param rest: how long the robot stays at rest from now on [s]; 0 while it moves, infinite
            while a speed factor of 0 holds it at rest
        """
        is_held = rest == math.inf
        if not is_held:
            self._held_since, self._is_released = None, False
        elif self._held_since is None:
            self._held_since = self.clock()
        self.pause_pose.on_sent(is_held)
        self._rest_end = self.clock() + rest if rest else float('-inf')

    def begin(
            self, feedback: PoseFeedback | None, period: float, has_plan: bool = True) -> None:
        """
        Prepare the monitor for a new run, which is one drive of the robot.

        All that was recorded about a pause in the previous run is forgotten.

        :param feedback: the closed loop, which corrects the velocities of the new run with
            odometry; None to send the velocities as planned
        :param period: the time between two velocities of the run [s]
        :param has_plan: whether a plan is driven, to which the speed of a person is relative; the
            hand chooses its own speed
        """
        self._feedback, self._has_plan = feedback, has_plan
        if self._lease is not None:
            self._lease.begin(period)
        self._checked = self.clock()
        self._held_since, self._is_released = None, False
        self._rest_end = float('-inf')
        self._speed_factor.set(MOVED, 1.0)
        self.pause_pose.on_sent(is_paused=False)

    def check_resume(self) -> None:
        """
        Check that a paused drive may continue.

        The robot must still subscribe, and must be the same robot as before.  It must be the only
        robot that receives the velocities.  Odometry must not be silent.  All this is also checked
        before a drive.

        :raises RunFaultError: if the drive must not continue
        """
        self._robot.check_subscribed()
        self._robot.check_identity()
        self._robot.check_exclusive()
        if self.has_lost_robot(self.clock()):
            raise RunFaultError('odometry is silent: the robot or the link to it is lost')

    def check(self) -> None:
        """
        Send a heartbeat to the guardian, and check for all faults that must end the drive.

        The guardian is a separate process that stops the robot if this program cannot.  If manual
        control, the mode in which the robot accepts velocities, expires soon, this method renews
        it.  If a pause is over, it also allows the robot to move again.

        :raises RunFaultError: if the drive must end
        """
        now = self.clock()
        self._guardian.heartbeat()
        held_up, self._checked = now - self._checked, now
        if self._lease is not None:
            self._lease.poll(now)
            self._lease.renew_if_due(now, max(0.0, self._rest_end - now))
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
            self._robot.check_subscribed()
            self._check_graph(now)
        if self._held_since is not None and not (
                self._is_released or self._speed_factor.is_hold):
            self._release()

    def _release(self) -> None:
        """
        Allow the robot to move again after a pause, unless somebody moved it during the pause.

        If the robot was moved, it stays at rest until somebody resumes the motion again.

        :raises RunFaultError: if the drive must not continue
        """
        # This takes time.  So the thread that drives the robot calls it, without a lock, and the
        # thread that ends the pause does not wait.
        self.check_resume()
        try:
            self.pause_pose.require_not_moved()
        except RobotMovedError as error:
            self._speed_factor.set(MOVED, 0.0)
            self.on_kept_hold(f'{error}. Resume to go on all the same')
        else:
            self._is_released = True

    def has_lost_robot(self, now: float) -> bool:
        """
        Return whether odometry has been silent for longer than the parameter ``odometry_timeout``.

        The value is False if odometry has never arrived, or if the parameter is 0.

        :param now: the time [s on the steady clock]
        """
        age = self._odometry.age(now)
        return age is not None and 0.0 < self._odometry_timeout < age

    def _check_graph(self, now: float) -> None:
        if self._robot.has_changed() or now - self._graph_checked >= GRAPH_CHECK_PERIOD:
            self._graph_checked = now
            self._robot.check_identity()
            self._robot.check_exclusive()
            self._others.update()
