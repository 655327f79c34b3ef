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
"""Drive when a service asks for it."""

from __future__ import annotations

from collections.abc import Callable
import threading

from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.ros.quality import SERVICE_QUALITY
from rclpy.node import Node
from std_srvs.srv import Trigger


class RunService:
    """The service ``~/run``: starts a drive, one at a time, and answers at once."""

    def __init__(self, node: Node, prepare: Callable[[], Callable[[], None]]) -> None:
        """
        Offer it.

        :param node: whose service it is
        :param prepare: accepts a drive for each request, or raises why not, and returns what
            drives; a stop ends the drive from then on
        """
        self._node = node
        self._prepare = prepare
        service = node.create_service(
            Trigger, '~/run', self._on_request, qos_profile=SERVICE_QUALITY)
        node.get_logger().info(f'Standing by: call {service.srv_name} to start, ~/stop to stop')

    def _on_request(
            self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        del request
        try:
            drive = self._prepare()
        except ControlError as error:
            response.message = str(error)
            return response
        # A callback must return soon, so the drive gets a thread of its own.
        threading.Thread(target=self._run, args=(drive,), name='drive', daemon=True).start()
        response.success, response.message = True, 'started'
        return response

    def _run(self, drive: Callable[[], None]) -> None:
        try:
            drive()
        except ControlError as error:
            self._node.get_logger().error(str(error))
