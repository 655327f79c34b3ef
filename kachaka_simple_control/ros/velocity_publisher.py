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
"""Publish velocities as Twist or TwistStamped messages."""

from __future__ import annotations

import time
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from kachaka_simple_control.control.sent_messages import SentMessages
from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.files.cdr import twist, twist_stamped
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.process.waiting import wait_until
from rclpy.node import Node

#: Message types by the names that robot profiles use.
TYPES = {'Twist': Twist, 'TwistStamped': TwistStamped}
#: Depth of the publisher's queue [messages]; the original lesson program uses the same depth.
DEPTH = 10


def taken_type(node: Node, topic: str, timeout: float) -> str | None:
    """
    Return which message type the subscribers of a velocity topic take: Twist if both are taken.

    :returns: a key of TYPES; None if nobody subscribes within the timeout, or to another type
    """
    def taken() -> set[str]:
        return {info.topic_type.rpartition('/')[2] for info in (
            node.get_subscriptions_info_by_topic(node.resolve_topic_name(topic)))}

    wait_until(lambda: bool(taken()) or not node.context.ok(), timeout)
    return next((name for name in TYPES if name in taken()), None)


def is_zero(data: bytes) -> bool:
    """Return whether all velocity components of a serialized Twist or TwistStamped are zero."""
    # In both message types, the six doubles of the velocity come last.
    return not any(data[-48:])


class VelocityPublisher:
    """
    Publishes velocities; the usual method ``publish`` refuses every message.

    No velocity may be sent unchecked, so only two call ``transmit``: the velocity gate, and the
    guardian, which sends zeros.  Other attributes come from the rclpy publisher.
    """

    def __init__(self, node: Node, topic: str, message_type: str, frame: str) -> None:
        self._node = node
        self._publisher = node.create_publisher(TYPES[message_type], topic, DEPTH)
        self._is_stamped = message_type == 'TwistStamped'
        self._frame = frame
        self._clock = node.get_clock()
        #: the newest velocity, and its Twist message: most velocities are sent many times
        self._newest = ZERO, twist(ZERO)
        #: the sent messages, to distinguish them from the messages of other publishers
        self.sent = SentMessages()

    def transmit(self, velocity: Velocity) -> None:
        """Publish a velocity without a check; for the velocity gate and the guardian only."""
        data = self._serialized(velocity)
        self.sent.record(time.monotonic(), data)
        # As bytes: to make a message and to serialize it takes longer than to publish it.
        self._publisher.publish(data)

    def destroy(self) -> None:
        """Destroy the rclpy publisher that sends the velocities."""
        self._node.destroy_publisher(self._publisher)

    def publish(self, msg: Any) -> None:  # noqa: ARG002
        """
        Refuse to publish a message: only checked velocities may be sent to the robot.

        :raises MotionRefusedError: always; the message says which functions to call instead
        """
        raise MotionRefusedError(
            'nothing was published: velocities are timed, limited and stopped by move_robot() '
            'and stop_robot(); use those')

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the wrapped rclpy publisher, such as ``topic_name``."""
        return getattr(self._publisher, name)

    def _serialized(self, velocity: Velocity) -> bytes:
        if self._is_stamped:
            return twist_stamped(velocity, self._clock.now().nanoseconds, self._frame)
        if velocity is not self._newest[0]:
            self._newest = velocity, twist(velocity)
        return self._newest[1]
