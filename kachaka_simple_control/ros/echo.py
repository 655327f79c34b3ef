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

from geometry_msgs.msg import TwistStamped
from kachaka_simple_control.report.events import Event, Sent
from kachaka_simple_control.ros.shown_topics import shown_topic
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

TOPIC = '~/commanded_velocity'


class Echo:
    """
    Publishes velocities after they left, as long as somebody subscribes.

    It runs in the thread that moves the robot.  Best effort: a reliable writer has more to do for
    readers that are slow, gone or frozen.  It moves nothing: robots listen elsewhere.
    """

    def __init__(self, node: Node, velocities: VelocityPublisher, frame: str) -> None:
        """
        Publish nothing yet.

        :param node: whose topic it is
        :param velocities: the publisher that moves the robot
        :param frame: the frame of the robot
        :raises UsageError: if the topic is remapped to where it would move the robot
        """
        self._publisher = shown_topic(
            node, velocities, TwistStamped, TOPIC,
            QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
        self._clock = node.get_clock()
        # Made once: a message takes longer to make than to send.
        self._message = TwistStamped()
        self._message.header.frame_id = frame

    def hear(self, event: Event) -> None:
        """
        Publish what was sent.

        :param event: what happened; a velocity that is told of has left just now
        """
        if not isinstance(event, Sent) or not self._publisher.get_subscription_count():
            return
        message = self._message
        message.header.stamp = self._clock.now().to_msg()
        message.twist.linear.x = event.velocity.linear_x
        message.twist.angular.z = event.velocity.angular_z
        self._publisher.publish(message)
