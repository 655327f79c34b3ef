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
"""
Convert poses, velocities and diagnoses to ROS 2 messages, and a Twist message to a velocity.

Tested by test/ros/test_debug_topics.py.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import TYPE_CHECKING

from geometry_msgs.msg import Quaternion, Twist
from kachaka_simple_control.motion.geometry import Pose, Velocity

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time
    from diagnostic_msgs.msg import DiagnosticArray
    from kachaka_simple_control.control.diagnosis import Diagnosis
    from nav_msgs.msg import Odometry


def twist(velocity: Velocity) -> Twist:
    """Return a velocity as a Twist message; all values except linear x and angular z are zero."""
    message = Twist()
    message.linear.x = velocity.linear_x
    message.angular.z = velocity.angular_z
    return message


def velocity(twist: Twist) -> Velocity:
    """Return linear x and angular z of a Twist message; they may be NaN or infinite."""
    return Velocity(twist.linear.x, twist.angular.z)


def odometry(
        pose: Pose, velocity: Velocity, stamp: Time, frame_id: str,
        child_frame_id: str) -> Odometry:
    """Return an Odometry message, with covariances of 0 because they are unknown."""
    from nav_msgs.msg import Odometry
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    message.child_frame_id = child_frame_id
    message.pose.pose.position.x = pose.x
    message.pose.pose.position.y = pose.y
    message.pose.pose.orientation = Quaternion(
        z=math.sin(pose.theta / 2.0), w=math.cos(pose.theta / 2.0))
    message.twist.twist = twist(velocity)
    return message


def diagnostics(
        diagnoses: Mapping[tuple[str, str], Diagnosis], stamp: Time) -> DiagnosticArray:
    """
    Return a DiagnosticArray message with one status for each diagnosis.

    :param diagnoses: by the name of the status, and the hardware ID
    """
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        DiagnosticStatus(
            # rclpy represents the message type byte as bytes.
            level=bytes([diagnosis.level]), name=name, message=diagnosis.message,
            hardware_id=hardware,
            values=[KeyValue(key=key, value=value) for key, value in diagnosis.values.items()])
        for (name, hardware), diagnosis in diagnoses.items()]
    return message
