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
"""Pause, resume and speed of a node, by services and by a parameter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kachaka_simple_control.control.service_requests import ResumeConfirmation, StopRequests
from kachaka_simple_control.control.speed_factor import MIN_SPEED_FACTOR, MOVED, OVERRIDE, PAUSE
from kachaka_simple_control.control.timing import RESUME_CONFIRM_TIMEOUT, RESUME_QUIET_TIME
from kachaka_simple_control.errors import ControlError, MotionRefusedError, RobotMovedError
from kachaka_simple_control.ros.endpoints import SERVICE_QOS
from kachaka_simple_control.ros.session import Session
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

#: The writable parameter: the factor that a person sets.
PARAMETER = 'speed_factor'


class SpeedControl:
    """
    Lets people slow down, pause and resume what a session drives.

    :param node: gets the services ``~/pause`` and ``~/resume``
    :param session: whose speed factor is set
    :param factor: the parameter's value at the start
    """

    def __init__(self, node: Node, session: Session, factor: float) -> None:
        self._node = node
        self._session = session
        self._factor = session.speed_factor
        self._confirmation = ResumeConfirmation()
        #: the requests to stop, beside which nothing goes on
        self.stop_requests = StopRequests()
        self._factor.set(OVERRIDE, factor)
        node.add_on_set_parameters_callback(self._check_parameters)
        # Humble has nothing that is called when all has been accepted.
        if hasattr(node, 'add_post_set_parameters_callback'):
            node.add_post_set_parameters_callback(self._apply_parameters)
        for name, function in (('~/pause', self.pause), ('~/resume', self._on_resume)):
            node.create_service(
                Trigger, name, _service(function), qos_profile=SERVICE_QOS)

    def pause(self) -> str:
        """Bring the robot to rest within its limits, and hold the motion; return what it did."""
        if not self._factor.set(PAUSE, 0.0):
            return 'it was paused before'
        self._node.get_logger().info('Paused: resume to go on')
        return ('paused' if self._session.is_driving
                else 'paused: the next motion is held at its start')

    def resume(self, even_if_moved: bool = False) -> str:
        """
        Go on with a motion that is paused.

        :param even_if_moved: whether to go on from where somebody moved the robot to
        :returns: what it did
        :raises ControlError: if a motion could not start now either, or the robot was moved
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
        Go on with a motion that is paused; if the robot was moved, only when asked again.

        :returns: what it did
        :raises ControlError: if a motion could not start now either, or the robot was moved
        """
        try:
            return self.resume(even_if_moved=self._confirmation.on_request())
        except RobotMovedError as error:
            self._confirmation.on_warning()
            raise RobotMovedError(
                f'{error}. To go on all the same, resume once more, {RESUME_QUIET_TIME:g} to '
                f'{RESUME_CONFIRM_TIMEOUT:g} s from now') from None

    def _on_resume(self) -> str:
        self.stop_requests.require_none()
        return self.resume_when_confirmed()

    def set_override(self, factor: float) -> None:
        """
        Set the parameter ``speed_factor``.

        :param factor: from 0.01 to 1
        :raises MotionRefusedError: if it is something else
        """
        result = self._node.set_parameters([Parameter(PARAMETER, value=factor)])[0]
        if not result.successful:
            raise MotionRefusedError(result.reason)

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
            self._factor.set(OVERRIDE, values[-1])


def _factors(parameters: list[Parameter]) -> list[Any]:
    """Return the values for the speed factor among parameters to set."""
    return [parameter.value for parameter in parameters if parameter.name == PARAMETER]


def _service(function: Callable[[], str]) -> Callable[
        [Trigger.Request, Trigger.Response], Trigger.Response]:
    """Return the callback of a service that calls a function, which returns what it did."""
    def respond(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        try:
            response.message = function()
            response.success = True
        except ControlError as error:
            response.message = str(error)
        return response
    return respond
