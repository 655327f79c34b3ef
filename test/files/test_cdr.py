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
"""ROS reads the paths, odometry and scans that we serialize, and we read its messages."""

from __future__ import annotations

from array import array
import contextlib
import math
import struct

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.files.cdr import (
    laser_scan,
    odometry,
    PathSerializer,
    read_laser_scan,
    read_odometry,
    read_twist,
    Scan,
)
from kachaka_simple_control.motion.geometry import Pose, Velocity
from optional_libraries import optional_imports
import pytest

with optional_imports():
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Odometry, Path
    from rclpy.serialization import deserialize_message, serialize_message
    from sensor_msgs.msg import LaserScan

pytestmark = pytest.mark.needs('nav_msgs', 'sensor_msgs')

SECOND = 1_000_000_000
TIMES = st.integers(0, 2 ** 31 * SECOND - 1)
FRAMES = st.one_of(
    st.sampled_from(['', 'a', 'odom', 'robot_1/odom', 'été']),
    st.text(st.characters(min_codepoint=1, blacklist_categories=['Cs']), max_size=20))
NUMBERS = st.floats(-1e6, 1e6)
FLOATS = st.floats(width=32)
RANGES = st.lists(FLOATS, max_size=20)
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


@given(TIMES, FRAMES, FRAMES, POSES, NUMBERS, NUMBERS)
def test_odometry_is_serialized_as_by_ros(time, frame, child, pose, linear_x, angular_z):
    meant = Odometry(child_frame_id=child)
    stamp(meant.header, frame, time)
    meant.pose.pose.position.x, meant.pose.pose.position.y = pose.x, pose.y
    meant.pose.pose.orientation.z = math.sin(pose.theta / 2.0)
    meant.pose.pose.orientation.w = math.cos(pose.theta / 2.0)
    meant.twist.twist.linear.x, meant.twist.twist.angular.z = linear_x, angular_z
    packed = odometry(pose, Velocity(linear_x, angular_z), time, frame, child)
    assert deserialize_message(packed, Odometry) == meant
    assert len(packed) == len(serialize_message(meant))


@given(TIMES, FRAMES, FRAMES, POSES, st.lists(NUMBERS, min_size=78, max_size=78))
def test_what_is_read_of_odometry_is_what_was_serialized(time, frame, child, pose, numbers):
    message = Odometry(child_frame_id=child)
    stamp(message.header, frame, time)
    position, orientation = message.pose.pose.position, message.pose.pose.orientation
    position.x, position.y, position.z = pose.x, pose.y, numbers[0]
    half = math.remainder(pose.theta, math.tau) / 2.0
    orientation.z, orientation.w = math.sin(half), math.cos(half)
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = numbers[:6]
    message.pose.covariance, message.twist.covariance = numbers[6:42], numbers[42:]
    read_frame, read_time, read_pose, velocity = read_odometry(bytes(serialize_message(message)))
    assert (read_frame.decode(), read_time) == (frame, time)
    assert (read_pose.x, read_pose.y) == (pose.x, pose.y)
    assert abs(math.remainder(read_pose.theta - pose.theta, math.tau)) < 1e-6
    assert velocity == Velocity(linear.x, angular.z)


def test_odometry_of_a_machine_with_another_byte_order_is_read_as_well():
    numbers = [1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 36, 0.1, *[0.0] * 4, 0.5, *[0.0] * 36]
    data = b'\0\0\0\0' + struct.pack('>iII5s3xI3s1x', 7, 8, 5, b'odom', 3, b'b') + struct.pack(
        f'>{len(numbers)}d', *numbers)
    assert read_odometry(data) == (
        b'odom', 7 * SECOND + 8, Pose(1.0, 2.0, 0.0), Velocity(0.1, 0.5))


@pytest.mark.parametrize('order, header', [('>', b'\0\0\0\0'), ('<', b'\0\1\0\0')])
def test_a_velocity_is_read_in_either_byte_order(order, header):
    data = header + struct.pack(f'{order}6d', 0.1, 2.0, 3.0, 4.0, 5.0, -0.5)
    assert read_twist(data) == Velocity(0.1, -0.5)


def same(numbers, others):
    """Return whether floats are equal; a NaN is equal to a NaN."""
    return [*map(repr, numbers)] == [*map(repr, others)]


@given(TIMES, FRAMES, st.lists(FLOATS, min_size=4, max_size=4), FLOATS, RANGES)
def test_a_scan_is_serialized_as_by_ros(time, frame, numbers, period, ranges):
    angle, increment, nearest, farthest = numbers
    packed = laser_scan(Scan(time, *numbers, ranges), period, frame)
    read = deserialize_message(packed, LaserScan)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == divmod(time, SECOND)
    assert read.header.frame_id == frame
    last, = array('f', [angle + increment * max(0, len(ranges) - 1)])
    assert same(
        [read.angle_min, read.angle_max, read.angle_increment, read.scan_time, read.range_min,
         read.range_max], [angle, last, increment, period, nearest, farthest])
    assert same(read.ranges, ranges)
    assert (read.time_increment, len(read.intensities)) == (0.0, 0)
    assert len(packed) == len(serialize_message(read))


def test_a_range_beyond_floats_is_infinite():
    read = read_laser_scan(laser_scan(Scan(0, 0.0, 0.1, 0.1, 8.0, [1e300, -1e300]), 0.1, ''))
    assert [*read.ranges] == [math.inf, -math.inf]


@given(TIMES, FRAMES, st.lists(FLOATS, min_size=7, max_size=7), RANGES, RANGES)
def test_what_is_read_of_a_scan_is_what_was_serialized(time, frame, numbers, ranges, intensities):
    message = LaserScan(ranges=ranges, intensities=intensities)
    stamp(message.header, frame, time)
    for name, number in zip((
            'angle_min', 'angle_max', 'angle_increment', 'time_increment', 'scan_time',
            'range_min', 'range_max'), numbers):
        setattr(message, name, number)
    read = read_laser_scan(bytes(serialize_message(message)))
    assert read.stamp == time
    assert same(read[1:5], [numbers[0], numbers[2], *numbers[5:]])
    assert same(read.ranges, ranges)


@pytest.mark.parametrize('order, header', [('>', b'\0\0\0\0'), ('<', b'\0\1\0\0')])
def test_a_scan_is_read_in_either_byte_order(order, header):
    data = header + struct.pack(
        f'{order}iII6s2x7fI2fI', 7, 8, 6, b'laser', *range(7), 2, 0.5, 2.0, 0)
    scan = read_laser_scan(data)
    assert scan._replace(ranges=[*scan.ranges]) == Scan(
        7 * SECOND + 8, 0.0, 2.0, 5.0, 6.0, [0.5, 2.0])


@given(FRAMES, RANGES, st.data())
def test_a_scan_of_which_a_part_is_missing_is_refused(frame, ranges, data):
    whole = laser_scan(Scan(0, 0.0, 0.1, 0.1, 8.0, ranges), 0.1, frame)
    # The last number, how many intensities there are, is not read.
    size = data.draw(st.integers(0, len(whole) - 5))
    with pytest.raises((struct.error, ValueError)):
        read_laser_scan(whole[:size])


@given(st.binary(max_size=200))
def test_bytes_that_are_no_scan_raise_no_other_error(data):
    with contextlib.suppress(struct.error, ValueError):
        read_laser_scan(data)
