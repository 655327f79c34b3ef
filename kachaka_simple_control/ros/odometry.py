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
"""Hear where the robot says it is."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
import math
import time
from typing import Any

from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.ros.conversions import pose, velocity
from kachaka_simple_control.ros.debug_topics import with_qos_overrides
from kachaka_simple_control.ros.names import RobotNames
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data


def subscribe_to_odometry(
        node: Node, names: RobotNames,
        on_odometry: Callable[[float, Pose, Velocity], None],
        on_frame: Callable[[str], None]) -> None:
    """
    Call a function for each pose and velocity that odometry tells.

    Does nothing for a robot without odometry, or where nav_msgs is not installed.

    :param node: the node that listens
    :param names: the robot's names
    :param on_odometry: called with the time of arrival [s on the steady clock], the pose and the
        velocity
    :param on_frame: called with the frame that poses are in, before the first pose in it
    :raises UsageError: if a parameter asks for a quality of service that cannot be had
    """
    topic = names.odometry
    if topic is None:
        return
    # Imported here: a drive needs no nav_msgs, it only knows less of how it went.
    try:
        from nav_msgs.msg import Odometry
    except ImportError:
        return

    frame = None

    def hear(message: Any) -> None:
        nonlocal frame
        if message.header.frame_id != frame:
            frame = message.header.frame_id
            on_frame(frame)
        place, speed = pose(message), velocity(message.twist.twist)
        # What is no number is no odometry: it is left out, as if nothing had come.
        if math.isfinite(place.x + place.y + place.theta + speed.linear_x + speed.angular_z):
            on_odometry(time.monotonic(), place, speed)

    # Best effort, as the robot publishes it: a reliable subscription would hear nothing.
    with_qos_overrides(lambda options: node.create_subscription(
        Odometry, topic, hear, copy(qos_profile_sensor_data),
        qos_overriding_options=options))
