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
"""The guardian's publisher on the ROS graph, and how it gets to know the robot soon."""

from __future__ import annotations

from collections.abc import Callable
import os

from kachaka_simple_control.ros.endpoints import own_participant
from kachaka_simple_control.ros.velocity_message import VelocityMessage
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.ros.waiting import wait_until
from rclpy.context import Context
from rclpy.node import Node

#: How long to wait for a robot before greeting it anew [s], each time.
PATIENCE = (0.3, 0.6, 1.2)


class Presence:
    """A publisher of velocities with a hidden node and a DDS participant of its own."""

    def __init__(
            self, topic: str, message_type: str, frame: str, domain: int,
            introduced: Callable[[bytes], None]) -> None:
        """
        Be there.

        :param topic: where velocities go, resolved already
        :param message_type: Twist or TwistStamped
        :param frame: the frame in the header of a stamped message
        :param domain: the ROS domain
        :param introduced: told its DDS participant, before the publisher is seen
        """
        self._context = Context()
        # No arguments: the topic must not be remapped again.
        self._context.init(args=[], domain_id=domain)
        self._node = node = Node(
            f'_guardian_{os.getpid()}', context=self._context, use_global_arguments=False,
            enable_rosout=False, start_parameter_services=False)
        introduced(own_participant(node))
        message = VelocityMessage(message_type, frame, lambda: node.get_clock().now().to_msg())
        self.publisher = VelocityPublisher(node, topic, message)

    @property
    def is_matched(self) -> bool:
        """Whether somebody subscribes to what it publishes."""
        return bool(self.publisher.get_subscription_count() > 0)

    def end(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()
        self._context.try_shutdown()


def introduce(enter: Callable[[], Presence], is_wanted: Callable[[], bool]) -> Presence:
    """
    Be there, and be there anew if no robot answers soon.

    Fast DDS sends its greeting before it listens.  A robot on the same machine may be quicker
    with its answer than that, answers each newcomer once, and is next heard of when it announces
    itself: up to 3 s later.  Every fourth newcomer was seen to wait for that.

    :param enter: makes a new presence
    :param is_wanted: whether there is something else to do, so that it stays as it is
    :returns: the presence that is left
    """
    for patience in PATIENCE:
        presence = enter()
        if wait_until(_either(presence, is_wanted), patience):
            return presence
        presence.end()
    return enter()


def _either(presence: Presence, is_wanted: Callable[[], bool]) -> Callable[[], bool]:
    return lambda: presence.is_matched or is_wanted()
