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
"""Messages of the robot, and our values, as messages of ROS 2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from kachaka_simple_control.robot.real.diagnosis import Status
from nav_msgs.msg import Odometry

BILLION = 1_000_000_000
#: The frames of odometry, should the robot not name them.
ODOMETRY_FRAME = 'odom'
ROBOT_FRAME = 'base_footprint'


def odometry(source: Any, now: Time, frame_prefix: str) -> Odometry:
    """
    Return odometry as the robot tells it.

    :param source: a RosOdometry of the robot
    :param now: the stamp, if it has none
    :param frame_prefix: put before the names of frames as it is
    :returns: the message
    """
    message = Odometry()
    nanoseconds = source.header.stamp_nsec
    message.header.stamp = now if nanoseconds <= 0 else Time(
        sec=nanoseconds // BILLION, nanosec=nanoseconds % BILLION)
    message.header.frame_id = frame_prefix + (source.header.frame_id or ODOMETRY_FRAME)
    message.child_frame_id = frame_prefix + (source.child_frame_id or ROBOT_FRAME)
    pose, twist = message.pose, message.twist
    _copy(source.pose.pose.position, pose.pose.position, 'xyz')
    _copy(source.pose.pose.orientation, pose.pose.orientation, 'xyzw')
    _copy(source.twist.twist.linear, twist.twist.linear, 'xyz')
    _copy(source.twist.twist.angular, twist.twist.angular, 'xyz')
    for values, target in ((source.pose.covariance, pose), (source.twist.covariance, twist)):
        if len(values) == len(target.covariance):
            target.covariance = list(values)
    return message


def diagnostics(
        statuses: Sequence[Status], stamp: Time, robot: str, hardware: str) -> DiagnosticArray:
    """
    Return diagnostics.

    :param statuses: the entries
    :param stamp: when they were true
    :param robot: put before their names, for there may be more robots than one
    :param hardware: which robot it is
    :returns: the message
    """
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        DiagnosticStatus(
            level=bytes([status.level]), name=f'{robot}: {status.name}', message=status.message,
            hardware_id=hardware,
            values=[KeyValue(key=key, value=value) for key, value in status.values.items()])
        for status in statuses]
    return message


def _copy(source: Any, target: Any, names: str) -> None:
    for name in names:
        setattr(target, name, getattr(source, name))
