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

from functools import partial
import signal
import time

from kachaka_simple_control import errors
from kachaka_simple_control.control.drive_monitor import DriveMonitor, LeaseRenewer
from kachaka_simple_control.control.drive_requests import DriveRequest
from kachaka_simple_control.control.events import OdometryReceived, ScanReceived
from kachaka_simple_control.control.hold_text import is_of_watch
from kachaka_simple_control.control.obstacle_watch import ObstacleWatch
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.preparation import complete, Moment, Steps
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.scan_watch import ScanWatch
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.tick_scheduler import VelocitySource
from kachaka_simple_control.control.velocity_gate import GateState, VelocityGate
from kachaka_simple_control.files.watch_check import require_watchable
from kachaka_simple_control.motion.geometry import Point, Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.hub import Hub
from kachaka_simple_control.ros.laser_scan import LaserActivation, LaserReader
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.odometry import OdometryReader, Reader, subscribe_to_odometry
from kachaka_simple_control.ros.parameters import RobotSettings
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.robot_connection import (
    RobotConnection,
    start_guardian,
    wait_for_rest,
)
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery
from kachaka_simple_control.ros.robot_status import StatusReader
from kachaka_simple_control.ros.robot_stop import RobotStop
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher


class Robot:
    """
    What a node has for each robot.  It has no thread, and computes no plan.

    A ``Drive`` calls ``prepare`` and ``begin``, lets a loop call ``drive``, and then calls
    ``complete`` and ``finish``, or ``end_early``.  Any thread may call the others.
    """

    def __init__(self, hub: Hub, settings: RobotSettings) -> None:
        self._hub, node = hub, hub.node
        self._logger = hub.logger(settings.name)
        self.settings, parameters, profile = settings, settings.parameters, settings.profile
        #: empty for the only robot of a node
        self.name = settings.name
        self.publish = partial(hub.event_bus.publish, robot=settings.name)
        #: only the velocity gate sends with it
        self.publisher = VelocityPublisher(
            node, settings.names.velocity, profile.message_type, profile.frame)
        #: None without odometry
        self.reader = self._subscribe_to_odometry()
        #: corrects velocities with odometry; None without the parameter ``closed_loop``
        self._feedback = PoseFeedback(
            profile.feedback_delay(), profile.odometry_calibration) if (
                parameters.closed_loop) else None
        #: detects from odometry whether the robot moves
        self.odometry = StandstillDetector()
        claim = RobotClaim(hub.graph, self.publisher.topic_name, 'driver', self._on_conflict)
        self.guardian = start_guardian(
            node, self.publisher, profile, parameters, claim.fileno())
        self.gate = VelocityGate(
            self.publisher.transmit, profile.limits, self.guardian.latch, self.guardian.sending,
            command=profile.command)
        self.gate.publish = self.publish
        self.gate.has_readers = partial(hub.event_bus.has_readers, robot=settings.name)
        manual_control = ManualControlClient(
            node, settings.names.manual_control, profile.manual_control_timeout)
        self.discovery = RobotDiscovery(
            hub.graph, settings.names, self.publisher, manual_control, self.guardian, profile)
        self._foreign = ForeignMessages(
            node, self.publisher,
            list if parameters.allow_other_publishers else self.discovery.other_publishers,
            # A permanent stop of this node also sets the latch; the guardian then sends nothing.
            lambda: self.guardian.latch.is_set and hub.stopped_by is None,
            self._on_foreign_message)
        lease = LeaseRenewer(lambda: manual_control.request(True), profile.command_timeout)
        #: the speed relative to the plan: the product of named factors
        self.speed_factor = SpeedFactor()
        self.monitor = DriveMonitor(
            self.guardian, lease if manual_control.is_needed else None, self.discovery,
            self._foreign, self.odometry, parameters, self.speed_factor)
        self.monitor.on_kept_hold = self._logger.warning
        self.stopper = RobotStop(
            hub, self.gate, settings, self.guardian, self.odometry, self._foreign, self.monitor)
        #: reads the scans of the laser, and holds the robot before obstacles; None without
        self._laser = self._subscribe_to_laser()
        self.watch = None if self._laser is None else self._make_watch(self._laser)
        self.monitor.watch = self.watch
        #: the newest drive: its plan, its progress, and why it ended
        self.drive = RobotDrive(
            self.gate, self.monitor, self.speed_factor, profile.command_timeout)
        self.stopper.on_stop = self.drive.on_stop
        self.connection = RobotConnection(
            node, self._logger, self.publisher, parameters,
            settings.names.odometry if parameters.odometry_timeout else None,
            self.odometry, self.drive, claim, self.guardian, self.discovery, self._foreign,
            manual_control, lease, hub.executor)
        #: the newest drive that was requested; None before the first
        self.request: DriveRequest | None = None
        self.status_reader = StatusReader(
            self.drive, self.discovery, self.guardian, self.odometry, manual_control,
            lambda: hub.stopped_by)

    @property
    def readers(self) -> list[Reader]:
        """Return what reads the odometry and the scans of the robot."""
        return [reader for reader in (self.reader, self._laser) if reader is not None]

    def _subscribe_to_laser(self) -> LaserReader | None:
        names, laser = self.settings.names, self.settings.profile.laser
        if not self.settings.parameters.watch:
            return None
        self.settings.profile.watching_laser()  # says what is missing
        assert names.laser is not None
        assert laser is not None
        return LaserReader(self._hub.node, names.laser, laser.pose, self._hub.odometry_group)

    def _make_watch(self, reader: LaserReader) -> ScanWatch:
        profile, activation = self.settings.profile, self.settings.names.laser_activation
        assert profile.laser is not None
        assert profile.footprint is not None
        watch = ScanWatch(
            ObstacleWatch(profile.footprint, profile.laser.margin, profile.known_delay),
            self.speed_factor, self.name, self.publish, self._logger.warning)
        if activation is not None:
            client = LaserActivation(self._hub.node, activation)
            watch.activate = partial(self.gate.wait_for_dds, client.request)
        reader.on_scan = self._on_scan
        return watch

    def _on_scan(self, now: float, taken: float, points: tuple[Point, ...]) -> None:
        assert self.watch is not None
        self.watch.on_scan(now, taken, points)
        if self.gate.has_readers(ScanReceived):
            self.publish(ScanReceived(taken, points))

    def _subscribe_to_odometry(self) -> OdometryReader | None:
        settings, parameters = self.settings, self.settings.parameters
        if not (parameters.summary or parameters.odometry_timeout or parameters.closed_loop
                or parameters.within or parameters.watch):
            return None
        reader = subscribe_to_odometry(
            self._hub.node, settings.names, self._hub.odometry_group)
        for what, is_wanted in (
                ('a closed loop', parameters.closed_loop), ('within', parameters.within)):
            if is_wanted and reader is None:
                raise errors.UsageError(f'{what} needs odometry, ' + (
                    'and nav_msgs is not installed' if settings.names.odometry
                    else f'and profile {settings.profile.name} names none'))
        if reader is not None:
            reader.on_odometry = self._on_odometry
        return reader

    def prepare(
            self, moment: Moment, source: VelocitySource, is_closed_loop: bool) -> Steps[None]:
        """
        Get control of the robot, and wait until a closed loop sees it at rest, and a watch all.

        :raises ControlError: if this program cannot get control of the robot
        """
        self.stopper.begin()
        self.require_not_stopped()
        yield from self.connection.prepare(moment)
        if is_closed_loop:
            assert self._feedback is not None
            yield from wait_for_rest(
                moment, self._feedback, self.odometry,
                f'odometry on {self.settings.names.odometry}')
        if self.watch is not None:
            yield from self.watch.prepare(
                moment, str(self.settings.names.laser), self.drive.progress.plan,
                lambda: self.pose, source)

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
            goes_on = all(map(is_of_watch, self.speed_factor.factors))
            self._logger.warning(
                f'The motion is held at its start ({self.speed_factor.describe()})'
                f'{"" if goes_on else ": resume to go on"}')
        elif plan is not None and self.speed_factor.value < 1.0:
            self._logger.info(
                f'Slower than planned: {self.speed_factor.describe()}')
        self.stopper.end.begin()
        self.drive.begin(
            source, t0, period, self.request.permits[self.gate], self.pose)

    def complete(self, moment: Moment, period: float) -> Steps[None]:
        """
        Leave the robot at rest after a drive that has come to its end.

        :raises RunFaultError: if the robot does not rest where it should, and the parameter
            ``within`` asks for that
        """
        self.guardian.report_stopping()
        permit = self.gate.permit
        assert permit is not None
        yield from self.stopper.complete(moment, permit, self.drive.progress.plan, within=period)

    def end_before_others(self) -> None:
        """Let another thread stop this robot, which has ended its plan before the others."""
        self.end_watch()
        assert self.gate.permit is not None
        self.guardian.report_stopping()
        self.stopper.begin_elsewhere(self.gate.permit, self.drive.progress.plan)

    def stop_later(self) -> None:
        """Let another thread stop this robot, whose drive has ended while others go on."""
        self.end_watch()
        assert self.gate.permit is not None
        # Its thread, which drives others, goes on to write heartbeats.
        self.guardian.report_stopping()
        self._hub.late_stops.schedule(self.stopper, self.gate.permit, within=0.0)

    def finish(self) -> None:
        """Record that a drive has come to its end."""
        self.end_watch()
        self.drive.finish(time.monotonic())

    def end_early(self, error: BaseException, failure: str | None) -> BaseException:
        """
        Record that the robot was stopped after an error in a drive.

        :param failure: why the stop has failed, if it did
        :returns: the error to raise: this one, or the guardian's
        """
        self.connection.is_taken = False
        self.end_watch()
        if failure is not None:
            # The error of the drive is raised, and says nothing of it.
            self.stopper.log_once(failure)
        if isinstance(error, errors.PauseTimeoutError):
            complete([self.connection.release])
        if self.guardian.stopped_because is not None:
            error = errors.RunFaultError(
                f'the guardian stopped the robot: {self.guardian.stopped_because}')
        self.record_end(error)
        return error

    def record_end(self, error: BaseException) -> None:
        """Record why a drive has ended early, unless that was done."""
        self.drive.finish(time.monotonic(), _text(error), is_fault=not isinstance(
            error, (errors.MotionRefusedError, KeyboardInterrupt)))

    def require_watchable(self, motion: Motion) -> None:
        """Raise an InvalidMotionError if the obstacle watch, if any, cannot watch a motion."""
        if self.watch is not None:
            require_watchable(motion, self.settings.profile)

    def go_blind(self) -> bool:
        """Go on slowly without a scan of the laser; return whether only scans were missing."""
        return self.watch is not None and self.watch.go_blind(time.monotonic())

    def cut(self, velocity: Velocity) -> Velocity:
        """Return the part of a velocity by hand that the obstacle watch allows."""
        watch, profile = self.watch, self.settings.profile
        if watch is None:
            return velocity
        return watch.cut(velocity, profile.planning_limits, time.monotonic())

    def end_watch(self) -> None:
        """End to watch for obstacles, after a drive."""
        if self.watch is not None:
            self.watch.end()

    def release(self, moment: Moment) -> Steps[None]:
        """Let no velocity pass any more, and release the robot, which was stopped."""
        self.gate.close()
        # The guardian's publisher must be gone as well before the robot is released.
        yield from self.guardian.leave(moment)
        yield from self.connection.release(moment)
        yield from self.connection.claim.release(moment)

    @property
    def is_closed(self) -> bool:
        """Whether nothing may be published any more, because the robot is released."""
        return self.gate.state is GateState.CLOSED

    def _on_odometry(self, now: float, pose: Pose, velocity: Velocity, is_new: bool) -> None:
        """Process odometry; ``is_new``: its stamp is later than the last one, or it has none."""
        self.odometry.on_odometry(now, velocity)
        if self.watch is not None:
            self.watch.on_odometry(now, pose)
        if self._feedback is not None and is_new:
            self._feedback.on_odometry(now, pose, is_moving=self.odometry.is_moving(now))
        still_since = self.odometry.still_since(now)
        self.monitor.pause_pose.on_odometry(now, pose, still_since)
        self.stopper.end.on_odometry(pose)
        if self.gate.has_readers(OdometryReceived):
            self.publish(OdometryReceived(now, pose, velocity, still_since is not None))

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

    def named(self, error: errors.ControlError) -> errors.ControlError:
        """Say in an error of this robot which of several has it."""
        is_of_one = error is not self._hub.stopped_by and not isinstance(
            error, errors.MotionStoppedError)
        if self.name and is_of_one and error.args:
            error.args = (f'{self.name}: {error.args[0]}', *error.args[1:])
        return error

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
            f'{sender} sends velocities on {self.publisher.topic_name}, so the motion was '
            'ended; stop that program, or set the parameter allow_other_publishers to true'))

    def _on_conflict(self, holder: str) -> None:
        self._end_run(errors.RunFaultError(
            f'another program drives the robot as well: {holder}; both stop'))

    def _end_run(self, reason: errors.ControlError) -> None:
        """End the drive under way, if any, by one zero at once; its thread sends the others."""
        # Without a drive this program moves nothing, and it must not disturb another program.
        if self.request is not None and not self.request.is_over:
            self.drive.end(reason)


def _text(error: BaseException) -> str:
    """Return a text that says why a drive ended, for displays and logs."""
    if signal_dispatcher.signum is not None:
        return f'stopped by {signal.Signals(signal_dispatcher.signum).name}'
    return str(error) or type(error).__name__
