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
``nav_msgs/msg/Path`` as its bytes on the wire.

As messages, two thousand poses keep Python busy for 11 ms whenever they are published, and the
thread that moves the robot waits.  Here each pose is packed once, when it comes.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
import struct

from kachaka_simple_control.motion.kinematics import Pose

#: Plain CDR, little-endian; what is aligned is so from behind these bytes.
ENCAPSULATION = b'\x00\x01\x00\x00'
#: The position and the orientation of a pose: seven doubles.
NUMBERS = struct.Struct('<7d')
STAMP = struct.Struct('<iI')
LENGTH = struct.Struct('<I')
DOUBLE = 8


class PathBytes:
    """Packs poses, and paths of packed poses, in one frame."""

    def __init__(self, frame: str) -> None:
        """
        Pack nothing yet.

        :param frame: the frame of all poses
        """
        name = frame.encode() + b'\x00'
        self._frame = LENGTH.pack(len(name)) + name
        #: from the start of a pose that is aligned like a double to its numbers
        self._gap = _padding(STAMP.size + len(self._frame), DOUBLE)

    def pose(self, pose: Pose, time: int = 0) -> bytes:
        """
        Pack a pose.

        :param pose: the pose
        :param time: when the robot is there [ns of ROS time]; 0 where that is not known
        :returns: it, as a path takes it
        """
        half = pose.theta / 2.0
        numbers = NUMBERS.pack(pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))
        return _stamp(time) + self._frame + self._gap + numbers

    def path(self, poses: Sequence[bytes], time: int) -> bytes:
        """
        Pack a path.

        :param poses: its poses, packed
        :param time: when it was so [ns of ROS time]
        :returns: the message
        """
        head = _stamp(time) + self._frame
        head += _padding(len(head), LENGTH.size) + LENGTH.pack(len(poses))
        if not poses:
            return ENCAPSULATION + head
        # The first pose may begin elsewhere than the others, between two places for doubles.
        head += _stamp_of(poses[0]) + self._frame
        head += _padding(len(head), DOUBLE) + poses[0][-NUMBERS.size:]
        return b''.join((ENCAPSULATION, head, *poses[1:]))


def _stamp(time: int) -> bytes:
    return STAMP.pack(*divmod(time, 1_000_000_000))


def _stamp_of(pose: bytes) -> bytes:
    return pose[:STAMP.size]


def _padding(length: int, alignment: int) -> bytes:
    return b'\x00' * (-length % alignment)
