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
"""Accept or refuse requests to start, stop, pause, resume or slow down the motion of a robot."""

from __future__ import annotations

from collections.abc import Callable
import threading
from typing import Any

from kachaka_simple_control.control.drive_requests import (
    DriveRequest,
    ResumeConfirmation,
    StopRequests,
)
from kachaka_simple_control.control.robot_drive import RunProgress
from kachaka_simple_control.control.speed_factor import MIN_SPEED_FACTOR, MOVED, OVERRIDE, PAUSE
from kachaka_simple_control.control.timing import RESUME_CONFIRM_TIMEOUT, RESUME_QUIET_TIME
from kachaka_simple_control.errors import (
    ControlError,
    ENDED,
    MotionRefusedError,
    MotionStoppedError,
    RobotMovedError,
)
from kachaka_simple_control.ros.endpoints import SERVICE_QOS
from kachaka_simple_control.ros.session import Session
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

#: The writable parameter: the speed factor that the user sets.
PARAMETER = 'speed_factor'


class Commander:
    """
    Starts, stops, pauses, resumes and slows down the motion of a robot when a user requests it.

    Services, keys and Python code call the methods, from any thread.  A refused request raises an
    error; the text that most methods return tells the user what was done.

    :param factor: the initial value of the ROS parameter ``speed_factor``
    """

    def __init__(self, node: Node, session: Session, factor: float) -> None:
        self._node = node
        self._session = session
        self._factor = session.speed_factor
        self._initial_factor = factor
        #: how often somebody has paused or set the speed
        self._changes = 0
        # Reentrant: to set the parameter calls back in the same thread.
        self._changing = threading.RLock()
        self._confirmation = ResumeConfirmation()
        #: the stop requests; a start or resume request at the same time is refused
        self.stop_requests = StopRequests()
        self._factor.set(OVERRIDE, factor)
        node.add_on_set_parameters_callback(self._check_parameters)
        # Humble has no callback that runs after all parameters are accepted.
        if hasattr(node, 'add_post_set_parameters_callback'):
            node.add_post_set_parameters_callback(self._apply_parameters)
        for name, function in (('~/pause', self.pause), ('~/resume', self.request_resume)):
            self.serve(name, function)
        # A separate callback group: this callback waits for the stop, and other callbacks go on.
        node.create_service(
            Trigger, '~/stop', self._on_stop, qos_profile=SERVICE_QOS,
            callback_group=MutuallyExclusiveCallbackGroup())
        self._wake = node.create_guard_condition(lambda: None)

    @property
    def state(self) -> RunProgress:
        """Return the progress of the newest motion: how far it has come and whether it is over."""
        return self._session.robot_drive.progress

    def serve(self, name: str, function: Callable[[], str]) -> str:
        """
        Create a ``std_srvs/Trigger`` service that calls a function; return its full name.

        :param function: returns the text for the response, or raises a ControlError to refuse
        """
        service = self._node.create_service(
            Trigger, name, _service(function), qos_profile=SERVICE_QOS)
        return str(self._node.resolve_service_name(service.srv_name))

    def start(self, drive: Callable[[DriveRequest], object]) -> str:
        """
        Start a thread that drives the robot; from now on a stop ends the drive.

        :raises ControlError: if the robot may not drive now, for example because it does already
        """
        request = self._session.request(elsewhere=True)

        def run() -> None:
            try:
                drive(request)
            except MotionStoppedError as error:
                self._node.get_logger().info(str(error))
            except ControlError as error:
                self._node.get_logger().error(str(error))

        # A drive in a callback would wait for other callbacks, which wait for this one.
        threading.Thread(target=run, name='drive', daemon=True).start()
        return 'started'

    def request_start(self, drive: Callable[[DriveRequest], object]) -> str:
        """
        Start to drive for a ROS client, unless a client has just requested a stop.

        The node may process a request to start after the stop that followed it.

        :raises ControlError: if a stop was requested just before, or the robot may not drive now
        """
        self.stop_requests.require_none()
        return self.start(drive)

    def request_stop(self) -> str:
        """
        Stop the robot because a client has called the service ``~/stop``.

        :raises RunFaultError: if the stop could not be sent, or the robot still moves by odometry
        """
        return self._session.stop('~/stop')

    def pause(self) -> str:
        """
        Bring the robot to rest within its limits, and keep it there until ``resume`` is called.

        If no motion is under way, the next one is paused before the robot moves.

        :raises ControlError: if no motion may start any more, so that there is none to pause
        """
        self._session.require_not_stopped()
        with self._changing:
            self._changes += 1
            is_new = self._factor.set(PAUSE, 0.0)
        if not is_new:
            return 'it was paused before'
        self._node.get_logger().info('Paused: resume to go on')
        return ('paused' if self._session.is_driving
                else 'paused: the next motion is held at its start')

    def resume(self, even_if_moved: bool = False) -> str:
        """
        Continue a paused motion.

        :param even_if_moved: whether to continue from where the robot stands now if somebody moved
            it during the pause
        :raises ControlError: if no motion may start now, or the robot was moved
        """
        self._session.check_resume(even_if_moved)
        was_held = [self._factor.set(name, 1.0) for name in (PAUSE, MOVED)]
        if any(was_held):
            self._node.get_logger().info('Resumed')
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
        except RobotMovedError as error:
            self._confirmation.on_warning()
            raise RobotMovedError(
                f'{error}. To go on all the same, resume once more, {RESUME_QUIET_TIME:g} to '
                f'{RESUME_CONFIRM_TIMEOUT:g} s from now') from None

    def request_resume(self) -> str:
        """
        Continue a paused motion for a ROS client, as ``resume_when_confirmed`` does.

        :raises ControlError: if a stop was requested just before, no motion may start now, or the
            robot was moved
        """
        self.stop_requests.require_none()
        return self.resume_when_confirmed()

    def change_speed(self, step: float) -> None:
        """Change the ROS parameter ``speed_factor`` by a step, between one step and 1."""
        factor = self._factor.factors.get(OVERRIDE, 1.0)
        self.set_speed(min(1.0, max(abs(step), round(factor + step, 2))))

    def set_speed(self, factor: float) -> None:
        """
        Set the ROS parameter ``speed_factor``, from 0.01 to 1.

        :raises ControlError: if the value is out of range, or no motion may start any more
        """
        self._session.require_not_stopped()
        try:
            result = self._node.set_parameters([Parameter(PARAMETER, value=factor)])[0]
        except rclpy_implementation.InvalidHandle:  # the node was destroyed just now
            raise MotionRefusedError(ENDED) from None
        if not result.successful:
            raise MotionRefusedError(result.reason)

    @property
    def changes(self) -> int:
        """Return how often somebody has paused the robot or set its speed so far."""
        return self._changes

    def begin_anew(self, changes: int) -> None:
        """
        End any pause, and set the speed to that at the start of the node.

        :param changes: ``changes`` when this was decided; what came later is kept
        """
        with self._changing:
            if changes != self._changes:
                return
            for name in (PAUSE, MOVED):
                self._factor.set(name, 1.0)
            self.set_speed(self._initial_factor)

    async def _on_stop(
            self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        self.stop_requests.on_stop()
        stopped = Future()

        def stop() -> None:
            try:
                response.message, response.success = self.request_stop(), True
            except Exception as error:  # the client must get a response in any case
                response.message = str(error)
            stopped.set_result(None)
            self._wake.trigger()

        # In a thread: the node must receive odometry meanwhile, to confirm the stop.
        try:
            threading.Thread(target=stop, name='stop', daemon=True).start()
        except RuntimeError:  # since Python 3.12 no thread can start while the program ends
            stop()
        await stopped
        return response

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for value in _factors(parameters):
            if isinstance(value, bool) or not (
                    isinstance(value, (int, float)) and MIN_SPEED_FACTOR <= value <= 1.0):
                return SetParametersResult(successful=False, reason=(
                    f'{PARAMETER} is {value!r}; it must be from {MIN_SPEED_FACTOR:g} to 1; '
                    'to stop, pause'))
        if not hasattr(self._node, 'add_post_set_parameters_callback'):
            self._apply_parameters(parameters)
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: list[Parameter]) -> None:
        if values := _factors(parameters):
            with self._changing:
                self._changes += 1
                self._factor.set(OVERRIDE, values[-1])


def _factors(parameters: list[Parameter]) -> list[Any]:
    """Return all values of ``speed_factor`` in a list of ROS parameters."""
    return [parameter.value for parameter in parameters if parameter.name == PARAMETER]


def _service(function: Callable[[], str]) -> Callable[
        [Trigger.Request, Trigger.Response], Trigger.Response]:
    """Return a callback for a ``std_srvs/Trigger`` service; the callback calls a function."""
    def respond(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        try:
            response.message = function()
            response.success = True
        except ControlError as error:
            response.message = str(error)
        return response
    return respond
