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
"""Record a drive as an MCAP file that is whole after each flush."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
import math
import os
from pathlib import Path
import struct
from typing import Any, cast

from kachaka_simple_control.motion.geometry import ORIGIN, Pose, Velocity
from kachaka_simple_control.report.drive_log import DriveLog
from kachaka_simple_control.report.paths import PathSerializer, sample_path
from kachaka_simple_control.report.rosbag2_metadata import (
    bag_information,
    BEST_EFFORT,
    definition,
    folder_information,
    ODOMETRY_TYPE,
    PATH_TYPE,
    Topic,
    TRANSIENT_LOCAL,
    VELOCITY_TYPES,
)
from kachaka_simple_control.telemetry.events import (
    Event,
    MotionStarted,
    OdometryReceived,
    SessionStarted,
    VelocitySent,
)
from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, Writer

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


class CrashSafeFile:
    """
    Takes what a writer of MCAP writes, and hands it to the disk with an end behind it.

    The next part is written over that end.  So whatever ends the program, the file can be read
    up to the part before.
    """

    def __init__(self, path: Path, end: bytes) -> None:
        """
        Make the file.

        :param path: where; nothing may be there yet
        :param end: what makes what was written so far a whole file
        :raises OSError: if it cannot be made
        """
        self._descriptor = os.open(
            path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        self._end = end
        self._pending = bytearray()
        self._size = 0

    def write(self, data: bytes) -> int:
        """
        Take a part; the disk gets it with ``flush``.

        :param data: the part
        :returns: its length
        """
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """
        Return where the next part will stand.

        :returns: its offset in the file
        """
        return self._size + len(self._pending)

    def flush(self) -> None:
        """
        Hand what was taken to the disk.

        :raises OSError: if that fails; the file is then as it was before
        """
        self._store(self._end)

    def close(self) -> None:
        """
        Hand the rest to the disk, which ends the file by itself.

        :raises OSError: if that fails; the file is then as it was before
        """
        try:
            self._store(b'')
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Let the file be as it is on the disk."""
        with contextlib.suppress(OSError):
            os.close(self._descriptor)

    def _store(self, end: bytes) -> None:
        try:
            self._put(bytes(self._pending) + end, self._size)
        except OSError:
            # The disk has this much: it was there before.
            with contextlib.suppress(OSError):
                if self._size:
                    self._put(self._end, self._size)
                    os.ftruncate(self._descriptor, self._size + len(self._end))
            raise
        self._size += len(self._pending)
        self._pending.clear()

    def _put(self, data: bytes, offset: int) -> None:
        view = memoryview(data)
        while view:
            count = os.pwrite(self._descriptor, view, offset)
            view, offset = view[count:], offset + count


PATH_TOPIC = '/kachaka_simple_control/planned_path'
#: Messages are compressed and indexed in parts of this size at most [bytes].
CHUNK_SIZE = 1 << 20


@dataclass(frozen=True)
class Message:
    """
    A message on its way into the file.

    :param when: its stamp [ns since 1970]
    :param channel: the number of its topic in the file
    :param data: the message
    """

    when: int
    channel: int
    data: bytes


class McapRecorder:
    """
    Puts events into a file, in the order of their stamps, whatever order they come in.

    Each flush leaves a whole file, though one without an index; that comes at the end.
    """

    def __init__(self, path: Path, opened: SessionStarted, record: DriveLog) -> None:
        """
        Begin it.

        :param path: the file; nothing may be there yet
        :param opened: what began
        :param record: what happened so far; told of every event before this is
        :raises OSError: if the file cannot be made
        """
        self._path = path
        self._opened = opened
        self._record = record
        self._paths = PathSerializer(ODOM)
        self._pending: list[Message] = []
        self._span: list[int] = []
        self._is_finished = False
        self._file = CrashSafeFile(path, _end())
        # Of a file, the writer wants no more than this one has.
        self._writer = Writer(cast('Any', self._file), chunk_size=CHUNK_SIZE)
        self._writer.start('ros2', 'kachaka_simple_control')
        try:
            self._file.flush()
        except OSError:
            self._file.abandon()
            path.unlink()
            raise
        self._channels: dict[str, int] = {}
        self._topics: dict[int, Topic] = {}
        self._add_topic('velocity', Topic(
            opened.velocity_topic, VELOCITY_TYPES[opened.message_type]))
        if opened.odometry_topic is not None:
            self._add_topic('odometry', Topic(
                opened.odometry_topic, ODOMETRY_TYPE, reliability=BEST_EFFORT))
        self._add_topic('path', Topic(
            PATH_TOPIC, PATH_TYPE, depth=1, durability=TRANSIENT_LOCAL))

    def on_event(self, event: Event) -> None:
        """
        Take an event; the disk gets it with ``flush``.

        :param event: what happened
        """
        match event:
            case VelocitySent():
                self._take('velocity', event.time, self._velocity(event))
            case OdometryReceived() if 'odometry' in self._channels:
                self._take('odometry', event.time, odometry(
                    event.pose, event.velocity, self._stamp(event.time)))
            case MotionStarted():
                self._take('path', event.time, self._path_of(event))

    def flush(self, until: float) -> None:
        """
        Hand what happened so far to the disk.

        :param until: what happened later stays for the next time [s on the steady clock]
        :raises OSError: if that fails
        """
        self._store(self._stamp(until))

    def finish(self) -> None:
        """
        Hand all the rest to the disk, and end the file with its index.

        :raises OSError: if that fails
        """
        if self._pending:
            self._store(max(message.when for message in self._pending))
        self._writer.add_metadata('rosbag2', {'serialized_metadata': self._information()})
        self._writer.finish()
        self._file.close()
        self._is_finished = True

    def abandon(self) -> None:
        """Let the file be as it is on the disk."""
        self._file.abandon()

    def describe(self) -> None:
        """
        Make the folder a bag, if there is more in the file than its beginning.

        :raises OSError: if that fails
        """
        if not self._span and not self._is_finished:
            return
        file = self._path.with_name('metadata.yaml')
        try:
            file.write_text(folder_information(self._information()), encoding='utf-8')
        except OSError:
            file.unlink(missing_ok=True)
            raise

    def _add_topic(self, kind: str, topic: Topic) -> None:
        schema = self._writer.register_schema(
            topic.message_type, 'ros2msg', definition(topic.message_type).encode())
        channel = self._writer.register_channel(
            topic.name, 'cdr', schema, {'offered_qos_profiles': topic.qualities})
        self._channels[kind], self._topics[channel] = channel, topic

    def _take(self, kind: str, time: float, data: bytes) -> None:
        self._pending.append(Message(self._stamp(time), self._channels[kind], data))

    def _store(self, until: int) -> None:
        self._pending.sort(key=lambda message: message.when)
        due = [message for message in self._pending if message.when <= until]
        if not due:
            return
        del self._pending[:len(due)]
        for message in due:
            self._writer.add_message(
                message.channel, message.when, message.data, message.when)
        self._writer.flush()
        for message in due:
            self._topics[message.channel].count += 1
        stamps = [*self._span, due[0].when, due[-1].when]
        self._span = [min(stamps), max(stamps)]

    def _information(self) -> str:
        first, last = self._span or (0, 0)
        return bag_information([*self._topics.values()], first, last, self._path.name)

    def _velocity(self, sent: VelocitySent) -> bytes:
        if self._opened.message_type == 'Twist':
            return twist(sent.velocity)
        return twist_stamped(
            sent.velocity, self._stamp(sent.time), self._opened.frame)

    def _path_of(self, began: MotionStarted) -> bytes:
        record = self._record
        start = record.odometry[-1].pose if record.odometry else ORIGIN
        when = self._stamp(began.time)
        return self._paths.path(
            [self._paths.pose(pose) for pose in sample_path(record.motions[-1].plan, start)],
            when)

    def _stamp(self, time: float) -> int:
        return stamp(self._opened.epoch, time)


def _end() -> bytes:
    """Return what ends a file without an index."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    Footer(0, 0, 0).write(builder)
    return bytes(builder.end()) + MCAP0_MAGIC
