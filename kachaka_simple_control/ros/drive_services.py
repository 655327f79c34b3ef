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
The services of a node, and its parameters ``speed_factor``: they call the commander.

Tested by test/ros/test_commander.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
import threading

from kachaka_simple_control.control.drive_requests import DriveRequest, StopRequests
from kachaka_simple_control.control.speed_factor import MIN_SPEED_FACTOR
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.ros.commander import Commander, PARAMETER
from kachaka_simple_control.ros.endpoints import SERVICE_QOS
from kachaka_simple_control.ros.names import of_robot
from kachaka_simple_control.ros.robot import Robot
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger


class DriveServices:
    """
    The services ``~/stop``, ``~/pause`` and ``~/resume`` of a node, and more that ``serve`` adds.

    A robot with a name has such services of its own, for example ``~/NAME/stop``.
    """

    def __init__(self, node: Node, commander: Commander, robots: Sequence[Robot]) -> None:
        self._node, self._commander = node, commander
        #: the stop requests; a start or resume request at the same time is refused
        self.stop_requests = StopRequests()
        self._robots = {robot.settings.full_name(PARAMETER): robot for robot in robots}
        for robot in robots:
            commander.on_speed_set(robot, robot.settings.parameters.speed_factor)
        node.add_on_set_parameters_callback(self._check_parameters)
        # Humble has no callback that runs after all parameters are accepted.
        if hasattr(node, 'add_post_set_parameters_callback'):
            node.add_post_set_parameters_callback(self._apply_parameters)
        self._wake = node.create_guard_condition(lambda: None)
        self._serve_for('', None)
        for robot in robots:
            if robot.name:
                self._serve_for(robot.name, [robot])

    def _serve_for(self, name: str, robots: Sequence[Robot] | None) -> None:
        self.serve(of_robot('~/pause', name), partial(self._commander.pause, robots))
        self.serve(of_robot('~/resume', name), partial(self._resume, robots))
        # A separate callback group: this callback waits for the stop, and other callbacks go on.
        self._node.create_service(
            Trigger, of_robot('~/stop', name), partial(self._on_stop, robots),
            qos_profile=SERVICE_QOS, callback_group=MutuallyExclusiveCallbackGroup())

    def serve(self, name: str, function: Callable[[], str]) -> str:
        """
        Create a ``std_srvs/Trigger`` service that calls a function; return its full name.

        :param function: returns the text for the response, or raises a ControlError to refuse
        """
        # A callback group of its own: a callback of the user, which drives, may run meanwhile.
        service = self._node.create_service(
            Trigger, name, _service(function), qos_profile=SERVICE_QOS,
            callback_group=MutuallyExclusiveCallbackGroup())
        return str(self._node.resolve_service_name(service.srv_name))

    def start(self, drive: Callable[[DriveRequest], object]) -> str:
        """
        Start to drive for a ROS client, unless a client has just requested a stop.

        The node may process a request to start after the stop that followed it.

        :raises ControlError: if a stop was requested just before, or the robot may not drive now
        """
        self.stop_requests.require_none()
        return self._commander.start(drive)

    def _resume(self, robots: Sequence[Robot] | None) -> str:
        self.stop_requests.require_none()
        return self._commander.resume_when_confirmed(robots)

    async def _on_stop(
            self, robots: Sequence[Robot] | None, request: Trigger.Request,
            response: Trigger.Response) -> Trigger.Response:
        del request
        self.stop_requests.on_stop()
        stopped = Future()

        def stop() -> None:
            try:
                response.message, response.success = self._commander.stop('~/stop', robots), True
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
        for parameter in parameters:
            value = parameter.value
            if parameter.name in self._robots and (isinstance(value, bool) or not (
                    isinstance(value, (int, float)) and MIN_SPEED_FACTOR <= value <= 1.0)):
                return SetParametersResult(successful=False, reason=(
                    f'{parameter.name} is {value!r}; it must be from {MIN_SPEED_FACTOR:g} to 1; '
                    'to stop, pause'))
        if not hasattr(self._node, 'add_post_set_parameters_callback'):
            self._apply_parameters(parameters)
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: list[Parameter]) -> None:
        for name, factor in {one.name: one.value for one in parameters}.items():
            if name in self._robots:
                self._commander.on_speed_set(self._robots[name], factor)


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
