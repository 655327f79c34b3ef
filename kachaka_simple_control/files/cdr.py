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
"""Serialize velocities, odometry, paths and numbers as ROS 2 messages in CDR, without ROS."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from functools import lru_cache
import math
import struct
import sys
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import Pose, Velocity, yaw

#: The encapsulation header of plain little-endian CDR (CDR_LE in DDSI-RTPS).  The alignment of the
#: data is counted from the end of this header.
ENCAPSULATION = b'\x00\x01\x00\x00'
#: The frames of poses and of velocities, according to REP-105.
ODOM, BASE = 'odom', 'base_link'
#: Size of a time stamp, and of the position and orientation of a pose [bytes].
STAMP_SIZE, POSE_SIZE = 8, 56
NANO = 1_000_000_000
#: The number of bytes from the start of the velocity, and from the start of the pose, to the end
#: of a serialized Odometry message.  A covariance of 36 numbers follows the pose and the velocity.
VELOCITY_TO_END, POSE_TO_END = (6 + 36) * 8, (7 + 36 + 6 + 36) * 8
#: The numbers of a velocity, and of an Odometry message with covariances of zeros, which mean that
#: they are unknown; as ``struct`` wants them.
TWIST_NUMBERS = '6d'
ODOMETRY_NUMBERS = f'7d{36 * 8}x6d{36 * 8}x'
TWIST = struct.Struct(f'<4s{TWIST_NUMBERS}')
#: How the numbers of a Twist are read: big-endian, little-endian.
TWIST_READERS = struct.Struct(f'>{TWIST_NUMBERS}'), struct.Struct(f'<{TWIST_NUMBERS}')
#: How many combinations of frames are kept: more than a fleet has.
MAX_LAYOUTS = 1024


class CdrWriter:
    """Writes plain little-endian CDR; each number is aligned to its size."""

    def __init__(self) -> None:
        self.data = bytearray()

    def message(self) -> bytes:
        """Return the complete message: the encapsulation header of CDR and the written data."""
        return ENCAPSULATION + bytes(self.data)

    def append(self, data: bytes, alignment: int = 1) -> CdrWriter:
        """Append zero bytes up to an alignment [bytes], then data; return this writer."""
        self.data += bytes(-len(self.data) % alignment) + data
        return self

    def uint32(self, value: int) -> CdrWriter:
        """Append an unsigned integer of 32 bits, and return this writer."""
        return self.append(struct.pack('<I', value), 4)

    def doubles(self, *values: float) -> CdrWriter:
        """Append numbers as floats of 64 bits, and return this writer."""
        return self.append(struct.pack(f'<{len(values)}d', *values), 8)

    def string(self, value: str) -> CdrWriter:
        """Append the length of a string and the string in UTF-8, and return this writer."""
        data = value.encode() + b'\0'
        return self.uint32(len(data)).append(data)

    def header(self, time: int, frame: str) -> CdrWriter:
        """Append a ``std_msgs/msg/Header`` with a time stamp [ns], and return this writer."""
        return self.append(struct.pack('<iI', *divmod(time, NANO)), 4).string(frame)

    def pose(self, pose: Pose) -> CdrWriter:
        """Append a pose as a ``geometry_msgs/msg/Pose``, and return this writer."""
        half = pose.theta / 2.0
        return self.doubles(pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))


@lru_cache(MAX_LAYOUTS)
def _layout(numbers: str, *names: str) -> tuple[struct.Struct, bytes]:
    """
    Return how a message with a header is packed, and what its names are packed to.

    :param names: the frame of the header, and the texts between it and the numbers
    """
    writer = CdrWriter().header(0, names[0])
    for name in names[1:]:
        writer.string(name)
    packed = bytes(writer.append(b'', 8).data[STAMP_SIZE:])
    return struct.Struct(f'<4siI{len(packed)}s{numbers}'), packed


def twist(velocity: Velocity) -> bytes:
    """Return a velocity as a serialized ``geometry_msgs/msg/Twist``."""
    return TWIST.pack(
        ENCAPSULATION, velocity.linear_x, 0.0, 0.0, 0.0, 0.0, velocity.angular_z)


def twist_stamped(velocity: Velocity, time: int, frame: str) -> bytes:
    """Return a serialized ``geometry_msgs/msg/TwistStamped`` with a time stamp [ns]."""
    layout, names = _layout(TWIST_NUMBERS, frame)
    return layout.pack(
        ENCAPSULATION, *divmod(time, NANO), names,
        velocity.linear_x, 0.0, 0.0, 0.0, 0.0, velocity.angular_z)


def read_twist(data: bytes) -> Velocity:
    """Read a serialized Twist message; its numbers may be NaN or infinite."""
    linear_x, *_, angular_z = TWIST_READERS[data[1] & 1].unpack_from(data, len(ENCAPSULATION))
    return Velocity(linear_x, angular_z)


def float64(value: float) -> bytes:
    """Return a number as a serialized ``std_msgs/msg/Float64``."""
    return CdrWriter().doubles(value).message()


def odometry(
        pose: Pose, velocity: Velocity, time: int, frame: str = ODOM, child: str = BASE) -> bytes:
    """Return a serialized ``nav_msgs/msg/Odometry`` with a time stamp [ns]."""
    layout, names = _layout(ODOMETRY_NUMBERS, frame, child)
    half = pose.theta / 2.0
    return layout.pack(
        ENCAPSULATION, *divmod(time, NANO), names,
        pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half),
        velocity.linear_x, 0.0, 0.0, 0.0, 0.0, velocity.angular_z)


def read_odometry(data: bytes) -> tuple[bytes, int, Pose, Velocity]:
    """
    Read the frame, the time stamp [ns], the pose and the velocity of an Odometry message.

    :returns: the heading of the pose is between -pi and pi [rad]
    """
    order = '<' if data[1] & 1 else '>'
    seconds, nanoseconds, length = struct.unpack_from(f'{order}iII', data, len(ENCAPSULATION))
    begin = len(ENCAPSULATION) + STAMP_SIZE + 4
    x, y, _, qx, qy, qz, qw = struct.unpack_from(f'{order}7d', data, len(data) - POSE_TO_END)
    linear_x, *_, angular_z = struct.unpack_from(f'{order}6d', data, len(data) - VELOCITY_TO_END)
    return (data[begin:begin + length - 1], seconds * NANO + nanoseconds,
            Pose(x, y, yaw(qx, qy, qz, qw)), Velocity(linear_x, angular_z))


class Scan(NamedTuple):
    """
    A scan of a laser, as ``sensor_msgs/msg/LaserScan`` has it.

    :param stamp: when its first range was measured [ns]
    :param angle: of the first range, in the frame of the laser [rad]
    :param increment: between two ranges [rad]
    :param nearest: a smaller range says nothing [m]
    :param farthest: a larger range says nothing [m]
    :param ranges: any number, also infinite, NaN and 0 [m]
    """

    stamp: int
    angle: float
    increment: float
    nearest: float
    farthest: float
    ranges: Sequence[float]


def laser_scan(scan: Scan, period: float, frame: str) -> bytes:
    """
    Return a serialized ``sensor_msgs/msg/LaserScan``; a number above those of a float is infinite.

    :param period: the time between two scans [s]
    """
    count = len(scan.ranges)
    last = scan.angle + scan.increment * max(0, count - 1)
    return CdrWriter().header(scan.stamp, frame).append(_floats(
        scan.angle, last, scan.increment, 0.0, period, scan.nearest, scan.farthest), 4,
    ).uint32(count).append(_floats(*scan.ranges)).uint32(0).message()


def _floats(*values: float) -> bytes:
    """Return numbers as little-endian floats of 32 bits."""
    # Unlike struct, an array makes a number that is too large infinite.
    floats = array('f', values)
    if sys.byteorder == 'big':
        floats.byteswap()
    return floats.tobytes()


def read_laser_scan(data: bytes) -> Scan:
    """
    Read a serialized LaserScan message.

    :raises ValueError: if a part of it is missing; or a ``struct.error``
    """
    kind, = struct.unpack_from('>H', data)
    order = '<' if kind & 1 else '>'
    seconds, nanoseconds, length = struct.unpack_from(f'{order}iII', data, len(ENCAPSULATION))
    # The frame is followed by zero bytes up to a multiple of 4.
    place = len(ENCAPSULATION) + STAMP_SIZE + 4 + length + -length % 4
    numbers = struct.Struct(f'{order}7fI')
    angle, _, increment, _, _, nearest, farthest, count = numbers.unpack_from(data, place)
    place += numbers.size
    ranges = array('f', data[place:place + 4 * count])
    if len(ranges) != count:
        raise ValueError(f'a scan of {count} ranges has {len(ranges)}')
    if (order == '<') != (sys.byteorder == 'little'):
        ranges.byteswap()
    return Scan(seconds * NANO + nanoseconds, angle, increment, nearest, farthest, ranges)


class PathSerializer:
    """Serializes poses once each, and makes ``nav_msgs/msg/Path`` messages of them."""

    def __init__(self, frame: str) -> None:
        self._frame = frame

    def pose(self, pose: Pose, time: int = 0) -> bytes:
        """
        Serialize a pose for ``path``.

        :param time: when the robot is at the pose [ns of ROS time]; 0 if unknown
        """
        return bytes(CdrWriter().header(time, self._frame).pose(pose).data)

    def path(self, poses: Sequence[bytes], time: int) -> bytes:
        """Return a serialized ``nav_msgs/msg/Path`` with a time stamp [ns of ROS time]."""
        writer = CdrWriter().header(time, self._frame).uint32(len(poses))
        if not poses:
            return writer.message()
        # The first pose may start at any multiple of 4; each later pose starts at a multiple of 8.
        writer.append(poses[0][:STAMP_SIZE], 4).string(self._frame)
        writer.append(poses[0][-POSE_SIZE:], 8)
        return b''.join((writer.message(), *poses[1:]))
