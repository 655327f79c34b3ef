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
"""The publisher of velocities, and the messages it sends."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any, TYPE_CHECKING

from geometry_msgs.msg import Twist, TwistStamped
from kachaka_simple_control.control.sent_messages import SentMessages
from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.ros.conversions import twist
from rclpy.node import Node
from rclpy.serialization import serialize_message

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time

#: By the names that robot profiles have for them.
TYPES = {'Twist': Twist, 'TwistStamped': TwistStamped}


class VelocityMessage:
    """
    Makes messages of velocities, as the bytes that go on the wire, one at a time.

    The same velocity comes again and again, and a message takes longer to make than to send: each
    is kept until another velocity is wanted.  Of a stamped one, the time is new each time.
    """

    def __init__(self, name: str, frame: str, now: Callable[[], Time]) -> None:
        """
        Make a zero first.

        :param name: of the type: Twist or TwistStamped
        :param frame: the frame in the header of a stamped message
        :param now: tells the time for that header
        """
        self.type: type[Twist] | type[TwistStamped] = TYPES[name]
        self._frame = frame
        self._now = now
        self._velocity = ZERO
        self._message: Twist | TwistStamped
        self._data: bytes
        self._make(ZERO)

    def of(self, velocity: Velocity) -> bytes:
        """
        Return a velocity as what a publisher takes.

        :param velocity: the velocity
        :returns: the message
        """
        if velocity is not self._velocity:
            self._make(velocity)
        if isinstance(self._message, TwistStamped):
            self._message.header.stamp = self._now()
            self._data = bytes(serialize_message(self._message))
        return self._data

    def _make(self, velocity: Velocity) -> None:
        self._velocity = velocity
        self._message = twist(velocity)
        if self.type is TwistStamped:
            self._message = TwistStamped(twist=self._message)
            self._message.header.frame_id = self._frame
        self._data = bytes(serialize_message(self._message))


def is_zero(data: bytes) -> bool:
    """
    Tell whether a message is a zero.

    :param data: a Twist or a TwistStamped, as it comes from the wire
    :returns: whether all its velocities are 0
    """
    # Six doubles come last in either.
    return not any(data[-48:])


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
