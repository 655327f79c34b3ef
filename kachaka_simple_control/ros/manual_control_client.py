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
"""The service that makes a robot take velocities, or drop them."""

from __future__ import annotations

from collections.abc import Callable
import math
import time
from typing import Any

from kachaka_simple_control.control.timing import REQUEST_RETRY_PERIOD
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.errors import RobotNotFoundError
from kachaka_simple_control.escaping import escaped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import SetBool


class ManualControlResponse:
    """The answer to one request for manual control."""

    def __init__(self, future: Any) -> None:
        """
        Wait for nothing yet.

        :param future: what rclpy returned for the call
        """
        self._future = future

    @property
    def done(self) -> bool:
        """Whether it has come."""
        return bool(self._future.done())

    @property
    def refusal(self) -> str | None:
        """Why manual control was refused; None if it was granted."""
        response = self._future.result()
        return None if response.success else escaped(response.message) or 'no reason given'


class ManualControlClient:
    """Manual control of one robot; without a service it is always on."""

    def __init__(
            self, node: Node, service: str | None, check: Callable[[], None],
            timeout: float = math.inf) -> None:
        """
        Ask for nothing yet.

        :param node: the node that asks
        :param service: the name of the service; None for a robot that needs none
        :param check: called while waiting; what it raises ends the wait
        :param timeout: how long one enabling lasts [s]
        """
        self._service = service
        self._timeout = timeout
        #: when it was asked for last [s on the steady clock]; None if it was given back since
        self._asked: float | None = None
        # In a group of its own: Ctrl+C in the middle of a callback blocks that callback's group
        # for good, and the answer to giving the robot back must be heard all the same.
        self._client = node.create_client(
            SetBool, service, callback_group=MutuallyExclusiveCallbackGroup()) if service else None
        self._check = check
        #: whether it was ever asked for
        self.was_requested = False

    @property
    def is_needed(self) -> bool:
        """Whether this robot takes velocities only under manual control."""
        return self._client is not None

    @property
    def is_available(self) -> bool:
        """Whether somebody serves the service, where it is needed."""
        return self._client is None or bool(self._client.service_is_ready())

    def enable(self, timeout: float) -> None:
        """
        Switch manual control on, and wait for the answer.

        :param timeout: how long [s]
        :raises RobotNotFoundError: if no answer comes, or it is a refusal
        """
        answer = self._answer(time.monotonic() + timeout)
        if answer is None:
            raise RobotNotFoundError(
                f'{self._service} did not answer within {timeout:g} s, so manual control may be '
                'off and nothing was sent: check the link between the bridge and the robot, and '
                'that somebody spins the executor this node is in')
        if answer.refusal is not None:
            raise RobotNotFoundError(f'the robot refused manual control: {answer.refusal}')

    def request(self, enabled: bool) -> ManualControlResponse:
        """
        Ask for manual control, or give it back, without waiting.

        :param enabled: whether it is wanted
        :returns: the answer on its way
        """
        assert self._client is not None
        self.was_requested = True
        self._asked = time.monotonic() if enabled else None
        return ManualControlResponse(self._client.call_async(SetBool.Request(data=enabled)))

    def state(self, now: float) -> str:
        """
        Return how it stands, as far as this side knows.

        :param now: the time [s on the steady clock]
        :returns: it, in a few words
        """
        if not self.is_needed:
            return 'not needed'
        if self._asked is None:
            return 'off'
        age = now - self._asked
        return f'asked for {age:.0f} s ago' if age < self._timeout else 'off, for it timed out'

    def release(self, timeout: float) -> bool:
        """
        Switch manual control off.

        :param timeout: how long to wait for the answer [s]
        :returns: whether the answer came
        """
        answer = self.request(False)
        return wait_until(lambda: answer.done, timeout)

    def _answer(self, end: float) -> ManualControlResponse | None:
        """Ask until an answer comes, to whichever request."""
        answers: list[ManualControlResponse] = []
        pause = REQUEST_RETRY_PERIOD
        while (left := end - time.monotonic()) > 0.0:
            answers.append(self.request(True))
            wait_until(lambda: any(a.done for a in answers), min(pause, left), self._check)
            for answer in answers:
                if answer.done:
                    return answer
            pause *= 2.0
        return None
