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
"""One node's hold of a robot: met, driven, stopped, given back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import threading
import time

from kachaka_simple_control.control import processes
from kachaka_simple_control.control.drive_requests import DriveRequest, DriveRequests
from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.manual_control_lease import LeaseRenewer
from kachaka_simple_control.control.plan_runner import run_plan
from kachaka_simple_control.control.stop import StandstillDetector, StopController
from kachaka_simple_control.control.timing import (
    GUARDIAN_PRIME_TIMEOUT,
    RELEASE_TIMEOUT,
    STOP_REPEAT_PERIOD,
)
from kachaka_simple_control.control.velocity_gate import GateState, VelocityGate
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.errors import ControlError, MotionRefusedError, RunFaultError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros.executors import BackgroundExecutor
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.names import RobotNames
from kachaka_simple_control.ros.parameters import NodeParameters
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery
from kachaka_simple_control.ros.run_monitor import RosRunMonitor
from kachaka_simple_control.ros.session_status import StatusReader
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.node import Node


class Session:
    """
    Everything between a plan and a robot; every way out of it stops the robot.

    Runs are driven in the thread that asks for them, one at a time.  ``stop``,
    ``stop_permanently`` and ``close`` may be called from any thread.
    """

    def __init__(
            self, node: Node, publisher: VelocityPublisher, profile: RobotProfile,
            names: RobotNames, settings: NodeParameters) -> None:
        """
        Make a session with a robot that has not been met.

        :param node: the node that publishes
        :param publisher: its publisher of velocities, which belongs to the edge from now on
        :param profile: the kind of robot
        :param names: where this one is found
        :param settings: how to treat it
        """
        self._node = node
        self._hold = profile.hold
        #: where odometry should come from; None if nobody waits for it
        self._odometry_topic = names.odometry if settings.odometry_timeout else None
        self._settings = settings
        #: what odometry tells of the robot's velocity
        self.odometry = StandstillDetector()
        self._claim = RobotClaim(node, publisher.topic_name, 'driver', self._rival_found)
        self._publisher = publisher
        self._guardian = start_guardian(node, publisher, profile, settings, self._claim.fileno())
        self.gate = VelocityGate(
            publisher.transmit, profile.limits, self._guardian.latch, self._guardian.sending)
        self._manual_control = ManualControlClient(
            node, names.manual_control, self._require_wanted, profile.manual_control_timeout)
        self._link = RobotDiscovery(
            node, names, publisher, self._manual_control, self._guardian)
        self._foreign = ForeignMessages(
            node, publisher,
            list if settings.allow_other_publishers else self._link.other_publishers,
            # Who halts this node sets the latch, too; the guardian is silent then.
            lambda: self._guardian.latch.is_set and self._halted_by is None, self._foreign_heard)
        self._stopper = StopController(self.gate, profile.hold, self._guardian, self._still_moves)
        self._renewal = LeaseRenewer(
            lambda: self._manual_control.request(True),
            response_timeout=profile.hold - 1.0 / settings.rate)
        self._attendant = RosRunMonitor(
            self._guardian, self._renewal, self._link, self._foreign, self.odometry,
            settings.odometry_timeout, self._manual_control.is_needed)
        self._spinner = BackgroundExecutor(node, self._callback_failed)
        self._requests = DriveRequests(self.gate, 1.0 / settings.rate)
        self._request: DriveRequest | None = None
        self._closing = threading.Lock()
        self._halted_by: ControlError | None = None
        self._halted = threading.Event()
        self._is_met = False
        self._is_given_back = False
        #: whether somebody was told that the last stop could not be confirmed
        self._is_told = False
        #: how it stands with the robot, for those who show it
        self.status_reader = StatusReader(
            self.gate, self._link, self._guardian, self.odometry, self._manual_control,
            lambda: self._halted_by)

    def request(self, elsewhere: bool = False) -> DriveRequest:
        """
        Ask for a drive; a stop ends it from now on, whatever it waits for.

        :param elsewhere: whether another thread will drive
        :returns: the request, for ``exclusive`` and ``drive``
        :raises ControlError: if another drive is under way, nothing may move any more, or this is
            no thread to drive in
        """
        self._require_not_halted()
        if not elsewhere:
            self._require_other_thread()
        return self._requests.accept()

    @contextlib.contextmanager
    def exclusive(self, request: DriveRequest) -> Iterator[None]:
        """
        Have the robot to oneself for the drive that was asked for.

        :param request: what ``request`` returned; it is over at the end of the block
        :returns: a context manager, in which ``drive`` may be called
        """
        is_whole = False
        try:
            yield
            is_whole = True
        finally:
            self._requests.finish(request, is_whole)

    def drive(self, plan: Plan, request: DriveRequest) -> None:
        """
        Drive a plan, and leave the robot at rest; to be called while serving a request.

        :param plan: what to drive
        :param request: the request
        :raises ControlError: if the robot cannot be taken or the run could not go on
        """
        self._request, self._is_told = request, False
        try:
            self._take()
            # Only now: until the robot is taken, the stop of the movement before must not wait.
            self._stopper.cancel_pending()
            run = run_plan(plan, self.gate, self._hold, self._attendant, prepared=request.run)
            self._guardian.report_stopping()
            self._stopper.stop_after_idle(run, within=plan.period)
        except BaseException as error:
            # KeyboardInterrupt and SystemExit too: whoever leaves here leaves a robot at rest.
            self._is_met = False
            self._stop(_reason(error))
            self._require_no_intervention()
            raise

    def stop(self, reason: ControlError) -> bool:
        """
        Stop the robot, and return when that is done; nothing is sent if it never moved.

        :param reason: what a motion under way, or about to begin, in another thread is told
        :returns: whether there was anything to stop: not before the robot was taken
        :raises RunFaultError: if the stop could not be sent, or odometry still sees the robot move
        """
        self._requests.note_stop(reason)
        if (failure := self._stop(reason)) is not None:
            self._is_told = True
            raise RunFaultError(failure)
        return self.gate.state is not GateState.NOT_OPENED

    def stop_permanently(self, reason: ControlError) -> None:
        """
        Stop the robot, and never move it again.

        :param reason: what every later motion is refused with
        """
        self._halted_by = self._halted_by or reason
        self._halted.set()
        self._guardian.latch.trip()
        if (failure := self._stop(reason)) is not None and not self._is_told:
            self._is_told = True
            self._node.get_logger().error(failure)

    def close(self) -> None:
        """Stop the robot, give it back, and serve callbacks no more; nothing is sent after."""
        with self._closing:
            if not self._is_given_back:
                self.stop_permanently(MotionRefusedError('the node is closed'))
                self.gate.close()
                # Its publisher must be gone, too, before the robot is given back.
                self._guardian.shutdown()
                self._give_back()
                self._is_given_back = True
                self._claim.release()
            self._spinner.stop()

    def serve_until_halted(self) -> None:
        """
        Serve the node's callbacks in the background, and wait until nothing may move any more.

        :raises ControlError: why that is so
        """
        self._spinner.ensure_spinning()
        # Not served here: a signal that interrupts the main thread while rclpy makes a message
        # for a callback comes out of it as a TypeError, and leaves the node's callbacks blocked.
        self._halted.wait()
        self._require_not_halted()

    def require_robot(self, brought: Callable[[], bytes | None]) -> None:
        """
        Meet no other robot than one that was brought along.

        :param brought: returns its participant; None as long as it is not known
        """
        self._link.require_participant(brought)

    @property
    def has_subscriber(self) -> bool:
        """Whether somebody subscribes to what this node and its guardian publish."""
        return self._link.is_subscribed and self._guardian.is_matched

    @property
    def stop_confirmed_after(self) -> float | None:
        """Return how long after the last stop began odometry saw the robot still [s]."""
        begun, still = self._stopper.stop_started, self.odometry.still_since(time.monotonic())
        return None if begun is None or still is None else max(0.0, still - begun)

    def _take(self) -> None:
        """Meet the robot and switch its manual control on; at once if that was done already."""
        self._require_not_halted()
        self._spinner.ensure_spinning()
        self._claim.require()
        if not (self._is_met and self._link.is_subscribed):
            self._meet()
        elif self._manual_control.is_needed and self._renewal.is_stale(time.monotonic()):
            self._switch_manual_control_on()

    def _meet(self) -> None:
        self._link.wait(self._settings.robot_timeout, self._require_wanted)
        # Nothing may have been published or asked for before this is settled.
        self._claim.take(self._require_wanted)
        try:
            self._foreign.require_silence(self._require_wanted)
        except BaseException:
            self._claim.withdraw()
            raise
        self._claim.hold()
        if self._manual_control.is_needed:
            self._switch_manual_control_on()
        self._link.wait_for_guardian(self._settings.robot_timeout, self._require_wanted)
        self.gate.open()
        self._prime()
        self._attendant.on_connected()
        self._is_met = True
        if self._odometry_topic is not None and self.odometry.age(time.monotonic()) is None:
            self._node.get_logger().warning(
                f'No odometry has come on {self._odometry_topic} yet: until some does, a robot '
                'that is lost is noticed only when its subscription goes, which may take 20 s')

    def _switch_manual_control_on(self) -> None:
        asked = time.monotonic()
        self._manual_control.enable(self._settings.robot_timeout)
        self._renewal.granted(asked)

    def _prime(self) -> None:
        """Send zeros for a while: a reader matches later than its writer sees it."""
        end, wanted = time.monotonic() + self._settings.prime_time, self._guardian.prime_count
        while time.monotonic() < end:
            self._require_wanted()
            self.gate.send_zero(after=self.gate.run)
            self._publisher.sent.note_guardian(time.monotonic())
            self._guardian.prime()
            wanted += 1
            time.sleep(STOP_REPEAT_PERIOD)
        # A zero of the guardian that came late would fall into the motion.
        if not wait_until(lambda: self._guardian.prime_count >= wanted, GUARDIAN_PRIME_TIMEOUT):
            raise RunFaultError(f'the guardian did not answer within {GUARDIAN_PRIME_TIMEOUT:g} s')

    def _give_back(self) -> None:
        wanted = self._settings.release_manual_control and self._manual_control.was_requested
        if not (wanted and self._node.context.ok()):
            return
        self._spinner.ensure_spinning(take_over=True)
        # Somebody else may drive the robot by now, under manual control.
        if self._foreign.is_heard(time.monotonic()) or self._foreign.listen():
            return
        if not self._manual_control.release(RELEASE_TIMEOUT):
            self._node.get_logger().warning(
                f'The robot did not confirm within {RELEASE_TIMEOUT:g} s that manual control is '
                'off; it '
                'goes off by itself')

    def _still_moves(self) -> bool:
        """Tell whether zeros are still wanted: the robot is seen to move, or not seen any more."""
        now = time.monotonic()
        # What a dead link has not delivered waits in the kernel for 3 s, velocities too.  They
        # must have gone before our publisher does: with it, a reader drops the zeros after them.
        wanted = self.odometry.is_moving(now) or self._attendant.has_lost_robot(now)
        return wanted and not self._foreign.is_heard(now)

    def _stop(self, reason: ControlError) -> str | None:
        """Stop the robot, and return what went wrong, if anything did."""
        try:
            self._stopper.stop(reason)
        except Exception as error:  # the context is gone: nobody can publish any more
            return f'the stop could not be sent: {error}'
        now = time.monotonic()
        # It may well move if it is not ours, or somebody else drives it by now.
        is_ours = self.gate.state is GateState.OPEN and not self._foreign.is_heard(now)
        if is_ours and self.odometry.is_moving(now):
            return ('the stop is unconfirmed: zeros were sent, and odometry still sees the robot '
                    'move')
        return None

    def _require_wanted(self) -> None:
        """Raise what ended the drive that waits for the robot, if anything did."""
        self._require_not_halted()
        if self._request is not None and self._request.run.ended_by is not None:
            raise self._request.run.ended_by

    def _require_not_halted(self) -> None:
        if self._halted_by is not None:
            raise self._halted_by

    def _require_no_intervention(self) -> None:
        if self._guardian.stopped_because is not None:
            raise RunFaultError(
                f'the guardian stopped the robot: {self._guardian.stopped_because}')

    def _require_other_thread(self) -> None:
        if self._spinner.is_executor_thread():
            raise MotionRefusedError(
                'a motion cannot run in a callback of its own node: it would wait for callbacks '
                'that wait for it. Start it in a thread, or from the main program')

    def _foreign_heard(self, sender: str) -> None:
        """End the run at once; the thread that drives sends the stop."""
        self._end_run(RunFaultError(
            f'{sender} sends velocities on {self._publisher.topic_name}, so the motion was given '
            'up; stop that program, or set the parameter allow_other_publishers to true'))

    def _rival_found(self, rival: str) -> None:
        self._end_run(RunFaultError(
            f'another program drives the robot as well: {rival}; both stop'))

    def _end_run(self, reason: ControlError) -> None:
        # Without a drive nothing of ours moves, and whoever drives is not to be fought.
        if not self._requests.is_busy:
            return
        run = self.gate.cancel(reason)
        if run is not None and run.ended_by is reason:
            self.gate.send_zero(after=run)

    def _callback_failed(self, error: BaseException) -> None:
        self.stop_permanently(
            RunFaultError(f'a callback failed: {type(error).__name__}: {escaped(error)}'))


def _reason(error: BaseException) -> ControlError:
    if isinstance(error, ControlError):
        return error
    return MotionRefusedError(f'the motion was ended by {error!r}')


def start_guardian(
        node: Node, publisher: VelocityPublisher, profile: RobotProfile, settings: NodeParameters,
        claim: int) -> Guardian | NullGuardian:
    """
    Start a guardian for a publisher, unless none is wanted.

    :param node: the node that publishes
    :param publisher: the publisher of velocities; the guardian's is of the same kind
    :param profile: the kind of robot
    :param settings: whether a guardian is wanted
    :param claim: a descriptor that it keeps open as long as it is there: the claim on the robot
    :returns: the guardian, or what stands in for it
    """
    if not settings.guardian:
        return NullGuardian()
    arguments = [
        publisher.topic_name, node.context.get_domain_id(), profile.hold, profile.message_type,
        profile.frame]
    return Guardian(
        [*processes.python_command('kachaka_simple_control.ros.guardian_process'),
        *map(str, arguments)],
        processes.child_environment(), claim)
