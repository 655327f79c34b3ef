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
"""Record the messages of a drive as a rosbag2 bag, which is an MCAP file and its metadata file."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
import importlib.util
import json
import math
from operator import attrgetter
from pathlib import Path
from textwrap import indent
from typing import Any, cast, NamedTuple, TYPE_CHECKING

from kachaka_simple_control.control.events import (
    Event,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    RobotEvent,
    SessionStarted,
    SpeedFactorChanged,
    VelocitySent,
    WatchChanged,
)
from kachaka_simple_control.files import cdr
from kachaka_simple_control.motion.drive_order import MotionText
from kachaka_simple_control.motion.geometry import ORIGIN
from kachaka_simple_control.motion.paths import sample_path
from kachaka_simple_control.report.output_file import CrashSafeFile, NEEDS_MCAP

if TYPE_CHECKING:
    from mcap.writer import Writer

FILE_NAME = 'run.mcap'
#: The names of the nodes that publish the planned path and the speed factor: with one robot, and
#: with several, below whose names the topics of each are.
NODE, FLEET_NODE = 'kachaka_simple_control', 'kachaka_fleet'
#: The name of the metadata that keep the file of a robot's motion.
MOTION_FILE = 'motion_file'
PATH_TOPIC, FACTOR_TOPIC, WATCH_TOPIC = 'planned_path', 'speed_factor', 'obstacle_watch'
#: The largest size of a chunk in which messages are compressed and indexed [bytes].
CHUNK_SIZE = 1 << 20


#: The fields of each message type, in order: the type and the name of each field.
FIELDS = {
    'builtin_interfaces/Time': ('int32 sec', 'uint32 nanosec'),
    'std_msgs/Float64': ('float64 data',),
    'std_msgs/String': ('string data',),
    'std_msgs/Header': ('builtin_interfaces/Time stamp', 'string frame_id'),
    'geometry_msgs/Vector3': ('float64 x', 'float64 y', 'float64 z'),
    'geometry_msgs/Point': ('float64 x', 'float64 y', 'float64 z'),
    'geometry_msgs/Quaternion': ('float64 x', 'float64 y', 'float64 z', 'float64 w'),
    'geometry_msgs/Twist': ('geometry_msgs/Vector3 linear', 'geometry_msgs/Vector3 angular'),
    'geometry_msgs/TwistStamped': ('std_msgs/Header header', 'geometry_msgs/Twist twist'),
    'geometry_msgs/TwistWithCovariance': (
        'geometry_msgs/Twist twist', 'float64[36] covariance'),
    'geometry_msgs/Pose': (
        'geometry_msgs/Point position', 'geometry_msgs/Quaternion orientation'),
    'geometry_msgs/PoseStamped': ('std_msgs/Header header', 'geometry_msgs/Pose pose'),
    'geometry_msgs/PoseWithCovariance': ('geometry_msgs/Pose pose', 'float64[36] covariance'),
    'nav_msgs/Odometry': (
        'std_msgs/Header header', 'string child_frame_id',
        'geometry_msgs/PoseWithCovariance pose', 'geometry_msgs/TwistWithCovariance twist'),
    'nav_msgs/Path': ('std_msgs/Header header', 'geometry_msgs/PoseStamped[] poses'),
}
RULE = '=' * 80


def definition(message_type: str) -> str:
    """
    Return the text that defines a ROS message type in an MCAP file.

    The text has the fields of the type, and then the definitions of all message types in these
    fields.
    """
    first = message_type.replace('/msg/', '/')
    others = [name for name in _parts(first) if name != first]
    return _fields(first) + ''.join(
        f'{RULE}\nMSG: {name}\n{_fields(name)}' for name in dict.fromkeys(others))


def _fields(name: str) -> str:
    return ''.join(f'{field}\n' for field in FIELDS[name])


def _parts(name: str) -> list[str]:
    kinds = [field.partition(' ')[0].partition('[')[0] for field in FIELDS[name]]
    return [name, *(part for kind in kinds if kind in FIELDS for part in _parts(kind))]


#: The version of the rosbag2 metadata in Humble; later releases also read this version.
VERSION = 5
#: The numbers of QoS policies.  Humble reads only numbers; later releases also read names.
KEEP_LAST, RELIABLE, BEST_EFFORT, TRANSIENT_LOCAL, VOLATILE, AUTOMATIC = 1, 1, 2, 1, 2, 1
#: An infinite duration, RMW_DURATION_INFINITE, in seconds and nanoseconds.
INFINITE = (9223372036, 854775807)


@dataclass
class Topic:
    """
    A ROS topic in a recording, with the QoS settings of its publisher.

    :param reliability: the publisher's reliability policy, as the number that rosbag2 stores
    :param durability: the publisher's durability policy, as the number that rosbag2 stores
    """

    name: str
    message_type: str
    depth: int = 10
    reliability: int = RELIABLE
    durability: int = VOLATILE
    #: its number in the file; 0 before it is registered
    channel: int = 0
    count: int = 0

    @property
    def qualities(self) -> str:
        """Return the QoS profile of the topic's publisher as YAML, as rosbag2 stores it."""
        lines = [
            f'history: {KEEP_LAST}', f'depth: {self.depth}', f'reliability: {self.reliability}',
            f'durability: {self.durability}', *_duration('deadline'), *_duration('lifespan'),
            f'liveliness: {AUTOMATIC}', *_duration('liveliness_lease_duration'),
            'avoid_ros_namespace_conventions: false']
        return '- ' + '\n  '.join(lines)

    @property
    def lines(self) -> list[str]:
        """Return the entry of the topic in the rosbag2 metadata, as lines of YAML."""
        # A JSON string is a valid YAML string.
        return ['  - topic_metadata:',
                f'      name: {json.dumps(self.name)}',
                f'      type: {self.message_type}',
                '      serialization_format: cdr',
                f'      offered_qos_profiles: {json.dumps(self.qualities)}',
                f'    message_count: {self.count}']


def _duration(name: str) -> list[str]:
    return [f'{name}:', f'  sec: {INFINITE[0]}', f'  nsec: {INFINITE[1]}']


def stamp(epoch: float, time: float) -> int:
    """
    Convert a time of the steady clock to nanoseconds since 1970.

    Two results with the same epoch have the correct difference to about 1 ns.

    :param epoch: the date and time at which the steady clock is zero [s since 1970]
    """
    # Each part is rounded separately, because a sum of floats would lose digits.
    return round(epoch * cdr.NANO) + round(time * cdr.NANO)


class _Message(NamedTuple):
    """A serialized ROS message, with its topic and its time stamp [ns since 1970]."""

    stamp: int
    topic: Topic
    data: bytes


class _RobotRecorder:
    """
    What the recording of one robot needs: its topics, and what came last.

    :ivar topics: by what they carry
    """

    def __init__(self, session: SessionStarted, robot: str) -> None:
        self._session = session
        #: the last planned motion, and the last pose from odometry
        self._motion: MotionPlanned | None = None
        self._pose = ORIGIN
        self._paths = cdr.PathSerializer(cdr.ODOM)
        self._has_factor = False
        self.topics = {'velocity': Topic(
            session.velocity_topic, f'geometry_msgs/msg/{session.message_type}')}
        if session.odometry_topic is not None:
            self.topics['odometry'] = Topic(
                session.odometry_topic, 'nav_msgs/msg/Odometry', reliability=BEST_EFFORT)
        self._node = node = f'/{FLEET_NODE}/{robot}' if robot else f'/{NODE}'
        self.topics['path'] = Topic(
            f'{node}/{PATH_TOPIC}', 'nav_msgs/msg/Path', depth=1, durability=TRANSIENT_LOCAL)
        self.topics['factor'] = Topic(
            f'{node}/{FACTOR_TOPIC}', 'std_msgs/msg/Float64', depth=1,
            durability=TRANSIENT_LOCAL)

    def messages(self, event: Event, stamp_of: Callable[[float], int]) -> Iterator[_Message]:
        """Yield the messages that an event adds, with stamps from times of the steady clock."""
        match event:
            case MotionPlanned():
                self._motion = event
            case SpeedFactorChanged():
                self._has_factor = True
                yield self._message(
                    'factor', stamp_of(event.time), cdr.float64(event.product))
            case WatchChanged():
                # Without a watch there is no such topic.
                self.topics.setdefault('watch', Topic(
                    f'{self._node}/{WATCH_TOPIC}', 'std_msgs/msg/String', depth=1,
                    durability=TRANSIENT_LOCAL))
                yield self._message('watch', stamp_of(event.time), cdr.CdrWriter().string(
                    json.dumps({'state': event.state.value, 'distance': event.distance,
                                'angle': event.angle})).message())
            case VelocitySent() | OdometryReceived() | MotionStarted() if not self._has_factor:
                # The factor is 1 until the first change.
                self._has_factor = True
                yield self._message('factor', stamp_of(event.time), cdr.float64(1.0))
        match event:
            case VelocitySent():
                time = stamp_of(event.time)
                yield self._message('velocity', time, cdr.twist(event.velocity)
                                    if self._session.message_type == 'Twist' else
                                    cdr.twist_stamped(event.velocity, time, self._session.frame))
            case OdometryReceived():
                self._pose = event.pose
                if 'odometry' in self.topics:
                    time = stamp_of(event.time)
                    yield self._message(
                        'odometry', time, cdr.odometry(event.pose, event.velocity, time))
            case MotionStarted() if event.has_plan:
                motion, time = self._motion, stamp_of(event.time)
                assert motion is not None
                poses = sample_path(motion.plan, self._pose)
                yield self._message('path', time, self._paths.path(
                    [self._paths.pose(pose) for pose in poses], time))

    def _message(self, kind: str, time: int, data: bytes) -> _Message:
        return _Message(time, self.topics[kind], data)


class McapRecorder:
    """
    Records the events of a drive as ROS messages in the file ``run.mcap``.

    An event is, for example, a velocity that was sent, or an odometry sample that was received.
    Several robots are recorded in one file, each on topics of its own.  The file is created at the
    first ``SessionStarted``.  After each flush, the file is readable and complete except for its
    index.  The method ``finish`` writes the index and the rosbag2 metadata.

    If an error occurs, the recording ends, but the error is not raised.  The attribute ``failure``
    then has the reason.
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / FILE_NAME
        #: by name; that of the only robot of a node is empty
        self._robots: dict[str, _RobotRecorder] = {}
        #: the newest file of a motion, by robot
        self._kept: dict[str, MotionText] = {}
        #: the numbers of the message types in the file
        self._schemas: dict[str, int] = {}
        self._pending: list[_Message] = []
        self._span: list[int] = []
        self._is_finished = False
        self._file: CrashSafeFile | None = None
        #: one for all robots, so that their stamps can be compared
        self._epoch = 0.0
        self._writer: Writer
        #: the reason why the recording is missing or incomplete; None if there is no failure
        self.failure: str | None = None if importlib.util.find_spec('mcap') else (
            f'{FILE_NAME} is left out: {NEEDS_MCAP}')

    def on_event(self, event: Event | RobotEvent) -> None:
        """
        Add an event of the drive to the recording.

        ``SessionStarted`` adds a robot, and the first one creates the file.  Later events stay in
        memory as ROS messages until ``flush`` writes them to the file.
        """
        robot, event = event if isinstance(event, RobotEvent) else ('', event)
        if isinstance(event, SessionStarted):
            self._attempt(lambda: self._start(event, robot))
        elif robot in self._robots:
            if isinstance(event, MotionPlanned):
                self._attempt(lambda: self._keep(event.motion_file, robot))
            self._attempt(lambda: self._pending.extend(
                self._robots[robot].messages(event, self._stamp)))

    def flush(self, until: float) -> None:
        """
        Write to the file, in order of time, all messages that are not newer than ``until``.

        Newer messages stay in memory, because an event with an earlier time can still arrive.

        :param until: the time of the newest message to write [s on the steady clock]
        """
        if self._file is not None:
            self._attempt(lambda: self._store(self._stamp(until)))

    def finish(self) -> str | None:
        """
        End the recording: write the remaining messages, the index and ``metadata.yaml``.

        :returns: the reason why the recording is missing or incomplete, as a sentence; None if it
            is complete
        """
        if self._file is None:
            return self.failure or f'{FILE_NAME} is left out: no event was received'
        self._attempt(self._finish)
        try:
            self._write_metadata()
        except OSError as error:
            self.failure = self.failure or f'metadata.yaml is left out: {_reason(error)}'
        return self.failure

    def _attempt(self, action: Callable[[], None]) -> None:
        if self.failure is not None:
            return
        try:
            action()
        except Exception as error:  # any error: the rest of the report must still be written
            if self._file is None:
                self.failure = f'{FILE_NAME} is left out: {_reason(error)}'
            else:
                self.failure = f'{FILE_NAME} ends early: {_reason(error)}'
                self._file.abandon()

    def _start(self, session: SessionStarted, robot: str) -> None:
        if self._file is None:
            self._epoch = session.epoch
            self._create()
        self._robots[robot] = _RobotRecorder(session, robot)
        for topic in self._robots[robot].topics.values():
            self._register(topic)
        self._keep(session.motion_file, robot)

    def _keep(self, motion: MotionText | None, robot: str) -> None:
        """Keep the file of a motion, unless it is that of the motion before."""
        if motion is None or motion == self._kept.get(robot):
            return
        self._kept[robot] = motion
        # The values of a record of metadata are texts.
        self._writer.add_metadata(MOTION_FILE, {'robot': robot, **{
            name: value if isinstance(value, str) else json.dumps(value)
            for name, value in asdict(motion).items()}})

    def _create(self) -> None:
        # Imported here, because the report also works without mcap.
        from mcap.writer import Writer
        if not hasattr(Writer, 'flush'):
            raise ImportError(NEEDS_MCAP)
        file = CrashSafeFile(self._path, _end_without_index())
        # Writer needs only write, tell and flush of a file.
        self._writer = Writer(cast('Any', file), chunk_size=CHUNK_SIZE)
        self._writer.start('ros2', 'kachaka_simple_control')
        try:
            file.flush()
        except OSError:
            file.abandon()
            self._path.unlink()
            raise
        self._file = file

    def _register(self, topic: Topic) -> None:
        kind = topic.message_type
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(
                kind, 'ros2msg', definition(kind).encode())
        topic.channel = self._writer.register_channel(
            topic.name, 'cdr', self._schemas[kind], {'offered_qos_profiles': topic.qualities})

    def _store(self, until: float) -> None:
        self._pending.sort(key=attrgetter('stamp'))
        count = bisect_right(self._pending, until, key=attrgetter('stamp'))
        due, self._pending = self._pending[:count], self._pending[count:]
        if not due:
            return
        for message in due:
            if not message.topic.channel:
                self._register(message.topic)
            self._writer.add_message(
                message.topic.channel, message.stamp, message.data, message.stamp)
        self._writer.flush()
        for message in due:
            message.topic.count += 1
        stamps = [*self._span, due[0].stamp, due[-1].stamp]
        self._span = [min(stamps), max(stamps)]

    def _finish(self) -> None:
        self._store(math.inf)
        self._writer.add_metadata('rosbag2', {'serialized_metadata': self._information()})
        self._writer.finish()
        if self._file is not None:
            self._file.close()
        self._is_finished = True

    def _write_metadata(self) -> None:
        """
        Write ``metadata.yaml``, the rosbag2 metadata of the recording.

        Write nothing if the recording failed before its first message was written.

        :raises OSError: if the file cannot be written
        """
        if not self._span and not self._is_finished:
            return
        file = self._path.with_name('metadata.yaml')
        try:
            file.write_text('rosbag2_bagfile_information:\n' + indent(self._information(), '  '),
                            encoding='utf-8')
        except OSError:
            file.unlink(missing_ok=True)
            raise

    def _information(self) -> str:
        """Return the rosbag2 metadata of the recording, such as topics and duration, as YAML."""
        first, last = self._span or (0, 0)
        topics = [topic for robot in self._robots.values() for topic in robot.topics.values()]
        name = self._path.name
        span = ['duration:', f'  nanoseconds: {last - first}',
                'starting_time:', f'  nanoseconds_since_epoch: {first}',
                f'message_count: {sum(topic.count for topic in topics)}']
        lines = [f'version: {VERSION}', 'storage_identifier: mcap', *span,
                 'topics_with_message_count:', *(line for topic in topics for line in topic.lines),
                 'compression_format: ""', 'compression_mode: ""',
                 'relative_file_paths:', f'  - {name}',
                 'files:', f'  - path: {name}',
                 *(f'    {line}' for line in (*span[2:4], *span[:2], span[4]))]
        return '\n'.join(lines) + '\n'

    def _stamp(self, time: float) -> int:
        return stamp(self._epoch, time)


def _end_without_index() -> bytes:
    from mcap.data_stream import RecordBuilder
    from mcap.records import DataEnd, Footer
    from mcap.writer import MCAP0_MAGIC
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    Footer(0, 0, 0).write(builder)
    return bytes(builder.end()) + MCAP0_MAGIC


def _reason(error: Exception) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error)
    return str(error) if isinstance(error, ImportError) else repr(error)
