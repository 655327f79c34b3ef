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
"""A session with one robot: connect, drive, stop, release."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import signal
import threading
import time

from kachaka_simple_control.control import processes
from kachaka_simple_control.control.drive_loop import DriveLoop, old_objects_frozen
from kachaka_simple_control.control.drive_requests import DriveRequest, DriveRequests
from kachaka_simple_control.control.events import (
    Event,
    MotionEnded,
    MotionPlanned,
    VelocityKind,
)
from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.manual_control_lease import LeaseRenewer
from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.robot_drive import RobotDrive
from kachaka_simple_control.control.run_monitor import RunMonitor
from kachaka_simple_control.control.signals import signal_dispatcher
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.stop import StopController
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.control.timing import (
    FEEDBACK_MAX_AGE,
    FEEDBACK_START_TIMEOUT,
    GUARDIAN_PRIME_TIMEOUT,
    ODOMETRY_WAIT_TIME,
    RELEASE_TIMEOUT,
    REST_TIMEOUT,
    STOP_REPEAT_PERIOD,
)
from kachaka_simple_control.control.velocity_gate import GateState, VelocityGate
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.errors import (
    control_error,
    ControlError,
    MotionRefusedError,
    MotionStoppedError,
    PauseTimeoutError,
    RobotTakenError,
    RunFaultError,
)
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros.executors import BackgroundExecutor
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.ros.parameters import NodeParameters
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery
from kachaka_simple_control.ros.session_status import StatusReader
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.text import escaped
from rclpy.node import Node


class Session:
    """
    Connects a node with a robot; every way out of it stops the robot.

    Plans run in the thread that calls ``drive``, one at a time.  ``stop``, ``stop_permanently``
    and ``close`` may be called from any thread.

    :param node: the node that publishes
    :param publisher: its publisher of velocities; only the velocity gate uses it from now on
    :param profile: the kind of robot
    :param names: the names of this robot
    :param parameters: the node's parameters
    :param publish: puts an event into a queue, and returns at once
    """

    def __init__(
            self, node: Node, publisher: VelocityPublisher, profile: RobotProfile,
            names: RobotNames, parameters: NodeParameters,
            publish: Callable[[Event], None]) -> None:
        self._node = node
        #: the odometry topic; None if odometry is not checked
        self._odometry_topic = names.odometry if parameters.odometry_timeout else None
        self._parameters = parameters
        #: corrects velocities by odometry; None without the parameter ``closed_loop``
        self._feedback = PoseFeedback(
            profile.feedback_delay(), profile.odometry_calibration) if (
                parameters.closed_loop) else None
        self._feedback_topic = names.odometry
        #: what odometry shows of the robot's velocity
        self.odometry = StandstillDetector()
        self._claim = RobotClaim(node, publisher.topic_name, 'driver', self._on_conflict)
        self._publisher = publisher
        self._guardian = _start_guardian(
            node, publisher, profile, parameters, self._claim.fileno())
        self.gate = VelocityGate(
            publisher.transmit, profile.limits, self._guardian.latch, self._guardian.sending,
            command=profile.command)
        self.gate.publish = publish
        self._manual_control = ManualControlClient(
            node, names.manual_control, self._require_wanted, profile.manual_control_timeout)
        self._discovery = RobotDiscovery(
            node, names, publisher, self._manual_control, self._guardian)
        self._foreign = ForeignMessages(
            node, publisher,
            list if parameters.allow_other_publishers else self._discovery.other_publishers,
            # A permanent stop of this node sets the latch, too; the guardian sends nothing then.
            lambda: self._guardian.latch.is_set and self._stopped_by is None,
            self._on_foreign_message)
        self._stopper = StopController(
            self.gate, profile.command_timeout, self._guardian, self._is_still_moving,
            publish=publish)
        self._lease = LeaseRenewer(
            lambda: self._manual_control.request(True),
            response_timeout=profile.command_timeout - 1.0 / parameters.rate)
        #: the speed relative to the plan, and who wants it slower
        self.speed_factor = SpeedFactor()
        self._monitor = RunMonitor(
            self._guardian, self._lease if self._manual_control.is_needed else None,
            self._discovery, self._foreign, self.odometry, parameters, self.speed_factor)
        self._monitor.on_kept_hold = node.get_logger().warning
        #: the newest run: what is driven, how far it is, why it ended
        self.robot_drive = RobotDrive(
            self.gate, self._monitor, self.speed_factor, profile.command_timeout)
        self._loop = DriveLoop()
        self.gate.wake = partial(self._loop.wake, self.robot_drive)
        self._executor = BackgroundExecutor(node, self._on_callback_error)
        self._requests = DriveRequests(self.gate, 1.0 / parameters.rate)
        self._request: DriveRequest | None = None
        self._publish = publish
        #: the run whose stop was logged; itself before the first
        self._logged_stop_of: object = self
        self._closing, self._logging = threading.Lock(), threading.Lock()
        #: why no motion may start again; None as long as one may
        self._stopped_by: ControlError | None = None
        self._stopped = threading.Event()
        self._is_connected = False
        self._is_closed = False
        #: whether an error said already that the last stop is unconfirmed
        self._has_reported = False
        #: the state of the session, for diagnostics
        self.status_reader = StatusReader(
            self.robot_drive, self._discovery, self._guardian, self.odometry,
            self._manual_control, lambda: self._stopped_by)

    def request(self, elsewhere: bool = False) -> DriveRequest:
        """
        Request a drive; a stop ends it from now on, whatever it waits for.

        :param elsewhere: whether another thread will drive
        :returns: the request, for ``drive``
        :raises ControlError: if another drive is under way, no motion may start again, or this is
            a thread that must not drive
        """
        if self._stopped_by is not None:
            raise type(self._stopped_by)(
                f'{self._stopped_by}: only a new node moves the robot again') from None
        self._require_not_stopped()
        if not elsewhere and self._executor.is_executor_thread():
            raise MotionRefusedError(
                'a motion cannot run in a callback of its own node: it would wait for callbacks '
                'that wait for it. Start it in a thread, or from the main program')
        return self._requests.accept()

    def drive(self, order: DriveOrder, request: DriveRequest | None = None) -> Plan:
        """
        Plan and drive a motion, and leave the robot at rest.

        :param order: the motion, and what it is planned with
        :param request: what ``request`` returned before, in another thread; None for a new one
        :returns: the plan, which was driven to its end
        :raises InvalidMotionError: if the robot cannot do it; nothing has moved
        :raises ControlError: if the robot cannot be taken or the run could not go on
        """
        request = request or self.request()
        is_complete = False
        try:
            plan = order.plan()
            self.robot_drive.request(order.motion.name, plan)
            self._publish(MotionPlanned(
                order.motion, order.limits, order.rate, time.monotonic()))
            try:
                self._prepare(order, plan, request)
                with old_objects_frozen():
                    run = self.robot_drive.begin(
                        TickScheduler(plan), time.monotonic(), plan.period, request.run,
                        self._monitor.pause_pose.newest)
                    self._loop.run([self.robot_drive])
                self._guardian.report_stopping()
                self._stopper.stop_after_idle(run, within=plan.period)
            except BaseException as error:
                # KeyboardInterrupt and SystemExit as well: no way out leaves the robot moving.
                ended = self._end_early(error)
                if ended is error:
                    raise
                raise ended from error
            self.robot_drive.finish()
            self._publish(MotionEnded(time.monotonic()))
            is_complete = True
        finally:
            self._requests.finish(request, is_complete)
        return plan

    def _prepare(self, order: DriveOrder, plan: Plan, request: DriveRequest) -> None:
        """Take the robot, and have everything ready for a run."""
        self._request, self._has_reported = request, False
        self._take()
        feedback = None if order.corrected is None else (
            self._begin_feedback(plan, order.corrected))
        # Not before: the stop of the movement before must not wait until the robot is taken.
        self._stopper.cancel_pending()
        self._monitor.begin(feedback)
        if self.speed_factor.is_hold:
            self._node.get_logger().warning(
                f'The motion is held at its start ({self.speed_factor.describe()}): resume to '
                'go on')
        elif self.speed_factor.value < 1.0:
            self._node.get_logger().info(
                f'Slower than planned: {self.speed_factor.describe()}')

    def _end_early(self, error: BaseException) -> BaseException:
        """Stop the robot after an error in a drive, and return the error to raise."""
        self._is_connected = False
        # A failure of this stop is not logged: the error itself is raised.
        self._stopper.stop(control_error(error))
        if isinstance(error, PauseTimeoutError):
            self._release_manual_control()
        if self._guardian.stopped_because is not None:
            error = RunFaultError(
                f'the guardian stopped the robot: {self._guardian.stopped_because}')
        text = _text(error)
        self.robot_drive.finish(text)
        self._publish(MotionEnded(time.monotonic(), text, is_fault=not isinstance(
            error, (MotionRefusedError, KeyboardInterrupt))))
        return error

    def stop(self, caller: str) -> str:
        """
        Stop the robot, and return when that is done; nothing is sent if it never moved.

        :param caller: who ends a drive in another thread, running or waiting
        :returns: what it did
        :raises RunFaultError: if the stop could not be sent, or odometry still sees the robot move
        """
        reason = MotionStoppedError(f'the movement was ended by {caller}')
        was_stopped = self._stopper.is_stopped
        self._requests.on_stop(reason)
        failure = self._stopper.stop(reason) or self._unconfirmed()
        if failure is not None:
            # After a signal the program ends by that, whatever is raised: nobody prints an error.
            if self._stopped_by is None:
                self._has_reported = True
            else:
                self._log_once(failure)
            raise RunFaultError(failure)
        if self.gate.state is GateState.NOT_OPENED:
            return 'nothing was sent: this node has not taken a robot'
        run = self.gate.run
        if self._logged_stop_of is not run:
            self._logged_stop_of = run
            self._node.get_logger().info('Robot has stopped')
        return ('nothing was sent: the robot had been stopped before' if was_stopped
                else 'the robot was stopped')

    def stop_permanently(self, reason: ControlError) -> None:
        """
        Stop the robot, and refuse every later motion.

        :param reason: what later motions are refused with
        """
        self._stopped_by = self._stopped_by or reason
        self._stopped.set()
        self._guardian.latch.trip()
        self._stop(reason)

    def _log_once(self, failure: str) -> None:
        """Log what went wrong with a stop, unless an error has said so; from any thread."""
        with self._logging:
            has_reported, self._has_reported = self._has_reported, True
        if not has_reported:
            self._node.get_logger().error(failure)

    def on_odometry(
            self, now: float, pose: Pose, velocity: Velocity, is_new: bool = True) -> None:
        """
        Take note of where the robot is.

        :param now: when it arrived [s on the steady clock]
        :param is_new: whether it is stamped later than the message before
        """
        self.odometry.on_odometry(now, velocity)
        if self._feedback is not None and is_new:
            self._feedback.on_odometry(now, pose, is_moving=self.odometry.is_moving(now))
        self._monitor.pause_pose.on_odometry(now, pose, velocity)

    def check_resume(self, even_if_moved: bool) -> None:
        """
        Check whether a run that is held may go on; without a run there is nothing to check.

        :param even_if_moved: whether to go on from where somebody moved the robot to
        :raises ControlError: if it may not
        """
        self._require_not_stopped()
        if not self._requests.is_busy or not self._is_connected:
            return
        self._monitor.check_resume()
        if even_if_moved:
            self._monitor.pause_pose.accept()
        else:
            self._monitor.pause_pose.require_not_moved()

    def close(self) -> None:
        """Stop the robot, release it and end the executor; nothing is sent afterwards."""
        with self._closing:
            if not self._is_closed:
                self.stop_permanently(MotionRefusedError('the node is closed'))
                self.gate.close()
                # The guardian's publisher must be gone as well before the robot is released.
                self._guardian.shutdown()
                self._release_manual_control()
                self._is_closed = True
                self._claim.release()
            self._executor.stop()

    def serve_until_stopped(self) -> None:
        """
        Serve the node's callbacks in the background until no motion may start again.

        :raises ControlError: the reason
        """
        self._executor.ensure_spinning()
        # Not served in this thread: a signal that interrupts rclpy while it makes a message for a
        # callback appears as a TypeError, and leaves the node's callbacks blocked.
        self._stopped.wait()
        self._require_not_stopped()

    def require_robot(self, participant: Callable[[], bytes | None]) -> None:
        """
        Accept no other robot than the one that the command has started.

        :param participant: returns its DDS participant; None until it is known
        """
        self._discovery.require_participant(participant)

    @property
    def guardian_file(self) -> int | None:
        """Return a descriptor of what is shared with the guardian; None without one."""
        return self._guardian.shared_file

    @property
    def is_driving(self) -> bool:
        """Whether a motion is under way, or waits for the robot."""
        return self._requests.is_busy

    @property
    def has_subscriber(self) -> bool:
        """Whether the publishers of this node and of its guardian have a subscriber."""
        return self._discovery.is_subscribed and self._guardian.is_matched

    @property
    def stop_confirmed_after(self) -> float | None:
        """Time from the start of the last stop until odometry showed standstill [s], or None."""
        started, still = self._stopper.stop_started, self.odometry.still_since(time.monotonic())
        return None if started is None or still is None else max(0.0, still - started)

    def _take(self) -> None:
        """Connect with the robot and enable manual control, unless that is still so."""
        self._require_not_stopped()
        self._executor.ensure_spinning()
        self._claim.require()
        if not (self._is_connected and self._discovery.is_subscribed):
            self._connect()
        elif self._manual_control.is_needed and self._lease.is_stale(time.monotonic()):
            self._enable_manual_control()

    def _connect(self) -> None:
        timeout = self._parameters.robot_timeout
        self._discovery.wait_for_robot(timeout, self._require_wanted)
        # The claim comes before any message and any request.
        self._claim.take(self._require_wanted)
        try:
            self._foreign.require_none(self._require_wanted)
            if not self._parameters.allow_other_publishers:
                self._require_at_rest()
        except BaseException:
            self._claim.withdraw()
            raise
        self._claim.hold()
        if self._manual_control.is_needed:
            self._enable_manual_control()
        self._discovery.wait_for_guardian(timeout, self._require_wanted)
        self.gate.open()
        self._prime()
        self._discovery.remember_robot()
        self._is_connected = True
        if self._odometry_topic is not None and self.odometry.age(time.monotonic()) is None:
            self._node.get_logger().warning(
                f'No odometry has come on {self._odometry_topic} yet: until some does, a robot '
                'that is lost is noticed only when its subscription goes, which may take 20 s')

    def _require_at_rest(self) -> None:
        """
        Check that odometry, as far as it is received, sees no motion: nothing of ours moves yet.

        Discovery may find another program's publisher seconds later than its robot.

        :raises RobotTakenError: if it sees motion for REST_TIMEOUT
        """
        topic, began = self._odometry_topic, time.monotonic()
        if topic is None:
            return

        def is_at_rest_or_unknown() -> bool:
            now = time.monotonic()
            if self.odometry.age(now) is None:
                # Its odometry is discovered a moment later than its subscription.
                return not self._node.count_publishers(topic) and now - began > ODOMETRY_WAIT_TIME
            return not self.odometry.is_moving(now)

        wait_until(is_at_rest_or_unknown, REST_TIMEOUT, self._require_wanted)
        if self.odometry.is_moving(time.monotonic()):
            raise RobotTakenError(
                f'{topic} sees the robot move already: another program drives it, '
                'or somebody pushes it; nothing was sent. Stop that, or set the parameter '
                'allow_other_publishers to true')

    def _enable_manual_control(self) -> None:
        requested = time.monotonic()
        self._manual_control.enable(self._parameters.robot_timeout)
        self._lease.granted(requested)

    def _begin_feedback(self, plan: Plan, limits: Limits) -> PoseFeedback:
        """Wait until odometry shows the robot at rest, and begin to correct a plan by it."""
        assert self._feedback is not None
        feedback = self._feedback

        def is_at_rest() -> bool:
            self._require_wanted()
            now = time.monotonic()
            # A stamp that stands still is new once.
            return (feedback.sample_count > 1 and feedback.age(now) <= FEEDBACK_MAX_AGE
                    and self.odometry.still_since(now) is not None)

        if not wait_until(is_at_rest, FEEDBACK_START_TIMEOUT):
            now = time.monotonic()
            topic = f'odometry on {self._feedback_topic}'
            if self.odometry.is_moving(now):
                raise MotionRefusedError(
                    f'a closed loop begins at rest, and {topic} sees the robot move')
            if self.odometry.still_since(now) is not None:
                raise MotionRefusedError(
                    f'a closed loop needs odometry that goes on, and the stamps of {topic} do not')
            raise MotionRefusedError(
                f'a closed loop needs {topic}, and within {FEEDBACK_START_TIMEOUT:g} s none has '
                'come')
        feedback.begin(plan, limits)
        return feedback

    def _prime(self) -> None:
        """Send zeros for ``prime_time``: a reader matches later than its writer."""
        end, count = time.monotonic() + self._parameters.prime_time, self._guardian.prime_count
        while time.monotonic() < end:
            self._require_wanted()
            self.gate.send_zero(self.gate.run, VelocityKind.PRIME)
            self._publisher.sent.record_guardian_zero(time.monotonic())
            self._guardian.prime()
            count += 1
            time.sleep(STOP_REPEAT_PERIOD)
        # A late zero of the guardian would fall into the motion.
        if not wait_until(lambda: self._guardian.prime_count >= count, GUARDIAN_PRIME_TIMEOUT):
            raise RunFaultError(f'the guardian did not answer within {GUARDIAN_PRIME_TIMEOUT:g} s')

    def _release_manual_control(self) -> None:
        wanted = self._parameters.release_manual_control and self._manual_control.was_requested
        if not (wanted and self._node.context.ok()):
            return
        self._executor.ensure_spinning(take_over=True)
        # Another program may drive the robot by now, under manual control.
        if self._foreign.has_recent(time.monotonic()) or self._foreign.detect():
            return
        if not self._manual_control.release(RELEASE_TIMEOUT):
            self._node.get_logger().warning(
                f'The robot did not confirm within {RELEASE_TIMEOUT:g} s that manual control is '
                'off; it goes off by itself')

    def _is_still_moving(self) -> bool:
        """Return whether more zeros are needed: the robot moves, or its odometry is lost."""
        now = time.monotonic()
        # A dead link keeps messages in the kernel for 3 s, velocities included.  They must be gone
        # before our publisher is: a reader drops the zeros that follow them with the publisher.
        needed = self.odometry.is_moving(now) or self._monitor.has_lost_robot(now)
        return needed and not self._foreign.has_recent(now)

    def _stop(self, reason: ControlError) -> None:
        """Stop the robot, and log what went wrong with that."""
        if (failure := self._stopper.stop(reason) or self._unconfirmed()) is not None:
            self._log_once(failure)

    def _unconfirmed(self) -> str | None:
        """Return an error text if odometry shows motion after a stop; None otherwise."""
        now = time.monotonic()
        # Another robot's motion, or one that another program drives, is no failure of ours.
        is_ours = self.gate.state is GateState.OPEN and not self._foreign.has_recent(now)
        if is_ours and self.odometry.is_moving(now):
            return ('the stop is unconfirmed: zeros were sent, and odometry still sees the robot '
                    'move')
        return None

    def _require_wanted(self) -> None:
        """Raise the reason if the drive that waits for the robot was stopped."""
        self._require_not_stopped()
        if self._request is not None and self._request.run.ended_by is not None:
            raise self._request.run.ended_by

    def _require_not_stopped(self) -> None:
        if self._stopped_by is not None:
            raise self._stopped_by
        if self._guardian.stopped_because is not None:
            # Its latch blocks all motion of this program.
            raise RunFaultError(
                'nothing moves until this program is started again, for the guardian stopped the '
                f'robot: {self._guardian.stopped_because}')

    def _on_foreign_message(self, sender: str) -> None:
        if self.gate.state is GateState.NOT_OPENED:
            # Its publisher was found while we waited for something else.
            self._end_run(self._foreign.taken(sender))
            return
        self._end_run(RunFaultError(
            f'{sender} sends velocities on {self._publisher.topic_name}, so the motion was given '
            'up; stop that program, or set the parameter allow_other_publishers to true'))

    def _on_conflict(self, holder: str) -> None:
        self._end_run(RunFaultError(
            f'another program drives the robot as well: {holder}; both stop'))

    def _end_run(self, reason: ControlError) -> None:
        """End the run at once, with one zero; the thread that drives sends the whole stop."""
        # Without a drive nothing of ours moves, and another program is not to be disturbed.
        if not self._requests.is_busy:
            return
        self.robot_drive.end(reason)

    def _on_callback_error(self, error: BaseException) -> None:
        self.stop_permanently(
            RunFaultError(f'a callback failed: {type(error).__name__}: {escaped(error)}'))


def _text(error: BaseException) -> str:
    """Return why a drive ended, as it is shown and logged."""
    if signal_dispatcher.signum is not None:
        return f'stopped by {signal.Signals(signal_dispatcher.signum).name}'
    return str(error) or type(error).__name__


def _start_guardian(
        node: Node, publisher: VelocityPublisher, profile: RobotProfile,
        parameters: NodeParameters, claim: int) -> Guardian | NullGuardian:
    """
    Start the guardian of a publisher, if the parameters want one.

    :param claim: a descriptor that it keeps open as long as it runs: the claim on the robot
    """
    if not parameters.guardian:
        return NullGuardian()
    arguments = [
        publisher.topic_name, node.context.get_domain_id(), profile.command_timeout,
        profile.message_type, profile.frame]
    return Guardian(
        [*processes.python_command('kachaka_simple_control.ros.guardian_program'),
         *map(str, arguments)],
        processes.child_environment(), claim)
