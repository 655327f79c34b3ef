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
The door to the robots of a node: drive, stop, pause, resume and slow down.

Tested by test/ros/test_commander.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import threading
import time

from kachaka_simple_control import errors
from kachaka_simple_control.control.drive_requests import (
    DriveRequest,
    DriveRequests,
    ResumeConfirmation,
)
from kachaka_simple_control.control.events import MotionPlanned
from kachaka_simple_control.control.robot_drive import RunProgress
from kachaka_simple_control.control.speed_factor import MOVED, OVERRIDE, PAUSE
from kachaka_simple_control.control.tick_scheduler import TickScheduler, VelocitySource
from kachaka_simple_control.control.timing import RESUME_CONFIRM_TIMEOUT, RESUME_QUIET_TIME
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros.drive import Drive, RobotTask
from kachaka_simple_control.ros.hub import Hub
from kachaka_simple_control.ros.robot import Robot
from kachaka_simple_control.text import escaped
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter

#: The writable parameter: the speed factor that the user sets.
PARAMETER = 'speed_factor'


class Commander:
    """
    Drives the robot of a node, and stops, pauses, resumes and slows it down.

    Python code, services, keys, pipe and console call the methods, from any thread.  A refused
    request raises an error; the text that most methods return tells the user what was done.
    """

    def __init__(self, hub: Hub, robot: Robot) -> None:
        self._hub, self._robot = hub, robot
        self._logger = hub.node.get_logger()
        hub.on_error = self._on_callback_error
        self._requests = DriveRequests([robot.gate])
        self._factor = robot.speed_factor
        #: how often somebody has paused or set the speed so far
        self.changes = 0
        # Reentrant: to set the parameter calls back in the same thread.
        self._changing = threading.RLock()
        self._confirmation = ResumeConfirmation()
        self._closing = threading.Lock()
        self._is_closed = False

    @property
    def state(self) -> RunProgress:
        """Return the progress of the newest motion: how far it has come and whether it is over."""
        return self._robot.drive.progress

    @property
    def is_driving(self) -> bool:
        """Whether a drive was requested and is not over; it may still wait for the robot."""
        return self._requests.is_busy

    @property
    def is_stopped_permanently(self) -> bool:
        """Whether a signal or the guardian has stopped the robot, so that no motion may start."""
        return (self._hub.stopped_by is not None
                or self._robot.guardian.stopped_because is not None)

    def request(self, elsewhere: bool = False) -> DriveRequest:
        """
        Request a drive, so that a stop ends it even before ``drive`` runs.

        :param elsewhere: whether another thread will call ``drive``
        :raises ControlError: if another drive is under way, no motion may start any more, or the
            calling thread is the only one for callbacks of the node, and so cannot drive
        """
        if (reason := self._hub.stopped_by) is not None:
            raise type(reason)(f'{reason}: only a new node moves the robot again') from None
        self._robot.require_not_stopped()
        if not elsewhere and self._hub.executor.is_executor_thread():
            raise errors.MotionRefusedError(
                'a motion cannot run in a callback of its own node: it would wait for callbacks '
                'that wait for it. Start it in a thread, or from the main program, or let a '
                'MultiThreadedExecutor run the node')
        self._robot.request = request = self._requests.accept()
        return request

    def drive(self, order: DriveOrder, request: DriveRequest | None = None) -> Plan:
        """
        Plan a motion, drive the robot through it, and leave the robot at rest; return the plan.

        :raises InvalidMotionError: if the robot cannot do the motion; the robot has not moved then
        :raises ControlError: if there is no control of the robot, or the drive ended early
        """
        with self._accepted(request) as accepted:
            plan = order.plan
            self._robot.drive.request(order.motion.name, plan)
            self._hub.publish(MotionPlanned(
                order.motion, order.limits, order.rate, time.monotonic(), plan))
            self._run(accepted, RobotTask(
                self._robot, TickScheduler(plan), plan.period, order.corrected))
        return plan

    def drive_source(
            self, title: str, source: VelocitySource, period: float,
            request: DriveRequest | None = None) -> None:
        """
        Send the velocities of a source until it has no more, and leave the robot at rest.

        :param period: the normal time between two velocities [s]
        :raises ControlError: if there is no control of the robot, or the drive ended early
        """
        with self._accepted(request) as accepted:
            self._robot.drive.request(title)
            self._run(accepted, RobotTask(self._robot, source, period))

    def start(self, drive: Callable[[DriveRequest], object]) -> str:
        """
        Start a thread that drives the robot; from now on a stop ends the drive.

        :raises ControlError: if the robot may not drive now, for example because it does already
        """
        request = self.request(elsewhere=True)

        def run() -> None:
            try:
                drive(request)
            except errors.MotionStoppedError as error:
                self._logger.info(str(error))
            except errors.ControlError as error:
                self._logger.error(str(error))

        # A drive in a callback would wait for other callbacks, which wait for this one.
        threading.Thread(target=run, name='drive', daemon=True).start()
        return 'started'

    def stop(self, caller: str) -> str:
        """
        Stop the robot, and wait until the stop is complete; return a text for the user.

        A drive ends with an error, even before the robot moves.  Nothing is sent to a robot of
        which this node has no control, or that is stopped already.

        :param caller: who stops the robot, for the error that ends the drive
        :raises RunFaultError: if the stop could not be sent, or the robot still moves by odometry
        """
        reason = errors.MotionStoppedError(f'the movement was ended by {caller}')
        self._requests.on_stop(reason)
        return self._robot.stop_for_user(reason)

    def stop_permanently(self, reason: errors.ControlError) -> None:
        """Stop the robot for good: each later motion raises the first reason given."""
        self._hub.stop_permanently(reason)
        self._robot.guardian.latch.trip()
        self._robot.stop_or_log(reason)

    def _on_callback_error(self, error: BaseException) -> None:
        """Stop the robot for good after an error in a callback of the node."""
        self.stop_permanently(errors.RunFaultError(
            f'a callback failed: {type(error).__name__}: {escaped(error)}'))

    def close(self) -> None:
        """Stop and release the robot, and refuse later motions."""
        with self._closing:
            if not self._is_closed:
                self.stop_permanently(errors.MotionRefusedError(errors.ENDED))
                self._robot.close()
                self._is_closed = True
            self._hub.close()

    def serve_until_stopped(self) -> None:
        """Run callbacks in a background thread until ``stop_permanently``; raise its reason."""
        self._hub.serve_until_stopped()
        self._robot.require_not_stopped()

    def pause(self) -> str:
        """
        Bring the robot to rest within its limits, and keep it there until ``resume`` is called.

        If no motion is under way, the next one is paused before the robot moves.

        :raises ControlError: if no motion may start any more, so that there is none to pause
        """
        self._robot.require_not_stopped()
        with self._changing:
            self.changes += 1
            is_new = self._factor.set(PAUSE, 0.0)
        if not is_new:
            return 'it was paused before'
        self._logger.info('Paused: resume to go on')
        return 'paused' if self.is_driving else 'paused: the next motion is held at its start'

    def resume(self, even_if_moved: bool = False) -> str:
        """
        Continue a paused motion.

        :param even_if_moved: whether to continue from where the robot stands now if somebody moved
            it during the pause
        :raises ControlError: if no motion may start now, or the robot was moved
        """
        self._robot.require_not_stopped()
        if self.is_driving:
            self._robot.check_resume(even_if_moved)
        was_held = [self._factor.set(name, 1.0) for name in (PAUSE, MOVED)]
        if any(was_held):
            self._logger.info('Resumed')
        if self._factor.is_hold:
            return f'another holds the robot: {self._factor.describe()}'
        return 'resumed' if any(was_held) else 'nothing was paused'

    def resume_when_confirmed(self) -> str:
        """
        Continue a paused motion; if the robot was moved meanwhile, only at a second call.

        :raises RobotMovedError: if it was moved, unless the call before raised this 1 s to 10 s
            ago
        :raises ControlError: if no motion may start now
        """
        try:
            return self.resume(even_if_moved=self._confirmation.on_request())
        except errors.RobotMovedError as error:
            self._confirmation.on_warning()
            raise errors.RobotMovedError(
                f'{error}. To go on all the same, resume once more, {RESUME_QUIET_TIME:g} to '
                f'{RESUME_CONFIRM_TIMEOUT:g} s from now') from None

    def change_speed(self, step: float) -> None:
        """Change the ROS parameter ``speed_factor`` by a step, between one step and 1."""
        factor = self._factor.factors.get(OVERRIDE, 1.0)
        self.set_speed(min(1.0, max(abs(step), round(factor + step, 2))))

    def set_speed(self, factor: float) -> None:
        """
        Set the ROS parameter ``speed_factor``, from 0.01 to 1.

        :raises ControlError: if the value is out of range, or no motion may start any more
        """
        self._robot.require_not_stopped()
        try:
            result = self._hub.node.set_parameters([Parameter(PARAMETER, value=factor)])[0]
        except rclpy_implementation.InvalidHandle:  # the node was destroyed just now
            raise errors.MotionRefusedError(errors.ENDED) from None
        if not result.successful:
            raise errors.MotionRefusedError(result.reason)

    def on_speed_set(self, factor: float) -> None:
        """Apply the ROS parameter ``speed_factor``, which somebody has set."""
        with self._changing:
            self.changes += 1
            self._factor.set(OVERRIDE, factor)

    def begin_anew(self, changes: int, factor: float) -> None:
        """
        End any pause, and set the speed factor.

        :param changes: ``changes`` when this was decided; what came later is kept
        """
        with self._changing:
            if changes != self.changes:
                return
            for name in (PAUSE, MOVED):
                self._factor.set(name, 1.0)
            self.set_speed(factor)

    @contextlib.contextmanager
    def _accepted(self, request: DriveRequest | None) -> Iterator[DriveRequest]:
        """Finish an accepted request at the end of a block, also if an error ends the block."""
        request, is_complete = request or self.request(), False
        try:
            yield request
            is_complete = True
        finally:
            self._requests.finish(request, is_complete)

    def _run(self, request: DriveRequest, task: RobotTask) -> None:
        request.period = task.period
        Drive([task]).run()
