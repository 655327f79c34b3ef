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
"""What a node shows of its publisher of velocities."""

from __future__ import annotations

import time
from typing import Any

from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.execution.sent_messages import SentMessages
from kachaka_simple_control.motion.kinematics import Velocity
from kachaka_simple_control.ros.velocity_message import VelocityMessage
from rclpy.node import Node

#: How many messages the publisher keeps: the lesson's.
DEPTH = 10


class VelocityPublisher:
    """
    A publisher that can be looked at, but publishes nothing on its own.

    Velocities leave through one place, where latch, gap and limits are checked; everything else
    a publisher offers (``topic_name``, ``get_subscription_count()``, ...) is handed through.
    """

    def __init__(self, node: Node, topic: str, message: VelocityMessage) -> None:
        """
        Make a publisher for the edge to use.

        :param node: whose it is
        :param topic: where velocities go
        :param message: makes messages of them
        """
        self._publisher = node.create_publisher(message.type, topic, DEPTH)
        self._message = message
        #: what went out, to tell it from what others send
        self.sent = SentMessages()

    def transmit(self, velocity: Velocity) -> None:
        """
        Put a velocity on the wire; for the edge alone.

        :param velocity: what to publish
        """
        data = self._message.of(velocity)
        self.sent.note(time.monotonic(), data)
        self._publisher.publish(data)

    def publish(self, msg: Any) -> None:  # noqa: ARG002
        """
        Refuse to publish beside the edge.

        :param msg: not sent
        :raises MotionRefusedError: always, with the way to go
        """
        raise MotionRefusedError(
            'nothing was published: velocities are timed, limited and stopped by move_robot() '
            'and stop_robot(); use those')

    def __getattr__(self, name: str) -> Any:
        """
        Hand everything else through.

        :param name: the attribute
        :returns: the publisher's own
        """
        return getattr(self._publisher, name)
