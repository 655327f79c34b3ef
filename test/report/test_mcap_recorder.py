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
"""A recording holds what happened, to the last bit, and others can read it."""

from dataclasses import replace
import itertools
import json
import math
import tempfile

from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.events import (
    MotionStarted,
    OdometryReceived,
    RobotEvent,
    ScanReceived,
    SpeedFactorChanged,
    VelocitySent,
    WatchChanged,
    WatchState,
)
from kachaka_simple_control.motion.drive_order import MotionText
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.report.mcap_recorder import McapRecorder
from messages import of_plan
import pytest
from recorded_drive import LIMITS, PLANNED, RecordedDrive, STAMPED, TWIST
from recordings import (
    header_stamp,
    read_with_rosbags,
    READERS,
    sent_velocities,
    stamp_of,
    velocities,
)

pytestmark = pytest.mark.needs('mcap')

PATH = '/kachaka_simple_control/planned_path'
FACTOR = '/kachaka_simple_control/speed_factor'
WATCH = '/kachaka_simple_control/obstacle_watch'

TIMES = st.floats(1.0, 1e6)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
VELOCITIES = st.builds(Velocity, NUMBERS, NUMBERS)
SENT = st.builds(VelocitySent, TIMES, VELOCITIES)
ANSWERED = st.builds(
    OdometryReceived, TIMES, st.builds(Pose, NUMBERS, NUMBERS, st.floats(-100.0, 100.0)),
    VELOCITIES)


def exactly(rows):
    """Return numbers such that equal ones are equal to the last bit, and in a fixed order."""
    return sorted((row[0], *(value.hex() for value in row[1:])) for row in rows)


@pytest.mark.slow
@given(st.sampled_from([TWIST, STAMPED]), st.lists(st.one_of(SENT, ANSWERED), max_size=30),
       st.lists(st.tuples(st.integers(0, 30), TIMES), max_size=3))
@settings(max_examples=30)
def test_both_readers_find_what_was_published(opened, told, flushes):
    """In any order of events, with any flushes in between: equal stamps, equal bits."""
    with tempfile.TemporaryDirectory() as folder:
        drive = RecordedDrive(folder, opened)
        for number, event in enumerate(told):
            for _, until in (flush for flush in flushes if flush[0] == number):
                drive.recorder.flush(until)
            drive.publish(event)
        assert drive.recorder.finish() is None
        for read in (*READERS, lambda file: read_with_rosbags(file.parent)):
            found = read(drive.file)
            assert exactly(velocities(found, opened)) == exactly(drive.expected())
            poses = [one for one in found if one.topic == opened.odometry_topic]
            assert exactly(map(pose_row, poses)) == exactly(
                expected_row(opened, one) for one in drive.drive_log.odometry)
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


@pytest.mark.parametrize('read', READERS)
def test_the_path_leads_from_where_the_robot_is_to_where_the_plan_ends(read, tmp_path):
    drive = RecordedDrive(tmp_path)
    start = Pose(1.0, -2.0, math.pi / 2.0)
    drive.publish(
        OdometryReceived(9.9, start), MotionStarted(10.0), of_plan(10.0, Velocity(0.1, 0.5), 10.0))
    assert drive.recorder.finish() is None
    (path,) = [one for one in read(drive.file) if one.topic == PATH]
    first, last = path.message.poses[0], path.message.poses[-1]
    assert (first.pose.position.x, first.pose.position.y) == (1.0, -2.0)
    assert header_stamp(path.message) == path.stamp
    # Poses that are only planned have no time.
    assert {header_stamp(pose) for pose in path.message.poses} == {0}
    end = plan(PLANNED.motion, LIMITS, 10.0).path(start)[-1]
    assert last.pose.position.x == pytest.approx(end.x, abs=1e-12)
    assert last.pose.orientation.w == pytest.approx(math.cos(end.theta / 2.0), abs=1e-12)
    assert path.message.header.frame_id == 'odom'


@pytest.mark.parametrize('read', READERS)
@pytest.mark.parametrize(('before', 'first'), [([], (10.0, 1.0)), (
    [SpeedFactorChanged(9.0, {'override': 0.5})], (9.0, 0.5))])
def test_the_speed_factor_is_recorded_from_the_start_on(read, before, first, tmp_path):
    drive = RecordedDrive(tmp_path)
    drive.publish(*before)
    drive.send(10.0, 3)
    drive.publish(SpeedFactorChanged(10.25, {'override': 0.5, 'pause': 0.0}),
                  SpeedFactorChanged(11.0, {'override': 0.5, 'obstacle': 0.4}))
    assert drive.recorder.finish() is None
    found = [(one.stamp, one.message.data) for one in read(drive.file) if one.topic == FACTOR]
    assert found == [
        (stamp_of(TWIST, time), factor) for time, factor in (first, (10.25, 0.0), (11.0, 0.2))]


@pytest.mark.parametrize('read', READERS)
def test_what_the_obstacle_watch_says_is_recorded_as_json(read, tmp_path):
    drive = RecordedDrive(tmp_path)
    drive.send(10.0, 3)
    drive.recorder.flush(10.05)  # its topic comes later than the others
    drive.publish(ScanReceived(10.1, ((1.0, 0.0),)),
                  WatchChanged(10.15, WatchState.OBSTACLE, 0.31, 0.0))
    drive.recorder.flush(10.5)
    drive.publish(WatchChanged(11.0, WatchState.CLEAR))
    assert drive.recorder.finish() is None
    found = [(one.stamp, json.loads(one.message.data)) for one in read(drive.file)
             if one.topic == WATCH]
    assert found == [
        (stamp_of(TWIST, 10.15), {'state': 'obstacle', 'distance': 0.31, 'angle': 0.0}),
        (stamp_of(TWIST, 11.0), {'state': 'clear', 'distance': None, 'angle': None})]
    assert f'name: "{WATCH}"' in (tmp_path / 'metadata.yaml').read_text()


def test_the_folder_is_a_bag_with_all_that_rosbag2_requires(tmp_path):
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    drive = RecordedDrive(tmp_path, STAMPED)
    drive.send(10.0, 20)
    drive.publish(MotionStarted(10.0), OdometryReceived(10.5, Pose()))
    assert drive.recorder.finish() is None
    (tmp_path / 'report.html').write_text('other files do no harm')
    with rosbag2.Reader(tmp_path) as reader, rosbag2.Reader(drive.file) as file:
        assert reader.message_count == file.message_count == 23
        assert (reader.start_time, reader.duration) == (file.start_time, file.duration)
        assert reader.duration == 1_900_000_001
        counts = {one.topic: (one.msgtype, one.msgcount) for one in reader.connections}
        assert counts == {
            '/cmd_vel': ('geometry_msgs/msg/TwistStamped', 20),
            '/odom': ('nav_msgs/msg/Odometry', 1), PATH: ('nav_msgs/msg/Path', 1),
            FACTOR: ('std_msgs/msg/Float64', 1)}
        for ours, theirs in zip(sorted(reader.connections), sorted(file.connections)):
            assert ours.ext == theirs.ext
            assert ours.msgdef == theirs.msgdef
        qualities = {one.topic: one.ext.offered_qos_profiles[0] for one in reader.connections}
        assert qualities['/cmd_vel'].reliability.name == 'RELIABLE'
        assert qualities['/cmd_vel'].durability.name == 'VOLATILE'
        assert qualities['/odom'].reliability.name == 'BEST_EFFORT'
        for topic in (PATH, FACTOR):
            assert qualities[topic].durability.name == 'TRANSIENT_LOCAL'


def test_the_file_has_its_metadata(tmp_path):
    make_reader = pytest.importorskip('mcap.reader').make_reader
    drive = RecordedDrive(tmp_path)
    drive.send(10.0, 3)
    assert drive.recorder.finish() is None
    with drive.file.open('rb') as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        assert {schema.encoding for schema in summary.schemas.values()} == {'ros2msg'}
        assert {channel.message_encoding for channel in summary.channels.values()} == {'cdr'}
        assert summary.statistics.message_count == 4
        assert summary.chunk_indexes
        (metadata,) = reader.iter_metadata()
        assert metadata.name == 'rosbag2'
        assert 'message_count: 4' in metadata.metadata['serialized_metadata']


def test_the_file_of_a_motion_is_kept_before_the_robot_moves(tmp_path):
    """Of each robot and motion, with values and included texts, in a file without an end, too."""
    make_reader = pytest.importorskip('mcap.reader').make_reader
    recorder = McapRecorder(tmp_path)
    for name in ('r1', 'r2'):
        recorder.on_event(RobotEvent(name, replace(
            TWIST, motion_file=MotionText(
                f'{name}.yaml', 'steps: []\n', {'side': '1 m'}, {'square': 'steps: []'}))))
    for name in ('again', 'again', 'r1'):
        recorder.on_event(RobotEvent('r1', replace(PLANNED, motion_file=MotionText(
            f'{name}.yaml', '', {}, {}))))
    recorder.on_event(RobotEvent('r1', of_plan(10.0)))
    recorder.flush(10.0)
    with (tmp_path / 'run.mcap').open('rb') as stream:
        kept = [one.metadata for one in make_reader(stream).iter_metadata()
                if one.name == 'motion_file']
    assert recorder.finish() is None
    assert kept == [{
        'robot': name, 'source': f'{name}.yaml', 'text': 'steps: []\n',
        'values': '{"side": "1 m"}', 'included': '{"square": "steps: []"}'}
        for name in ('r1', 'r2')] + [
        {'robot': 'r1', 'source': f'{name}.yaml', 'text': '', 'values': '{}', 'included': '{}'}
        for name in ('again', 'r1')]
    for read in READERS:
        assert velocities(read(tmp_path / 'run.mcap'), TWIST)


def test_a_minute_at_50_hz_takes_little_space(tmp_path):
    """And so does an hour: 36 MB at most."""
    drive = RecordedDrive(tmp_path)
    for second, tick in itertools.product(range(60), range(50)):
        time = 10.0 + second + tick / 50.0
        drive.publish(of_plan(time, Velocity(0.1, 0.001 * tick)),
                      OdometryReceived(time, Pose(time, 0.0, 0.1)))
        if tick == 0:
            drive.recorder.flush(time)
    assert drive.recorder.finish() is None
    assert drive.file.stat().st_size < 60 * 10_000


@pytest.mark.parametrize('read', READERS)
def test_several_robots_are_recorded_each_on_its_own_topics(read, tmp_path):
    recorder, sessions, sent = McapRecorder(tmp_path), {}, {}
    for number, name in enumerate(('r1', 'r2', 'r3')):
        # Clocks are read one after the other, and stamps must be comparable nevertheless.
        sessions[name] = replace(
            STAMPED if name == 'r3' else TWIST, epoch=TWIST.epoch + 0.01 * number,
            velocity_topic=f'/{name}/cmd_vel', odometry_topic=f'/{name}/odom')
        recorder.on_event(RobotEvent(name, sessions[name]))
        sent[name] = [of_plan(10.0 + tick / 20.0, Velocity(0.1 * number, 0.01 * tick))
                      for tick in range(20)]
    recorder.on_event(RobotEvent('r2', PLANNED))
    recorder.on_event(RobotEvent('r2', OdometryReceived(9.9, Pose(1.0, 2.0))))
    recorder.on_event(RobotEvent('r2', MotionStarted(10.0)))
    for events in zip(*sent.values()):
        for name, event in zip(sessions, events):
            recorder.on_event(RobotEvent(name, event))
        recorder.flush(events[0].time - 0.1)
    recorder.on_event(RobotEvent('r3', SpeedFactorChanged(11.5, {'pause': 0.0})))
    assert recorder.finish() is None
    found = read(tmp_path / 'run.mcap')
    for name, session in sessions.items():
        assert velocities(found, session) == sent_velocities(sent[name], TWIST)
    (pose,) = [one.message.pose.pose for one in found if one.topic == '/r2/odom']
    assert (pose.position.x, pose.position.y) == (1.0, 2.0)
    (path,) = [one for one in found if one.topic == '/kachaka_fleet/r2/planned_path']
    assert path.message.poses[0].pose.position.y == 2.0
    factors = [[one.message.data for one in found
                if one.topic == f'/kachaka_fleet/{name}/speed_factor'] for name in sessions]
    assert factors == [[1.0], [1.0], [1.0, 0.0]]
    assert [one.stamp for one in found] == sorted(one.stamp for one in found)
    assert 'message_count: 66' in (tmp_path / 'metadata.yaml').read_text()


def test_fifty_robots_have_one_definition_of_each_message(tmp_path):
    make_reader = pytest.importorskip('mcap.reader').make_reader
    recorder = McapRecorder(tmp_path)
    for number in range(50):
        recorder.on_event(RobotEvent(f'r{number}', replace(
            TWIST, velocity_topic=f'/r{number}/cmd_vel', odometry_topic=f'/r{number}/odom')))
        recorder.on_event(RobotEvent(f'r{number}', of_plan(10.0)))
    assert recorder.finish() is None
    with (tmp_path / 'run.mcap').open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert len(summary.schemas) == 4
    assert len(summary.channels) == 200
    assert summary.statistics.message_count == 100
