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
"""What happens as bytes: messages in CDR, the form in which ROS 2 sends and records them."""

from __future__ import annotations

import math
import struct

from kachaka_simple_control.motion.kinematics import Pose, Velocity

#: Little endian, and no options.
HEAD = b'\x00\x01\x00\x00'
#: The frames that poses and velocities are told in, by REP-105.
ODOM, BASE = 'odom', 'base_link'
NANO = 1_000_000_000
#: All zeros: nobody knows.
COVARIANCE = (0.0,) * 36


def stamp(epoch: float, time: float) -> int:
    """
    Return a time of the steady clock as recordings have it.

    Rounded apart, the two keep what a sum of floats would lose: the difference between two
    stamps is that of their times, to the nanosecond.

    :param epoch: what to add to a time of the steady clock for the time since 1970 [s]
    :param time: when [s on the steady clock]
    :returns: the time since 1970 [ns]
    """
    return round(epoch * NANO) + round(time * NANO)


def twist(velocity: Velocity) -> bytes:
    """
    Return a velocity as ``geometry_msgs/msg/Twist``.

    :param velocity: the velocity
    :returns: the message
    """
    return _Cdr().velocity(velocity).message()


def twist_stamped(velocity: Velocity, when: int, frame: str) -> bytes:
    """
    Return a velocity as ``geometry_msgs/msg/TwistStamped``.

    :param velocity: the velocity
    :param when: when it was sent [ns since 1970]
    :param frame: the frame it is told in
    :returns: the message
    """
    return _Cdr().header(when, frame).velocity(velocity).message()


def odometry(pose: Pose, velocity: Velocity, when: int) -> bytes:
    """
    Return what odometry told as ``nav_msgs/msg/Odometry``.

    :param pose: where the robot was
    :param velocity: how fast it was
    :param when: when that arrived [ns since 1970]
    :returns: the message
    """
    return (_Cdr().header(when, ODOM).text(BASE)
            .pose(pose).doubles(*COVARIANCE)
            .velocity(velocity).doubles(*COVARIANCE).message())


class _Cdr:
    """A message being put together: each number stands at a multiple of its own size."""

    def __init__(self) -> None:
        self._data = bytearray()

    def message(self) -> bytes:
        return HEAD + bytes(self._data)

    def number(self, value: int) -> _Cdr:
        return self._put(4, '<I', value)

    def doubles(self, *values: float) -> _Cdr:
        return self._put(8, f'<{len(values)}d', *values)

    def text(self, value: str) -> _Cdr:
        data = value.encode() + b'\0'
        self.number(len(data))
        self._data += data
        return self

    def header(self, when: int, frame: str) -> _Cdr:
        return self._put(4, '<iI', *divmod(when, NANO)).text(frame)

    def velocity(self, velocity: Velocity) -> _Cdr:
        return self.doubles(velocity.linear_x, 0.0, 0.0, 0.0, 0.0, velocity.angular_z)

    def pose(self, pose: Pose) -> _Cdr:
        half = pose.theta / 2.0
        return self.doubles(pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))

    def _put(self, size: int, form: str, *values: float) -> _Cdr:
        self._data += bytes(-len(self._data) % size) + struct.pack(form, *values)
        return self
