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
"""ROS reads the path that we serialize."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.telemetry.cdr import PathSerializer
from optional_libraries import optional_imports
import pytest

with optional_imports():
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Path
    from rclpy.serialization import deserialize_message, serialize_message

pytestmark = pytest.mark.needs('nav_msgs')

SECOND = 1_000_000_000
TIMES = st.integers(0, 2 ** 31 * SECOND - 1)
FRAMES = st.one_of(
    st.sampled_from(['', 'a', 'odom', 'robot_1/odom', 'été']),
    st.text(st.characters(min_codepoint=1, blacklist_categories=['Cs']), max_size=20))
NUMBERS = st.floats(-1e6, 1e6)
POSES = st.builds(Pose, NUMBERS, NUMBERS, st.floats(-10.0, 10.0))


def stamp(header, frame, time):
    """Fill a header."""
    header.frame_id = frame
    header.stamp.sec, header.stamp.nanosec = divmod(time, SECOND)


def message(frame, poses, time):
    """Return the expected path."""
    path = Path()
    stamp(path.header, frame, time)
    for pose, when in poses:
        stamped = PoseStamped()
        stamp(stamped.header, frame, when)
        stamped.pose.position.x, stamped.pose.position.y = pose.x, pose.y
        stamped.pose.orientation.z = math.sin(pose.theta / 2.0)
        stamped.pose.orientation.w = math.cos(pose.theta / 2.0)
        path.poses.append(stamped)
    return path


@given(FRAMES, st.lists(st.tuples(POSES, TIMES), max_size=5), TIMES)
def test_a_path_is_serialized_as_by_ros(frame, poses, time):
    own = PathSerializer(frame)
    packed = own.path([own.pose(pose, when) for pose, when in poses], time)
    meant = message(frame, poses, time)
    # Not the bytes: the padding that ROS leaves is undefined.
    assert deserialize_message(packed, Path) == meant
    assert len(packed) == len(serialize_message(meant))
