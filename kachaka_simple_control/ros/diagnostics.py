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
"""Publish the diagnosis of a drive on ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from kachaka_simple_control.ros import conversions
from kachaka_simple_control.ros.debug_topics import create_debug_publisher, PublisherThread
from kachaka_simple_control.ros.names import DIAGNOSTICS
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.telemetry.diagnosis import Diagnosis
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message

DEPTH = 10


class DiagnosticsPublisher:
    """
    Publishes a diagnosis on request, if there are subscribers.

    :param velocities: the publisher that moves the robot
    :param robot: name of the robot
    :param diagnose: makes the diagnosis; None when there is none to make
    :raises UsageError: if the topic is remapped to where it would move the robot
    """

    def __init__(
            self, node: Node, velocities: VelocityPublisher, thread: PublisherThread, robot: str,
            diagnose: Callable[[], Diagnosis | None]) -> None:
        self._publisher = create_debug_publisher(
            node, velocities, DiagnosticArray, DIAGNOSTICS, QoSProfile(depth=DEPTH))
        self._thread = thread
        self._clock = node.get_clock()
        self._name = f'{node.get_fully_qualified_name().lstrip("/")}: drive'
        self._robot = f'{robot} on {velocities.topic_name}'
        self._diagnose = diagnose

    def publish(self) -> None:
        """Publish the diagnosis now."""
        if not self._publisher.get_subscription_count():
            return
        diagnosis = self._diagnose()
        if diagnosis is None:
            return
        message = conversions.diagnostics(
            {self._name: diagnosis}, self._clock.now().to_msg(), self._robot)
        self._thread.publish(self._publisher, lambda: bytes(serialize_message(message)))
