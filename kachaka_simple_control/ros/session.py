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
"""Connect a node with one robot: get control of the robot, drive it, stop it and release it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from functools import partial
import signal
import threading
import time

from kachaka_simple_control import errors
from kachaka_simple_control.control.drive_loop import DriveLoop, old_objects_frozen
from kachaka_simple_control.control.drive_requests import DriveRequest, DriveRequests
from kachaka_simple_control.control.end_check import EndCheck, EndJudge, UNSEEN
from kachaka_simple_control.control.events import (
    Event,
    MotionEnded,
    MotionPlanned,
    OdometryReceived,
)
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.preparation import complete, Moment, Steps
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.run_monitor import LeaseRenewer, RunMonitor
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.stop import StopController
from kachaka_simple_control.control.tick_scheduler import TickScheduler, VelocitySource
from kachaka_simple_control.control.timing import STOP_CONFIRM_TIMEOUT, STOP_LOST_LINK_TIME
from kachaka_simple_control.control.velocity_gate import GateState, VelocityGate
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros.executors import BackgroundExecutor
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.ros.node_parameters import NodeParameters
from kachaka_simple_control.ros.odometry import OdometryReader
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.robot_connection import (
    RobotConnection,
    start_guardian,
    wait_for_rest,
)
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery
from kachaka_simple_control.ros.session_status import StatusReader
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.text import escaped
from rclpy.node import Node


class Session:
    """
    Connects a node with one robot, drives the robot, and stops it.

    The robot is stopped at the end of each drive, after an error, and by ``close``.  ``drive``
    plans and drives in its thread, one motion at a time.  Any thread may call ``stop``,
    ``stop_permanently`` and ``close``.

    :param publisher: only the velocity gate sends with it
    :param publish: puts an event into a queue, and returns at once
    :param reader: None if there is no odometry
    """

    def __init__(
            self, node: Node, publisher: VelocityPublisher, profile: RobotProfile,
            names: RobotNames, parameters: NodeParameters,
            publish: Callable[[Event], None], reader: OdometryReader | None) -> None:
        self._node = node
        #: corrects velocities with odometry; None without the parameter ``closed_loop``
        self._feedback = PoseFeedback(
            profile.feedback_delay(), profile.odometry_calibration) if (
                parameters.closed_loop) else None
        self._feedback_topic = names.odometry
        #: detects from odometry whether the robot moves
        self.odometry = StandstillDetector()
        self._claim = RobotClaim(node, publisher.topic_name, 'driver', self._on_conflict)
        self._publisher = publisher
        self._guardian = start_guardian(
            node, publisher, profile, parameters, self._claim.fileno())
        self.gate = VelocityGate(
            publisher.transmit, profile.limits, self._guardian.latch, self._guardian.sending,
            command=profile.command)
        self.gate.publish = publish
        self._manual_control = ManualControlClient(
            node, names.manual_control, profile.manual_control_timeout)
        self._discovery = RobotDiscovery(
            node, names, publisher, self._manual_control, self._guardian, profile)
        self._foreign = ForeignMessages(
            node, publisher,
            list if parameters.allow_other_publishers else self._discovery.other_publishers,
            # A permanent stop of this node also sets the latch; the guardian then sends nothing.
            lambda: self._guardian.latch.is_set and self._stopped_by is None,
            self._on_foreign_message)
        self._stopper = StopController(
            self.gate, profile.command_timeout, self._guardian, self._more_zeros_time,
            publish=publish)
        self._end = EndCheck(profile.odometry_calibration)
        self._judge = EndJudge(
            self._end, parameters.within, lambda: bool(self.odometry.is_still(time.monotonic())),
            node.get_logger().warning)
        self._stopper.on_stopped = self._judge.on_stopped
        self._lease = LeaseRenewer(
            lambda: self._manual_control.request(True), profile.command_timeout)
        #: the speed relative to the plan: the product of named factors
        self.speed_factor = SpeedFactor()
        self._monitor = RunMonitor(
            self._guardian, self._lease if self._manual_control.is_needed else None,
            self._discovery, self._foreign, self.odometry, parameters, self.speed_factor)
        self._monitor.on_kept_hold = node.get_logger().warning
        #: the newest run: its plan, its progress, and why it ended
        self.robot_drive = RobotDrive(
            self.gate, self._monitor, self.speed_factor, profile.command_timeout)
        self._loop = DriveLoop()
        self.gate.wake = partial(self._loop.wake, self.robot_drive)
        self._executor = BackgroundExecutor(node, self._on_callback_error)
        self._connection = RobotConnection(
            node, publisher, parameters,
            names.odometry if parameters.odometry_timeout else None, self.odometry, self.gate,
            self._claim, self._guardian, self._discovery, self._foreign, self._manual_control,
            self._lease, self._executor)
        self._requests = DriveRequests(self.gate)
        self._request: DriveRequest | None = None
        self._publish = publish
        #: the run whose stop was logged last; this session before the first stop
        self._logged_stop_of: object = self
        self._closing, self._logging = threading.Lock(), threading.Lock()
        #: why no motion may start again; None while motions may start
        self._stopped_by: errors.ControlError | None = None
        self._stopped = threading.Event()
        self._is_closed = False
        #: whether the failure of the last stop was already reported
        self._has_reported = False
        #: the state of the session, for diagnostics
        self.status_reader = StatusReader(
            self.robot_drive, self._discovery, self._guardian, self.odometry,
            self._manual_control, lambda: self._stopped_by)
        self._reader = reader
        if reader is not None:
            reader.start(self._on_odometry, self._on_callback_error)

    def request(self, elsewhere: bool = False) -> DriveRequest:
        """
        Request a drive, so that a stop ends it even before ``drive`` runs.

        :param elsewhere: whether another thread will call ``drive``
        :raises ControlError: if another drive is under way, no motion may start any more, or the
            calling thread runs a callback of the node and so cannot drive
        """
        if self._stopped_by is not None:
            raise type(self._stopped_by)(
                f'{self._stopped_by}: only a new node moves the robot again') from None
        self.require_not_stopped()
        if not elsewhere and self._executor.is_executor_thread():
            raise errors.MotionRefusedError(
                'a motion cannot run in a callback of its own node: it would wait for callbacks '
                'that wait for it. Start it in a thread, or from the main program')
        return self._requests.accept()

    def drive(self, order: DriveOrder, request: DriveRequest | None = None) -> Plan:
        """
        Plan a motion, drive the robot through it, and leave the robot at rest; return the plan.

        :raises InvalidMotionError: if the robot cannot do the motion; the robot has not moved then
        :raises ControlError: if there is no control of the robot, or the drive ended early
        """
        request = request or self.request()
        with self._accepted(request):
            plan = order.plan()
            self.robot_drive.request(order.motion.name, plan)
            self._publish(MotionPlanned(
                order.motion, order.limits, order.rate, time.monotonic()))
            self._drive(
                TickScheduler(plan), plan.period, request, lambda: None if (
                    order.corrected is None) else self._begin_feedback(plan, order.corrected))
        return plan

    def drive_source(
            self, title: str, source: VelocitySource, period: float,
            request: DriveRequest | None = None) -> None:
        """
        Send the velocities of a source until it has no more, and leave the robot at rest.

        :param period: the normal time between two velocities [s]
        :raises ControlError: if there is no control of the robot, or the drive ended early
        """
        request = request or self.request()
        with self._accepted(request):
            self.robot_drive.request(title)
            self._drive(source, period, request, lambda: None)

    @contextlib.contextmanager
    def _accepted(self, request: DriveRequest) -> Iterator[None]:
        """Finish an accepted request at the end of a block, also if an error ends the block."""
        is_complete = False
        try:
            yield
            is_complete = True
        finally:
            self._requests.finish(request, is_complete)

    def _drive(
            self, source: VelocitySource, period: float, request: DriveRequest,
            begin_feedback: Callable[[], PoseFeedback | None]) -> None:
        """Drive; ``begin_feedback`` starts the closed loop, if any, when the robot is taken."""
        try:
            self._prepare(request, begin_feedback, period)
            self._end.begin()
            with old_objects_frozen():
                run = self.robot_drive.begin(
                    source, time.monotonic(), period, request.run,
                    self._monitor.pause_pose.newest)
                self._loop.run([self.robot_drive])
            self._guardian.report_stopping()
            if (plan := self.robot_drive.progress.plan) is not None:
                self._end.on_complete(plan.pose)
            if plan is not None and self._judge.is_strict:
                self._judge.problem = UNSEEN
                if failure := self._stopper.stop(None, only=run) or self._judge.problem:
                    raise errors.RunFaultError(failure)
            else:
                self._stopper.stop_after_idle(run, within=period)
        except BaseException as error:
            # KeyboardInterrupt and SystemExit as well: the robot must stop in every case.
            ended = self._end_early(error)
            if ended is error:
                raise
            raise ended from error
        self.robot_drive.finish()
        self._publish(MotionEnded(time.monotonic()))

    def _prepare(
            self, request: DriveRequest,
            begin_feedback: Callable[[], PoseFeedback | None], period: float) -> None:
        """Get control of the robot, and prepare checks; log a pause or a lower speed."""
        self._request, self._has_reported = request, False
        request.period = period
        self.require_not_stopped()
        complete(self._connection.prepare, self._require_wanted)
        feedback = begin_feedback()
        # Only now: the pending stop of the previous movement must still be sent if the wait for
        # the robot is long.
        self._stopper.cancel_pending()
        has_plan = self.robot_drive.progress.plan is not None
        self._monitor.begin(feedback, period, has_plan)
        if self.speed_factor.is_hold:
            self._node.get_logger().warning(
                f'The motion is held at its start ({self.speed_factor.describe()}): resume to '
                'go on')
        elif has_plan and self.speed_factor.value < 1.0:
            self._node.get_logger().info(
                f'Slower than planned: {self.speed_factor.describe()}')

    def _end_early(self, error: BaseException) -> BaseException:
        """Stop the robot after an error in a drive; return the one to raise, or the guardian's."""
        self._connection.is_taken = False
        if (failure := self._stopper.stop(errors.control_error(error))) is not None:
            # The error of the drive is raised, and says nothing of it.
            self._log_once(failure)
        if isinstance(error, errors.PauseTimeoutError):
            self._connection.release()
        if self._guardian.stopped_because is not None:
            error = errors.RunFaultError(
                f'the guardian stopped the robot: {self._guardian.stopped_because}')
        text = _text(error)
        self.robot_drive.finish(text)
        self._publish(MotionEnded(time.monotonic(), text, is_fault=not isinstance(
            error, (errors.MotionRefusedError, KeyboardInterrupt))))
        return error

    def stop(self, caller: str) -> str:
        """
        Stop the robot, and wait until the stop is complete; return a text for the user.

        A drive ends with an error, even before the robot moves.  Nothing is sent to a robot of
        which this node has no control, or that is stopped already.

        :param caller: who stops the robot, for the error that ends the drive
        :raises RunFaultError: if the stop could not be sent, or the robot still moves by odometry
        """
        reason = errors.MotionStoppedError(f'the movement was ended by {caller}')
        was_stopped = self._stopper.is_stopped
        self._requests.on_stop(reason)
        failure = self._stopper.stop(reason) or self._unconfirmed()
        if failure is not None:
            # After a signal, the program ends, and nobody prints the error: log it here.
            if self._stopped_by is None:
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

    @property
    def is_stopping(self) -> bool:
        """Whether this node sends the zero velocities of a stop now."""
        return self._stopper.is_stopping

    def stop_permanently(self, reason: errors.ControlError) -> None:
        """Stop the robot for good: each later motion raises the first reason given."""
        self._stopped_by = self._stopped_by or reason
        self._stopped.set()
        self._guardian.latch.trip()
        self._stop(reason)

    def _log_once(self, failure: str) -> None:
        """Log that a stop has failed, unless this was reported before; for any thread."""
        with self._logging:
            has_reported, self._has_reported = self._has_reported, True
        if not has_reported:
            self._node.get_logger().error(failure)

    def on_odometry(
            self, now: float, pose: Pose, velocity: Velocity, is_new: bool = True) -> None:
        """Process odometry; ``is_new``: its stamp is later than the last one, or it has none."""
        self.odometry.on_odometry(now, velocity)
        if self._feedback is not None and is_new:
            self._feedback.on_odometry(now, pose, is_moving=self.odometry.is_moving(now))
        self._monitor.pause_pose.on_odometry(now, pose, velocity)
        self._end.on_odometry(pose)

    def check_resume(self, even_if_moved: bool) -> None:
        """Raise an error if a paused motion may not go on, or if nothing may move any more."""
        self.require_not_stopped()
        if not self._requests.is_busy or not self._connection.is_taken:
            return
        self._monitor.check_resume()
        if even_if_moved:
            self._monitor.pause_pose.accept()
        else:
            self._monitor.pause_pose.require_not_moved()

    def require_not_stopped(self) -> None:
        """Raise what has stopped the robot for good, if anything; also after ``close``."""
        if self._stopped_by is not None:
            raise self._stopped_by
        if self._guardian.stopped_because is not None:
            # The latch of the guardian blocks all motion of this program.
            raise errors.RunFaultError(
                'nothing moves until this program is started again: the guardian stopped the '
                f'robot: {self._guardian.stopped_because}')
        if self._guardian.has_ended:
            raise errors.RunFaultError(
                'nothing moves until this program is started again: the guardian has ended')

    def close(self) -> None:
        """Stop and release the robot, end the threads of the node, refuse later motions."""
        with self._closing:
            if not self._is_closed:
                self.stop_permanently(errors.MotionRefusedError(errors.ENDED))
                self.gate.close()
                # The guardian's publisher must be gone as well before the robot is released.
                self._guardian.shutdown()
                self._connection.release()
                self._is_closed = True
                self._claim.release()
                self._loop.close()
            self._executor.stop()
            if self._reader is not None:
                self._reader.stop()

    def serve_until_stopped(self) -> None:
        """Run callbacks in a background thread until ``stop_permanently``; raise its reason."""
        self._executor.ensure_spinning()
        # Do not serve them in this thread: if a signal interrupts rclpy while it creates a message
        # for a callback, a TypeError is raised, and the node's callbacks stay blocked.
        self._stopped.wait()
        self.require_not_stopped()

    def require_robot(self, participant: Callable[[], bytes | None]) -> None:
        """Accept no robot but that with a DDS participant; none while it is not known."""
        self._discovery.require_participant(participant)

    @property
    def guardian_memory(self) -> tuple[int, int] | None:
        """Return the descriptor of the guardian's memory and the slot; None without it."""
        return self._guardian.shared_memory

    @property
    def is_stopped_permanently(self) -> bool:
        """Whether a signal or the guardian has stopped the robot, so that no motion may start."""
        return self._stopped_by is not None or self._guardian.stopped_because is not None

    @property
    def pose(self) -> Pose | None:
        """Return the newest pose of the robot in the odometry frame; None before the first."""
        return self._monitor.pause_pose.newest

    @property
    def is_driving(self) -> bool:
        """Whether a drive was requested and is not over; it may still wait for the robot."""
        return self._requests.is_busy

    @property
    def has_subscriber(self) -> bool:
        """Return whether the robot subscribes to this node and to its guardian, if any."""
        return self._discovery.is_subscribed and self._guardian.is_matched

    @property
    def stop_confirmed_after(self) -> float | None:
        """Return the time from the start of the last stop to rest by odometry [s], or None."""
        started, still = self._stopper.stop_started, self.odometry.still_since(time.monotonic())
        return None if started is None or still is None else max(0.0, still - started)

    def _begin_feedback(self, plan: Plan, limits: Limits) -> PoseFeedback:
        """Wait until odometry shows the robot at rest, then start the closed loop for a plan."""
        feedback = self._feedback
        assert feedback is not None

        def rest(moment: Moment) -> Steps[None]:
            yield from wait_for_rest(
                moment, feedback, self.odometry, f'odometry on {self._feedback_topic}')

        complete(rest, self._require_wanted)
        feedback.begin(plan, limits)
        return feedback

    def _more_zeros_time(self) -> float:
        """Return how much longer a stop must go on [s]; 0 at rest, or if somebody else drives."""
        now = time.monotonic()
        if self._foreign.has_recent(now):
            return 0.0
        # What the kernel kept of our velocities must be gone before our publisher is destroyed:
        # after that, a reader drops the zeros that follow them.
        if self._monitor.has_lost_robot(now):
            return STOP_LOST_LINK_TIME
        return STOP_CONFIRM_TIMEOUT if self.odometry.is_moving(now) else 0.0

    def _stop(self, reason: errors.ControlError) -> None:
        """Stop the robot; log an error if the stop fails, or the robot still moves."""
        if (failure := self._stopper.stop(reason) or self._unconfirmed()) is not None:
            self._log_once(failure)

    def _unconfirmed(self) -> str | None:
        """Return an error text if odometry still shows motion after a stop of ours, else None."""
        now = time.monotonic()
        # Before the gate is open, or while another program drives, motion is not our failure.
        is_ours = self.gate.state is GateState.OPEN and not self._foreign.has_recent(now)
        if is_ours and self.odometry.is_moving(now):
            return ('the stop is unconfirmed: zeros were sent, and odometry still sees the robot '
                    'move')
        return None

    def _require_wanted(self) -> None:
        """Raise what has stopped the drive while it waited for the robot, if anything."""
        self.require_not_stopped()
        if self._request is not None and self._request.run.ended_by is not None:
            raise self._request.run.ended_by

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
        if not self._requests.is_busy:
            return
        self.robot_drive.end(reason)

    def _on_odometry(self, now: float, pose: Pose, velocity: Velocity, is_new: bool) -> None:
        self.on_odometry(now, pose, velocity, is_new)
        self._publish(OdometryReceived(now, pose, velocity))

    def _on_callback_error(self, error: BaseException) -> None:
        self.stop_permanently(
            errors.RunFaultError(f'a callback failed: {type(error).__name__}: {escaped(error)}'))


def _text(error: BaseException) -> str:
    """Return a text that says why a drive ended, for displays and logs."""
    if signal_dispatcher.signum is not None:
        return f'stopped by {signal.Signals(signal_dispatcher.signum).name}'
    return str(error) or type(error).__name__
