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
Read what a Kachaka tells about itself: the charge of its battery, and its errors.

Tested by test/kachaka/grpc_client/test_grpc_bridge.py.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kachaka_simple_control.ros.names import BATTERY, DIAGNOSTICS, ERRORS
from kachaka_simple_control.text import escaped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64

if TYPE_CHECKING:
    from diagnostic_msgs.msg import DiagnosticArray

#: The longest text of the errors [characters].
MAX_ERRORS_LENGTH = 300


class RobotInfo:
    """
    Receives the charge of a Kachaka's battery and the errors that it reports.

    The official bridge has a topic for the errors, the bridge of this package ``/diagnostics``;
    without diagnostic_msgs, only the charge is received.

    :ivar battery: from 0 to 1; None before the robot has told it
    :ivar errors: as text; empty if there are none, None before the robot has told it
    """

    def __init__(self, node: Node, namespace: str) -> None:
        self.battery: float | None = None
        self.errors: str | None = None
        self._namespace = namespace.strip('/')
        # A separate callback group, so that these callbacks delay no others.
        group = MutuallyExclusiveCallbackGroup()
        node.create_subscription(
            Float64, f'/{self._namespace}/{BATTERY}', self._on_battery, qos_profile_sensor_data,
            callback_group=group)
        try:
            from diagnostic_msgs.msg import DiagnosticArray
        except ImportError:
            return
        for topic, receive in (
                (f'/{self._namespace}/{ERRORS}', self._on_errors),
                (DIAGNOSTICS, self._on_diagnostics)):
            node.create_subscription(DiagnosticArray, topic, receive, 10, callback_group=group)

    def _on_battery(self, message: Float64) -> None:
        if 0.0 <= message.data <= 100.0:
            self.battery = round(message.data / 100.0, 2)

    def _on_errors(self, message: DiagnosticArray) -> None:
        self._set_errors([f'{status.name} {status.message}' for status in message.status
                          if status.level != b'\x00'])

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f'{self._namespace}: robot':
                self._set_errors([status.message] if status.level != b'\x00' else [])

    def _set_errors(self, texts: list[str]) -> None:
        self.errors = escaped('; '.join(texts), MAX_ERRORS_LENGTH)
