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
"""A recording holds what happened, to the last bit, and others can read it whatever happened."""

import contextlib
import errno
import io
import itertools
import math
import os
from pathlib import Path
import tempfile

from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.motion.kinematics import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.report import bag
from kachaka_simple_control.report.bag import Bag
from kachaka_simple_control.report.bag_file import BagFile
from kachaka_simple_control.report.bag_messages import stamp
from kachaka_simple_control.report.bag_path import MOST, planned_path
from kachaka_simple_control.report.bag_schemas import definition
from kachaka_simple_control.report.events import Answered, Began, Opened, Planned, Sent
from kachaka_simple_control.report.record import Record
import pytest
from recordings import (
    header_stamp,
    read_with_mcap,
    read_with_rosbags,
    READERS,
    sent_velocities,
    stamp_of,
    velocities,
)
from strategies import KACHAKA, MOTIONS, UNHURRIED

pytest.importorskip('mcap', reason='needs what writes recordings')

LIMITS = Limits(0.3, 1.5)
TWIST = Opened(
    'test', 'kachaka', LIMITS, 0.3, 1.7e9 + 0.123456789, '/kachaka/manual_control/cmd_vel',
    '/kachaka/odometry/odometry')
STAMPED = Opened(
    'test', 'turtlebot3', LIMITS, 0.5, 1.6e9, '/cmd_vel', '/odom', 'TwistStamped', 'base')
PLANNED = Planned(Motion('bend', (Move(0.1, 0.5, 3.0),)), LIMITS, 10.0)
PATH = '/kachaka_simple_control/planned_path'
TYPES = ['geometry_msgs/msg/Twist', 'geometry_msgs/msg/TwistStamped', 'nav_msgs/msg/Odometry',
         'nav_msgs/msg/Path']

TIMES = st.floats(1.0, 1e6)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
VELOCITIES = st.builds(Velocity, NUMBERS, NUMBERS)
SENT = st.builds(Sent, TIMES, VELOCITIES)
ANSWERED = st.builds(
    Answered, TIMES, st.builds(Pose, NUMBERS, NUMBERS, st.floats(-100.0, 100.0)), VELOCITIES)


class Drive:
    """Events told to a record and to a bag in a folder."""

    def __init__(self, folder, opened=TWIST):
        """Begin one."""
        self.folder, self.opened = Path(folder), opened
        self.file = self.folder / 'run.mcap'
        self.record = Record()
        self.bag = Bag(self.folder, self.record)
        self.tell(opened, PLANNED)

    def tell(self, *events):
        """Tell events."""
        for event in events:
            self.record.hear(event)
            self.bag.hear(event)

    def send(self, first, count, velocity=0.1):
        """Tell velocities, one each 0.1 s."""
        self.tell(*(Sent(first + number / 10.0, Velocity(velocity, 0.0))
                    for number in range(count)))

    def expected(self, until=math.inf):
        """Return what is to be in the file."""
        return [velocity for velocity in sent_velocities(self.record.sent, self.opened)
                if velocity[0] <= (until if until == math.inf else stamp_of(self.opened, until))]


def exactly(rows):
    """Return numbers such that equal ones are equal to the last bit, and in a fixed order."""
    return sorted((row[0], *(value.hex() for value in row[1:])) for row in rows)


@given(st.sampled_from([TWIST, STAMPED]), st.lists(st.one_of(SENT, ANSWERED), max_size=30),
       st.lists(st.tuples(st.integers(0, 30), TIMES), max_size=3))
@settings(UNHURRIED, max_examples=60)
def test_what_was_told_is_what_both_readers_find(opened, told, flushes):
    """In any order of events, with any flushes in between: equal stamps, equal bits."""
    with tempfile.TemporaryDirectory() as folder:
        drive = Drive(folder, opened)
        for number, event in enumerate(told):
            for _, until in (flush for flush in flushes if flush[0] == number):
                drive.bag.flush(until)
            drive.tell(event)
        assert drive.bag.finish() is None
        for read in (*READERS, lambda file: read_with_rosbags(file.parent)):
            found = read(drive.file)
            assert exactly(velocities(found, opened)) == exactly(drive.expected())
            poses = [one for one in found if one.topic == opened.odometry_topic]
            assert exactly(map(pose_row, poses)) == exactly(
                expected_row(opened, one) for one in drive.record.odometry)
            assert [one.stamp for one in found] == sorted(one.stamp for one in found)


def pose_row(read):
    """Return the figures of a message of odometry."""
    message = read.message
    assert header_stamp(message) == read.stamp
    assert (message.header.frame_id, message.child_frame_id) == ('odom', 'base_link')
    pose, twist = message.pose.pose, message.twist.twist
    assert len(message.pose.covariance) == len(message.twist.covariance) == 36
    return (read.stamp, pose.position.x, pose.position.y, pose.orientation.z,
            pose.orientation.w, twist.linear.x, twist.angular.z)


def expected_row(opened, answered):
    """Return the figures that a message of odometry must have."""
    pose, velocity = answered.pose, answered.velocity
    return (stamp_of(opened, answered.time), pose.x, pose.y, math.sin(pose.theta / 2.0),
            math.cos(pose.theta / 2.0), velocity.linear_x, velocity.angular_z)


@given(st.floats(1e9, 2e9), TIMES, TIMES)
def test_stamps_are_as_far_apart_as_their_times(epoch, one, two):
    apart = stamp(epoch, two) - stamp(epoch, one)
    assert apart == round(two * 1e9) - round(one * 1e9)
    assert stamp(epoch, one) / 1e9 == pytest.approx(epoch + one, abs=1e-6)


@pytest.mark.parametrize('message_type', TYPES)
def test_the_definitions_are_those_of_ros(message_type):
    """Judged by the hash that ROS itself tells types apart by."""
    typesys = pytest.importorskip('rosbags.typesys')
    ours = typesys.get_typestore(typesys.Stores.EMPTY)
    ours.register(typesys.get_types_from_msg(definition(message_type), message_type))
    theirs = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    assert ours.hash_rihs01(message_type) == theirs.hash_rihs01(message_type)


@pytest.mark.parametrize('read', READERS)
def test_the_path_leads_from_where_the_robot_is_to_where_the_plan_ends(read, tmp_path):
    drive = Drive(tmp_path)
    start = Pose(1.0, -2.0, math.pi / 2.0)
    drive.tell(Answered(9.9, start), Sent(10.0, Velocity(0.1, 0.5)), Began(10.0))
    assert drive.bag.finish() is None
    (path,) = [one for one in read(drive.file) if one.topic == PATH]
    first, last = path.message.poses[0], path.message.poses[-1]
    assert (first.pose.position.x, first.pose.position.y) == (1.0, -2.0)
    assert header_stamp(path.message) == header_stamp(first) == path.stamp
    assert header_stamp(last) - header_stamp(first) == 3_000_000_000
    end = plan(PLANNED.motion, LIMITS, 10.0).path(start)[-1]
    assert last.pose.position.x == pytest.approx(end.x, abs=1e-12)
    assert last.pose.orientation.w == pytest.approx(math.cos(end.theta / 2.0), abs=1e-12)
    assert path.message.header.frame_id == 'odom'


@given(MOTIONS, st.integers(1, 50))
@UNHURRIED
def test_a_path_is_thinned_and_keeps_its_end(motion, most):
    planned = plan(motion, KACHAKA, 10.0)
    start = Pose(3.0, 2.0, 1.0)
    places = planned_path(planned, start, most)
    assert places[0] == (0.0, start)
    assert len(places) <= most + 2
    assert [time for time, _ in places] == sorted(time for time, _ in places)
    end = planned.path(start)[-1]
    assert places[-1][0] == pytest.approx(planned.duration)
    assert (places[-1][1].x, places[-1][1].y, places[-1][1].theta) == pytest.approx(
        (end.x, end.y, end.theta), abs=1e-9)
    ends = planned.path(start)[1:]
    by_time = {segment.end: pose for segment, pose in zip(planned.segments, ends)}
    for time, pose in places:
        if time in by_time:
            assert math.hypot(pose.x - by_time[time].x, pose.y - by_time[time].y) < 1e-9


def test_a_circle_driven_at_one_velocity_is_a_circle():
    places = planned_path(plan(Motion('circle', (Move(0.1, 0.5, 4.0 * math.pi),)), LIMITS, 10.0))
    assert 50 < len(places) < MOST
    assert all(math.hypot(pose.x, pose.y - 0.2) == pytest.approx(0.2) for _, pose in places)


def test_the_folder_is_a_bag_with_all_that_rosbag2_asks_for(tmp_path):
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    drive = Drive(tmp_path, STAMPED)
    drive.send(10.0, 20)
    drive.tell(Began(10.0), Answered(10.5, Pose()))
    assert drive.bag.finish() is None
    (tmp_path / 'report.html').write_text('other files do no harm')
    with rosbag2.Reader(tmp_path) as reader, rosbag2.Reader(drive.file) as file:
        assert reader.message_count == file.message_count == 22
        assert (reader.start_time, reader.duration) == (file.start_time, file.duration)
        assert reader.duration == 1_900_000_001
        counts = {one.topic: (one.msgtype, one.msgcount) for one in reader.connections}
        assert counts == {
            '/cmd_vel': ('geometry_msgs/msg/TwistStamped', 20),
            '/odom': ('nav_msgs/msg/Odometry', 1), PATH: ('nav_msgs/msg/Path', 1)}
        for ours, theirs in zip(sorted(reader.connections), sorted(file.connections)):
            assert ours.ext == theirs.ext
            assert ours.msgdef == theirs.msgdef
        qualities = {one.topic: one.ext.offered_qos_profiles[0] for one in reader.connections}
        assert qualities['/cmd_vel'].reliability.name == 'RELIABLE'
        assert qualities['/cmd_vel'].durability.name == 'VOLATILE'
        assert qualities['/odom'].reliability.name == 'BEST_EFFORT'
        assert qualities[PATH].durability.name == 'TRANSIENT_LOCAL'


def test_the_file_says_what_it_is(tmp_path):
    make_reader = pytest.importorskip('mcap.reader').make_reader
    drive = Drive(tmp_path)
    drive.send(10.0, 3)
    assert drive.bag.finish() is None
    with drive.file.open('rb') as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        assert {schema.encoding for schema in summary.schemas.values()} == {'ros2msg'}
        assert {channel.message_encoding for channel in summary.channels.values()} == {'cdr'}
        assert summary.statistics.message_count == 3
        assert summary.chunk_indexes
        (metadata,) = reader.iter_metadata()
        assert metadata.name == 'rosbag2'
        assert 'message_count: 3' in metadata.metadata['serialized_metadata']


@pytest.mark.parametrize('read', READERS)
def test_the_file_is_whole_after_each_flush(read, tmp_path):
    """Whatever ends the program: nothing was finished here."""
    drive = Drive(tmp_path)
    assert read(drive.file) == []
    for first in range(10, 15):
        drive.send(float(first), 10)
        until = first + 0.85
        drive.bag.flush(until)
        assert velocities(read(drive.file), TWIST) == drive.expected(until)


def test_what_was_told_late_comes_in_its_place(tmp_path):
    """Threads tell what happens, and one may be overtaken by another."""
    drive = Drive(tmp_path)
    drive.send(10.0, 5)
    drive.bag.flush(10.25)
    drive.tell(Answered(10.26, Pose()))
    drive.bag.flush(11.0)
    for read in READERS:
        stamps = [one.stamp for one in read(drive.file)]
        assert len(stamps) == 6
        assert stamps == sorted(stamps)


def test_a_file_cut_off_in_a_part_is_readable_up_to_that_part(tmp_path):
    """A program killed within a write leaves this; `mcap recover` reads it likewise."""
    stream_reader = pytest.importorskip('mcap.stream_reader')
    drive = Drive(tmp_path)
    sizes = []
    for first in range(10, 13):
        drive.send(float(first), 10)
        drive.bag.flush(first + 1.0)
        sizes.append(drive.file.stat().st_size)
    data = drive.file.read_bytes()
    for size in range(sizes[0], sizes[2], 7):
        whole, found = sum(size >= end for end in sizes) * 10, 0
        with contextlib.suppress(Exception):  # each cut ends it in a way of its own
            for record in stream_reader.StreamReader(io.BytesIO(data[:size])).records:
                found += type(record).__name__ == 'Message'
        assert found >= whole


def full_from(limit, monkeypatch):
    """Let no file grow beyond a size, as a full disk does: what fits is written first."""
    write = os.pwrite

    def pwrite(descriptor, data, offset):
        room = limit - offset
        if room <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data[:room], offset)

    monkeypatch.setattr(os, 'pwrite', pwrite)


@pytest.mark.parametrize('limit', range(200, 4000, 97))
def test_a_full_disk_ends_the_recording_and_leaves_what_was_there(limit, monkeypatch, tmp_path):
    full_from(limit, monkeypatch)
    drive = Drive(tmp_path)
    stored = 0
    for first in range(10, 30):
        drive.send(float(first), 10, velocity=first / 1000.0)
        drive.tell(Answered(first + 0.5, Pose(first / 7.0, first / 3.0)))
        drive.bag.flush(first + 1.0)
        stored += 0 if drive.bag.failure else 11
    assert drive.bag.finish() == 'run.mcap ends early: No space left on device'
    assert drive.file.stat().st_size <= limit
    for read in READERS:
        assert len(read(drive.file)) == stored
    if stored:
        assert len(read_with_rosbags(tmp_path)) == stored
    # Without messages, a file has no topics that a bag could name.
    assert (tmp_path / 'metadata.yaml').exists() == bool(stored)
    assert str(drive.file) not in [
        str(link.readlink()) for link in Path('/proc/self/fd').glob('*') if link.is_symlink()]


def test_a_disk_without_any_room_leaves_no_file(monkeypatch, tmp_path):
    full_from(10, monkeypatch)
    drive = Drive(tmp_path)
    drive.send(10.0, 3)
    drive.bag.flush(20.0)
    assert drive.bag.finish() == 'run.mcap is left out: No space left on device'
    assert not drive.file.exists()


def test_a_full_disk_at_the_very_end_costs_the_index_alone(monkeypatch, tmp_path):
    drive = Drive(tmp_path)
    drive.send(10.0, 10)
    drive.bag.flush(20.0)
    full_from(drive.file.stat().st_size, monkeypatch)
    assert drive.bag.finish() == 'run.mcap ends early: No space left on device'
    for read in READERS:
        assert velocities(read(drive.file), TWIST) == drive.expected()


def test_a_full_disk_after_the_recording_leaves_no_half_of_a_description(monkeypatch, tmp_path):
    def write_text(self, text, encoding):
        self.write_bytes(text[:100].encode(encoding))
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, 'write_text', write_text)
    drive = Drive(tmp_path)
    drive.send(10.0, 10)
    assert drive.bag.finish() == 'metadata.yaml is left out: No space left on device'
    assert list(tmp_path.iterdir()) == [drive.file]
    for read in READERS:
        assert velocities(read(drive.file), TWIST) == drive.expected()


def test_a_failure_of_another_kind_ends_the_recording_too(monkeypatch, tmp_path):
    drive = Drive(tmp_path)
    drive.send(10.0, 10)
    drive.bag.flush(20.0)
    monkeypatch.setattr(BagFile, 'flush', lambda self: 1 // 0)
    drive.send(12.0, 10)
    drive.bag.flush(20.0)
    assert drive.bag.failure.startswith('run.mcap ends early: ZeroDivisionError')
    assert drive.bag.finish() == drive.bag.failure
    assert len(read_with_mcap(drive.file)) == 10


def test_without_the_library_the_recording_is_left_out_in_a_sentence(monkeypatch, tmp_path):
    monkeypatch.setattr(bag.importlib.util, 'find_spec', lambda name: None)
    drive = Drive(tmp_path)
    drive.send(10.0, 3)
    drive.bag.flush(20.0)
    assert drive.bag.finish() == (
        "run.mcap is left out: it needs mcap 1.5 or newer: pip install 'mcap>=1.5'")
    assert list(tmp_path.iterdir()) == []


def test_an_old_library_is_told_from_a_new_one(monkeypatch, tmp_path):
    from mcap.writer import Writer
    monkeypatch.delattr(Writer, 'flush')
    drive = Drive(tmp_path)
    assert drive.bag.finish() == (
        "run.mcap is left out: it needs mcap 1.5 or newer: pip install 'mcap>=1.5'")
    assert list(tmp_path.iterdir()) == []


def test_a_minute_at_50_hz_takes_little_room(tmp_path):
    """And so does an hour: 36 MB at most."""
    drive = Drive(tmp_path)
    for second, tick in itertools.product(range(60), range(50)):
        time = 10.0 + second + tick / 50.0
        drive.tell(Sent(time, Velocity(0.1, 0.001 * tick)), Answered(time, Pose(time, 0.0, 0.1)))
        if tick == 0:
            drive.bag.flush(time)
    assert drive.bag.finish() is None
    assert drive.file.stat().st_size < 60 * 10_000
