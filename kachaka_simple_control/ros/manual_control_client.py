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
Call the service that switches manual control on and off.

Tested by test/ros/test_robot.py.
"""

from __future__ import annotations

import math
import time
from typing import Any

from kachaka_simple_control.control.preparation import Moment, Steps, until
from kachaka_simple_control.control.timing import REQUEST_RETRY_PERIOD
from kachaka_simple_control.errors import RobotNotFoundError
from kachaka_simple_control.text import escaped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import SetBool


class ManualControlResponse:
    """The response to a request that switches manual control on or off, once it is ``done``."""

    def __init__(self, future: Any) -> None:
        self._future = future

    @property
    def done(self) -> bool:
        """Whether the response to the request for manual control has arrived."""
        return bool(self._future.done())

    @property
    def refusal(self) -> str | None:
        """Return why the robot refused, once it has responded; None if it accepted the request."""
        response = self._future.result()
        return None if response.success else escaped(response.message) or 'no reason given'


class ManualControlClient:
    """
    Switches manual control of a robot on and off.

    :param service: the name of the service; None for a robot that needs no manual control
    """

    def __init__(
            self, node: Node, service: str | None, timeout: float = math.inf) -> None:
        self._service = service
        self._timeout = timeout
        #: time of the newest request to switch manual control on [s on the steady clock]; None if
        #: there was none, or manual control was released later
        self._requested: float | None = None
        # A separate callback group: after Ctrl+C in a callback, the group of this callback stays
        # blocked, but the response to the release must still be received.
        self._client = node.create_client(
            SetBool, service, callback_group=MutuallyExclusiveCallbackGroup()) if service else None
        #: whether any request was ever sent
        self.was_requested = False

    @property
    def is_needed(self) -> bool:
        """Whether this robot accepts velocities only while manual control is on."""
        return self._client is not None

    @property
    def is_available(self) -> bool:
        """Whether the service for manual control is available; also True if it is not needed."""
        return self._client is None or bool(self._client.service_is_ready())

    def enable(self, moment: Moment, timeout: float) -> Steps[None]:
        """
        Switch on manual control, and wait for the response of the robot.

        The request is repeated, each time after a longer pause.  The first response counts.

        :raises RobotNotFoundError: if no response comes in time, or the robot refuses
        """
        end = moment.now + timeout
        responses: list[ManualControlResponse] = []
        pause = REQUEST_RETRY_PERIOD
        while (left := end - moment.now) > 0.0:
            responses.append(self.request(True))
            yield from until(
                moment, lambda: any(r.done for r in responses), 'manual control',
                min(pause, left))
            response = next((r for r in responses if r.done), None)
            if response is None:
                pause *= 2.0
            elif response.refusal is None:
                return
            else:
                raise RobotNotFoundError(f'the robot refused manual control: {response.refusal}')
        raise RobotNotFoundError(
            f'{self._service} did not answer within {timeout:g} s, so manual control may be off '
            'and nothing was sent: check the link between the bridge and the robot, and that '
            'somebody spins the executor this node is in')

    def request(self, enabled: bool) -> ManualControlResponse:
        """Request to switch manual control on or off, and do not wait for the response."""
        assert self._client is not None
        self.was_requested = True
        self._requested = time.monotonic() if enabled else None
        return ManualControlResponse(self._client.call_async(SetBool.Request(data=enabled)))

    def state(self, now: float) -> str:
        """Return a text for diagnostics: not needed, off, or how long ago it was requested."""
        if not self.is_needed:
            return 'not needed'
        if self._requested is None:
            return 'off'
        age = now - self._requested
        return f'requested {age:.0f} s ago' if age < self._timeout else 'off: it ran out'

    def release(self, moment: Moment, timeout: float) -> Steps[bool]:
        """Switch manual control off; return whether the robot responded in time."""
        response = self.request(False)
        return (yield from until(moment, lambda: response.done, 'the release', timeout))
