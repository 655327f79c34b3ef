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
One robot of a node: how it is made ready, watched, driven and stopped.

Tested by test/ros/test_robot.py.
"""

from __future__ import annotations

import signal
import threading
import time

from kachaka_simple_control import errors
from kachaka_simple_control.control.drive_requests import DriveRequest
from kachaka_simple_control.control.end_check import EndCheck, EndJudge, UNSEEN
from kachaka_simple_control.control.events import MotionEnded, OdometryReceived
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.preparation import Moment, Steps
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.run_monitor import LeaseRenewer, RunMonitor
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.stop import StopController
from kachaka_simple_control.control.tick_scheduler import VelocitySource
from kachaka_simple_control.control.timing import STOP_CONFIRM_TIMEOUT, STOP_LOST_LINK_TIME
from kachaka_simple_control.control.velocity_gate import GateState, VelocityGate
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.hub import Hub
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.ros.node_parameters import NodeParameters
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.robot_connection import (
    RobotConnection,
    start_guardian,
    wait_for_rest,
)
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery
from kachaka_simple_control.ros.robot_status import StatusReader
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher


class Robot:
    """
    What a node has for each robot.  It has no thread, and computes no plan.

    A ``Drive`` calls ``prepare`` and ``begin``, lets a loop call ``drive``, and then calls
    ``complete`` and ``finish``, or ``end_early``.  Any thread may call the others.

    :param publisher: only the velocity gate sends with it
    """

    def __init__(
            self, hub: Hub, publisher: VelocityPublisher, profile: RobotProfile,
            names: RobotNames, parameters: NodeParameters) -> None:
        self._hub, self._node, self._publisher = hub, hub.node, publisher
        node = hub.node
        self.profile = profile
        #: corrects velocities with odometry; None without the parameter ``closed_loop``
        self._feedback = PoseFeedback(
            profile.feedback_delay(), profile.odometry_calibration) if (
                parameters.closed_loop) else None
        self._odometry_topic = names.odometry
        #: detects from odometry whether the robot moves
        self.odometry = StandstillDetector()
        claim = RobotClaim(node, publisher.topic_name, 'driver', self._on_conflict)
        self.guardian = start_guardian(node, publisher, profile, parameters, claim.fileno())
        self.gate = VelocityGate(
            publisher.transmit, profile.limits, self.guardian.latch, self.guardian.sending,
            command=profile.command)
        self.gate.publish = hub.publish
        manual_control = ManualControlClient(
            node, names.manual_control, profile.manual_control_timeout)
        self.discovery = RobotDiscovery(
            node, names, publisher, manual_control, self.guardian, profile)
        self._foreign = ForeignMessages(
            node, publisher,
            list if parameters.allow_other_publishers else self.discovery.other_publishers,
            # A permanent stop of this node also sets the latch; the guardian then sends nothing.
            lambda: self.guardian.latch.is_set and hub.stopped_by is None,
            self._on_foreign_message)
        self.stopper = StopController(
            self.gate, profile.command_timeout, self.guardian, self._more_zeros_time,
            publish=hub.publish)
        self._end = EndCheck(profile.odometry_calibration)
        self._judge = EndJudge(
            self._end, parameters.within, lambda: bool(self.odometry.is_still(time.monotonic())),
            node.get_logger().warning)
        self.stopper.on_stopped, self.stopper.on_failure = self._judge.on_stopped, self._log_once
        lease = LeaseRenewer(lambda: manual_control.request(True), profile.command_timeout)
        #: the speed relative to the plan: the product of named factors
        self.speed_factor = SpeedFactor()
        self.monitor = RunMonitor(
            self.guardian, lease if manual_control.is_needed else None, self.discovery,
            self._foreign, self.odometry, parameters, self.speed_factor)
        self.monitor.on_kept_hold = node.get_logger().warning
        #: the newest run: its plan, its progress, and why it ended
        self.drive = RobotDrive(
            self.gate, self.monitor, self.speed_factor, profile.command_timeout)
        self.connection = RobotConnection(
            node, publisher, parameters, names.odometry if parameters.odometry_timeout else None,
            self.odometry, self.gate, claim, self.guardian, self.discovery, self._foreign,
            manual_control, lease, hub.executor)
        #: the newest drive that was requested; None before the first
        self.request: DriveRequest | None = None
        #: the run whose stop was logged last; this robot before the first stop
        self._logged_stop_of: object = self
        self._logging = threading.Lock()
        #: whether the failure of the last stop was already reported
        self._has_reported = False
        self.status_reader = StatusReader(
            self.drive, self.discovery, self.guardian, self.odometry, manual_control,
            lambda: hub.stopped_by)

    def prepare(self, moment: Moment, is_closed_loop: bool) -> Steps[None]:
        """
        Get control of the robot, and wait until a closed loop sees it at rest.

        :raises ControlError: if this program cannot get control of the robot
        """
        self._has_reported = False
        self.require_not_stopped()
        yield from self.connection.prepare(moment)
        if is_closed_loop:
            assert self._feedback is not None
            yield from wait_for_rest(
                moment, self._feedback, self.odometry, f'odometry on {self._odometry_topic}')

    def begin(
            self, source: VelocitySource, t0: float, period: float,
            corrected: Limits | None) -> None:
        """
        Begin to drive, when ``prepare`` has ended; log a pause or a lower speed.

        :param corrected: the limits of corrected velocities; None without a closed loop
        """
        assert self.request is not None
        # Only now: the pending stop of the previous movement must still be sent if the wait for
        # the robot is long.
        self._hub.late_stops.cancel(self.stopper)
        feedback, plan = None, self.drive.progress.plan
        if corrected is not None and plan is not None and self._feedback is not None:
            feedback = self._feedback
            feedback.begin(plan, corrected)
        self.monitor.begin(time.monotonic(), feedback, period, plan is not None)
        if self.speed_factor.is_hold:
            self._node.get_logger().warning(
                f'The motion is held at its start ({self.speed_factor.describe()}): resume to '
                'go on')
        elif plan is not None and self.speed_factor.value < 1.0:
            self._node.get_logger().info(
                f'Slower than planned: {self.speed_factor.describe()}')
        self._end.begin()
        self.drive.begin(
            source, t0, period, self.request.runs[self.gate], self.pose)

    def complete(self, moment: Moment, period: float) -> Steps[None]:
        """
        Leave the robot at rest after a drive that has come to its end.

        :raises RunFaultError: if the robot does not rest where it should, and the parameter
            ``within`` asks for that
        """
        self.guardian.report_stopping()
        run, plan = self.gate.run, self.drive.progress.plan
        assert run is not None
        if plan is not None:
            self._end.on_complete(plan.pose)
        if plan is None or not self._judge.is_strict:
            self._hub.late_stops.schedule(self.stopper, run, within=period)
            return
        self._judge.problem = UNSEEN
        failure = yield from self.stopper.steps(moment, None, only=run)
        if failure := failure or self._judge.problem:
            raise errors.RunFaultError(failure)

    def finish(self) -> None:
        """Record that a drive has come to its end."""
        self.drive.finish()
        self._hub.publish(MotionEnded(time.monotonic()))

    def end_early(self, error: BaseException, failure: str | None) -> BaseException:
        """
        Record that the robot was stopped after an error in a drive.

        :param failure: why the stop has failed, if it did
        :returns: the error to raise: this one, or the guardian's
        """
        self.connection.is_taken = False
        if failure is not None:
            # The error of the drive is raised, and says nothing of it.
            self._log_once(failure)
        if isinstance(error, errors.PauseTimeoutError):
            self.connection.release()
        if self.guardian.stopped_because is not None:
            error = errors.RunFaultError(
                f'the guardian stopped the robot: {self.guardian.stopped_because}')
        text = _text(error)
        self.drive.finish(text)
        self._hub.publish(MotionEnded(time.monotonic(), text, is_fault=not isinstance(
            error, (errors.MotionRefusedError, KeyboardInterrupt))))
        return error

    def stop(self, reason: errors.ControlError) -> str | None:
        """Stop the robot, and wait for the stop; return why it failed, or None."""
        return self.stopper.stop(reason) or self._unconfirmed()

    def stop_or_log(self, reason: errors.ControlError) -> None:
        """Stop the robot; log an error if the stop fails, or the robot still moves."""
        if (failure := self.stop(reason)) is not None:
            self._log_once(failure)

    def stop_for_user(self, reason: errors.ControlError) -> str:
        """
        Stop the robot as ``stop`` does; return a text for the user.

        :raises RunFaultError: if the stop could not be sent, or the robot still moves by odometry
        """
        was_stopped = self.stopper.is_stopped
        if (failure := self.stop(reason)) is not None:
            # After a signal, the program ends, and nobody prints the error: log it here.
            if self._hub.stopped_by is None:
                self._has_reported = True
            else:
                self._log_once(failure)
            raise errors.RunFaultError(failure)
        if self.gate.state is GateState.NOT_OPENED:
            return 'nothing was sent: this node has not taken a robot'
        run = self.gate.run
        if self._logged_stop_of is not run:
            self._logged_stop_of = run
            self._node.get_logger().info('Robot has stopped')
        return ('nothing was sent: the robot had been stopped before' if was_stopped
                else 'the robot was stopped')

    def close(self) -> None:
        """Let no velocity pass any more, and release the robot, which was stopped."""
        self.gate.close()
        # The guardian's publisher must be gone as well before the robot is released.
        self.guardian.shutdown()
        self.connection.release()
        self.connection.claim.release()

    def on_odometry(self, now: float, pose: Pose, velocity: Velocity, is_new: bool) -> None:
        """Process odometry; ``is_new``: its stamp is later than the last one, or it has none."""
        self.odometry.on_odometry(now, velocity)
        if self._feedback is not None and is_new:
            self._feedback.on_odometry(now, pose, is_moving=self.odometry.is_moving(now))
        self.monitor.pause_pose.on_odometry(now, pose, velocity)
        self._end.on_odometry(pose)
        self._hub.publish(OdometryReceived(now, pose, velocity))

    def check_resume(self, even_if_moved: bool) -> None:
        """Raise an error if the paused motion may not go on; do nothing if there is none."""
        if not self.connection.is_taken:
            return
        self.monitor.check_resume(time.monotonic())
        if even_if_moved:
            self.monitor.pause_pose.accept()
        else:
            self.monitor.pause_pose.require_not_moved()

    def require_not_stopped(self) -> None:
        """Raise what has stopped the robot for good, if anything; also after ``close``."""
        if (reason := self._hub.stopped_by) is not None:
            raise reason
        if self.guardian.stopped_because is not None:
            # The latch of the guardian blocks all motion of this program.
            raise errors.RunFaultError(
                'nothing moves until this program is started again: the guardian stopped the '
                f'robot: {self.guardian.stopped_because}')
        if self.guardian.has_ended:
            raise errors.RunFaultError(
                'nothing moves until this program is started again: the guardian has ended')

    @property
    def pose(self) -> Pose | None:
        """Return the newest pose of the robot in the odometry frame; None before the first."""
        return self.monitor.pause_pose.newest

    @property
    def is_heard(self) -> bool:
        """Return whether the robot subscribes to this node and to its guardian, if any."""
        return self.discovery.is_subscribed and self.guardian.is_matched

    @property
    def stop_confirmed_after(self) -> float | None:
        """Return the time from the start of the last stop to rest by odometry [s], or None."""
        started, still = self.stopper.stop_started, self.odometry.still_since(time.monotonic())
        return None if started is None or still is None else max(0.0, still - started)

    def _more_zeros_time(self) -> float:
        """Return how much longer a stop must go on [s]; 0 at rest, or if somebody else drives."""
        now = time.monotonic()
        if self._foreign.has_recent(now):
            return 0.0
        # What the kernel kept of our velocities must be gone before our publisher is destroyed:
        # after that, a reader drops the zeros that follow them.
        if self.monitor.has_lost_robot(now):
            return STOP_LOST_LINK_TIME
        return STOP_CONFIRM_TIMEOUT if self.odometry.is_moving(now) else 0.0

    def _unconfirmed(self) -> str | None:
        """Return an error text if odometry still shows motion after a stop of ours, else None."""
        now = time.monotonic()
        # Before the gate is open, or while another program drives, motion is not our failure.
        is_ours = self.gate.state is GateState.OPEN and not self._foreign.has_recent(now)
        if is_ours and self.odometry.is_moving(now):
            return ('the stop is unconfirmed: zeros were sent, and odometry still sees the robot '
                    'move')
        return None

    def require_wanted(self) -> None:
        """Raise what has stopped the drive while it waited for the robot, if anything."""
        self.require_not_stopped()
        if self.request is not None and self.request.cancelled_by is not None:
            raise self.request.cancelled_by

    def _on_foreign_message(self, sender: str) -> None:
        if self.gate.state is GateState.NOT_OPENED:
            # The publisher of the other program was found while this program waited.
            self._end_run(self._foreign.taken(sender))
            return
        self._end_run(errors.RunFaultError(
            f'{sender} sends velocities on {self._publisher.topic_name}, so the motion was '
            'ended; stop that program, or set the parameter allow_other_publishers to true'))

    def _on_conflict(self, holder: str) -> None:
        self._end_run(errors.RunFaultError(
            f'another program drives the robot as well: {holder}; both stop'))

    def _end_run(self, reason: errors.ControlError) -> None:
        """End the drive under way, if any, by one zero at once; its thread sends the others."""
        # Without a drive this program moves nothing, and it must not disturb another program.
        if self.request is not None and not self.request.is_over:
            self.drive.end(reason)

    def _log_once(self, failure: str) -> None:
        """Log that a stop has failed, unless this was reported before; for any thread."""
        with self._logging:
            has_reported, self._has_reported = self._has_reported, True
        if not has_reported:
            self._node.get_logger().error(failure)


def _text(error: BaseException) -> str:
    """Return a text that says why a drive ended, for displays and logs."""
    if signal_dispatcher.signum is not None:
        return f'stopped by {signal.Signals(signal_dispatcher.signum).name}'
    return str(error) or type(error).__name__
