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
"""Subscribe to the odometry of the robot."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
import math
import time
from typing import Any

from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.ros.conversions import pose, velocity
from kachaka_simple_control.ros.endpoints import with_qos_overrides
from kachaka_simple_control.ros.names import RobotNames
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data


def subscribe_to_odometry(
        node: Node, names: RobotNames,
        on_odometry: Callable[[float, Pose, Velocity, bool], None],
        on_frame: Callable[[str], None]) -> bool:
    """
    Subscribe to odometry, unless the robot has no odometry or nav_msgs is not installed.

    :param names: the names of the robot, before remapping
    :param on_odometry: called for each message, with the time of arrival [s on the steady clock],
        the pose, the velocity, and whether the message is new: its stamp is later than the stamp
        of the previous message, or is not set
    :param on_frame: called with the frame of the poses, before the first pose in this frame
    :returns: whether a subscription was created
    :raises UsageError: if a parameter requests an invalid quality of service
    """
    topic = names.odometry
    if topic is None:
        return False
    # Optional: without nav_msgs a drive works, but without the checks by odometry.
    try:
        from nav_msgs.msg import Odometry
    except ImportError:
        return False

    frame, newest = None, 0

    def on_message(message: Any) -> None:
        nonlocal frame, newest
        if message.header.frame_id != frame:
            frame = message.header.frame_id
            on_frame(frame)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        is_new, newest = stamp > newest or not stamp, stamp
        at, speed = pose(message), velocity(message.twist.twist)
        # Ignore a message with a value that is NaN or infinite.
        if math.isfinite(at.x + at.y + at.theta + speed.linear_x + speed.angular_z):
            on_odometry(time.monotonic(), at, speed, is_new)

    # Best effort, like the publisher of the robot: a reliable subscription would not match.
    with_qos_overrides(lambda options: node.create_subscription(
        Odometry, topic, on_message, copy(qos_profile_sensor_data),
        qos_overriding_options=options))
    return True
