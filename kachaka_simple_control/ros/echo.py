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
"""Every velocity sent, once more, with its time: for plots."""

from __future__ import annotations

from functools import partial

from geometry_msgs.msg import TwistStamped
from kachaka_simple_control.motion.kinematics import Velocity
from kachaka_simple_control.report.events import Event, Sent
from kachaka_simple_control.ros.aside import Aside
from kachaka_simple_control.ros.shown_topics import shown_topic
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message

TOPIC = '~/commanded_velocity'
#: How often to look whether anybody subscribes [s]: asking takes longer than all the rest here.
GLANCE = 0.2


class Echo:
    """
    Publishes velocities after they left, as long as somebody subscribes.

    The thread that moves the robot does no more for it than to look whether anybody does, and to
    put a velocity into a queue.  Best effort: for a plot the newest counts, and a reliable writer
    has more to do for readers that are slow, gone or frozen.
    """

    def __init__(
            self, node: Node, velocities: VelocityPublisher, aside: Aside, frame: str) -> None:
        """
        Publish nothing yet.

        :param node: whose topic it is
        :param velocities: the publisher that moves the robot
        :param aside: publishes without holding anybody up
        :param frame: the frame of the robot
        :raises UsageError: if the topic is remapped to where it would move the robot
        """
        self._publisher = shown_topic(
            node, velocities, TwistStamped, TOPIC,
            QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
        self._aside = aside
        self._clock = node.get_clock()
        # Made once: a message takes longer to make than to send.
        self._message = TwistStamped()
        self._message.header.frame_id = frame
        self._is_watched = False
        self._looked = float('-inf')

    def hear(self, event: Event) -> None:
        """
        Publish what was sent.

        :param event: what happened; a velocity that is told of has left just now
        """
        if not isinstance(event, Sent):
            return
        if event.time - self._looked >= GLANCE:
            self._looked = event.time
            self._is_watched = self._publisher.get_subscription_count() > 0
        if self._is_watched:
            self._aside.publish(self._publisher, partial(
                self._packed, event.velocity, self._clock.now().nanoseconds))

    def _packed(self, velocity: Velocity, time: int) -> bytes:
        message = self._message
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time, 1_000_000_000)
        message.twist.linear.x = velocity.linear_x
        message.twist.angular.z = velocity.angular_z
        return bytes(serialize_message(message))
