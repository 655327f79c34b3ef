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
"""Our values as ROS 2 messages, and back."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from geometry_msgs.msg import Quaternion, Twist
from kachaka_simple_control.motion.geometry import Pose, Velocity

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time
    from nav_msgs.msg import Odometry

def twist(velocity: Velocity) -> Twist:
    """
    Return a velocity as a message; the one place that does.

    :param velocity: the velocity
    :returns: the message; what a robot on wheels cannot do is zero
    """
    message = Twist()
    message.linear.x = velocity.linear_x
    message.angular.z = velocity.angular_z
    return message


def velocity(twist: Twist) -> Velocity:
    """
    Return the velocity in a message.

    :param twist: the message; what a robot on wheels cannot do is left out
    :returns: the velocity, which may not be finite
    """
    return Velocity(twist.linear.x, twist.angular.z)


def odometry(
        pose: Pose,
        velocity: Velocity,
        stamp: Time,
        frame_id: str,
        child_frame_id: str) -> Odometry:
    """
    Return odometry as a message, its covariances zero: unknown.

    :param pose: where the robot is, in ``frame_id``
    :param velocity: how fast it is, in ``child_frame_id``
    :param stamp: when it was there
    :param frame_id: the frame that odometry starts from
    :param child_frame_id: the frame that moves with the robot
    :returns: the message
    """
    from nav_msgs.msg import Odometry
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    message.child_frame_id = child_frame_id
    message.pose.pose.position.x = pose.x
    message.pose.pose.position.y = pose.y
    message.pose.pose.orientation = _orientation(pose.theta)
    message.twist.twist = twist(velocity)
    return message


def pose(odometry: Odometry) -> Pose:
    """
    Return the pose in a message.

    :param odometry: the message
    :returns: where the robot is; the heading is between -pi and pi, for a message knows no turns
    """
    position = odometry.pose.pose.position
    return Pose(position.x, position.y, _yaw(odometry.pose.pose.orientation))


def _orientation(yaw: float) -> Quaternion:
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2.0), w=math.cos(yaw / 2.0))


def _yaw(orientation: Quaternion) -> float:
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
