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
How the stop of a robot is judged by its odometry, and what the user is told of it.

Tested by test/ros/test_robot.py.
"""

from __future__ import annotations

import threading
import time

from kachaka_simple_control import errors
from kachaka_simple_control.control.drive_monitor import DriveMonitor
from kachaka_simple_control.control.end_check import EndCheck, EndJudge, UNSEEN
from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.preparation import Moment, Steps
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.stop import StopController
from kachaka_simple_control.control.timing import STOP_CONFIRM_TIMEOUT, STOP_LOST_LINK_TIME
from kachaka_simple_control.control.velocity_gate import GateState, Permit, VelocityGate
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.hub import Hub
from kachaka_simple_control.ros.parameters import RobotSettings


class RobotStop(StopController):
    """Stops one robot; goes on while odometry shows motion, unless another program drives."""

    def __init__(
            self, hub: Hub, gate: VelocityGate, settings: RobotSettings,
            guardian: Guardian | NullGuardian, odometry: StandstillDetector,
            foreign: ForeignMessages, monitor: DriveMonitor) -> None:
        profile = settings.profile
        super().__init__(
            gate, profile.command_timeout, guardian, self._more_zeros_time, publish=gate.publish)
        self._hub, self._odometry, self._foreign, self._monitor = hub, odometry, foreign, monitor
        self._logger, self._name = hub.logger(settings.name), settings.name
        #: how far from the plan the robot comes to rest
        self.end = EndCheck(profile.odometry_calibration)
        self._judge = EndJudge(
            self.end, settings.parameters.within,
            lambda: bool(odometry.is_still(time.monotonic())),
            self._logger.warning)
        self.on_stopped, self.on_failure = self._judge.on_stopped, self.log_once
        #: the drive whose stop was logged last; this object before the first stop
        self._logged_stop_of: object = self
        #: the newest drive that was driven to the end of its plan
        self._ended: Permit | None = None
        self._logging = threading.Lock()
        self._has_reported = False

    def begin(self) -> None:
        """Prepare for a drive: a stop that fails is reported again."""
        self._has_reported = False

    def complete(
            self, moment: Moment, permit: Permit, plan: Plan | None, within: float) -> Steps[None]:
        """
        Stop the robot after a drive that has come to its end, unless another follows.

        :param plan: which was driven; None without one
        :param within: how long to wait for another drive [s]; 0 if an end off the plan is a fault
        :raises RunFaultError: if the robot does not rest where it should, and that is a fault
        """
        self._on_end(permit, plan)
        if plan is None or not self._judge.is_strict:
            self._hub.late_stops.schedule(self, permit, within)
            return
        failure = yield from self.steps(moment, None, only=permit)
        if failure := failure or self._judge.problem:
            raise errors.RunFaultError(failure)

    def begin_elsewhere(self, permit: Permit, plan: Plan | None) -> None:
        """Stop the robot in another thread, at the end of its plan; ``complete`` follows later."""
        self._on_end(permit, plan)
        self._hub.late_stops.schedule(self, permit, within=0.0)

    def _on_end(self, permit: Permit, plan: Plan | None) -> None:
        if plan is not None and self._ended is not permit:
            self._ended = permit
            self._judge.problem = UNSEEN
            self.end.on_complete(plan.pose)

    def report(self, failure: str | None, was_stopped: bool) -> str:
        """
        Return what the user is told of a stop.

        :param failure: why it could not be sent; None if it was sent
        :param was_stopped: whether the robot had been stopped before
        :raises RunFaultError: if the stop could not be sent, or the robot still moves by odometry
        """
        if failure := failure or self.unconfirmed():
            # After a signal, the program ends, and nobody prints the error: log it here.
            if self._hub.stopped_by is None:
                self._has_reported = True
            else:
                self.log_once(failure)
            raise errors.RunFaultError(failure)
        if self._gate.state is GateState.NOT_OPENED:
            return 'nothing was sent: this node has not taken a robot'
        permit = self._gate.permit
        if self._logged_stop_of is not permit:
            self._logged_stop_of = permit
            # Of a fleet's robots the program says it once.
            if not self._name:
                self._logger.info('Robot has stopped')
        return ('nothing was sent: the robot had been stopped before' if was_stopped
                else 'the robot was stopped')

    def log_once(self, failure: str) -> None:
        """Log that a stop has failed, unless this was reported before; for any thread."""
        with self._logging:
            has_reported, self._has_reported = self._has_reported, True
        if not has_reported:
            self._logger.error(failure)

    def unconfirmed(self) -> str | None:
        """Return an error text if odometry still shows motion after a stop of ours, else None."""
        now = time.monotonic()
        # Before the gate is open, or while another program drives, motion is not our failure.
        is_ours = self._gate.state is GateState.OPEN and not self._foreign.has_recent(now)
        if is_ours and self._odometry.is_moving(now):
            return ('the stop is unconfirmed: zeros were sent, and odometry still sees the robot '
                    'move')
        return None

    @property
    def confirmed_after(self) -> float | None:
        """Return the time from the start of the last stop to rest by odometry [s], or None."""
        started, still = self.stop_started, self._odometry.still_since(time.monotonic())
        return None if started is None or still is None else max(0.0, still - started)

    def _more_zeros_time(self) -> float:
        """Return how much longer a stop must go on [s]; 0 at rest, or if somebody else drives."""
        now = time.monotonic()
        if self._foreign.has_recent(now):
            return 0.0
        # A reader drops the zeros of a publisher that was destroyed.  So the kernel must drop our
        # velocities before that.
        if self._monitor.has_lost_robot(now):
            return STOP_LOST_LINK_TIME
        return STOP_CONFIRM_TIMEOUT if self._odometry.is_moving(now) else 0.0
