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
"""Tell ``/diagnostics`` how the drive goes."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from kachaka_simple_control.ros.debug_topics import create_debug_publisher, PublisherThread
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.telemetry.diagnosis import Diagnosis
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message

TOPIC = '/diagnostics'
DEPTH = 10


class DiagnosticsPublisher:
    """Publishes a diagnosis whenever it is asked to, if anybody subscribes."""

    def __init__(
            self, node: Node, velocities: VelocityPublisher, aside: PublisherThread, robot: str,
            condition: Callable[[], Diagnosis | None]) -> None:
        """
        Publish nothing yet.

        :param node: whose condition it is
        :param velocities: the publisher that moves the robot
        :param aside: publishes without holding anybody up
        :param robot: what people call the robot
        :param condition: makes the diagnosis; None when there is none to make
        :raises UsageError: if the topic is remapped to where it would move the robot
        """
        self._publisher = create_debug_publisher(
            node, velocities, DiagnosticArray, TOPIC, QoSProfile(depth=DEPTH))
        self._aside = aside
        self._clock = node.get_clock()
        self._name = f'{node.get_fully_qualified_name().lstrip("/")}: drive'
        self._robot = f'{robot} on {velocities.topic_name}'
        self._condition = condition

    def publish(self) -> None:
        """Publish how it is now."""
        if not self._publisher.get_subscription_count():
            return
        condition = self._condition()
        if condition is None:
            return
        message = DiagnosticArray()
        message.header.stamp = self._clock.now().to_msg()
        message.status = [DiagnosticStatus(
            # A byte is bytes in rclpy.
            level=bytes([condition.level]), name=self._name, message=condition.message,
            hardware_id=self._robot,
            values=[KeyValue(key=key, value=value) for key, value in condition.values.items()])]
        self._aside.publish(self._publisher, lambda: bytes(serialize_message(message)))
