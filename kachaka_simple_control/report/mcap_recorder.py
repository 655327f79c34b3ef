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
"""Record a drive as an MCAP file that is readable after each flush."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import importlib.util
import os
from pathlib import Path
from typing import Any, cast, NamedTuple, TYPE_CHECKING

from kachaka_simple_control.analysis.paths import sample_path
from kachaka_simple_control.control.events import (
    Event,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SessionStarted,
    SpeedFactorChanged,
    VelocitySent,
)
from kachaka_simple_control.motion.geometry import ORIGIN
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.report.output_file import NEEDS_MCAP
from kachaka_simple_control.report.rosbag2_metadata import (
    bag_information,
    BEST_EFFORT,
    definition,
    FACTOR_TYPE,
    folder_information,
    ODOMETRY_TYPE,
    PATH_TYPE,
    Topic,
    TRANSIENT_LOCAL,
    VELOCITY_TYPES,
)
from kachaka_simple_control.telemetry.cdr import (
    float64,
    NANO,
    ODOM,
    odometry,
    PathSerializer,
    twist,
    twist_stamped,
)

if TYPE_CHECKING:
    from mcap.writer import Writer

FILE_NAME = 'run.mcap'
PATH_TOPIC = '/kachaka_simple_control/planned_path'
FACTOR_TOPIC = '/kachaka_simple_control/speed_factor'
#: The largest size of a chunk in which messages are compressed and indexed [bytes].
CHUNK_SIZE = 1 << 20


def stamp(epoch: float, time: float) -> int:
    """
    Return a time of the steady clock as nanoseconds since 1970.

    The two values are rounded separately, because a sum of floats would lose digits.  The
    difference of two stamps equals the difference of their times, rounded to nanoseconds.

    :param epoch: the zero of the steady clock [s since 1970]
    :param time: the time [s on the steady clock]
    """
    return round(epoch * NANO) + round(time * NANO)


class CrashSafeFile:
    """
    A file for an MCAP writer that is complete on the disk after each flush.

    Each flush writes an end record after the data, and the next flush overwrites it.  If the
    program is killed, the file is readable up to the last flush.

    :param path: the file; it must not exist
    :param end: the bytes that complete the file after the data
    :raises OSError: if it cannot be created
    """

    def __init__(self, path: Path, end: bytes) -> None:
        self._descriptor = os.open(
            path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        self._end = end
        self._pending = bytearray()
        self._size = 0

    def write(self, data: bytes) -> int:
        """Buffer data until ``flush``, and return its length."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the offset of the next data in the file."""
        return self._size + len(self._pending)

    def flush(self) -> None:
        """
        Write the buffered data and the end to the disk.

        :raises OSError: if the write fails; the file then keeps its old content
        """
        self._store(self._end)

    def close(self) -> None:
        """
        Write the buffered data, which contains its own end, and close the file.

        :raises OSError: if the write fails; the file then keeps its old content
        """
        try:
            self._store(b'')
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file without another write."""
        with contextlib.suppress(OSError):
            os.close(self._descriptor)

    def _store(self, end: bytes) -> None:
        try:
            self._pwrite(bytes(self._pending) + end, self._size)
        except OSError:
            # The disk has room for the old end, because the file contained it before.
            with contextlib.suppress(OSError):
                if self._size:
                    self._pwrite(self._end, self._size)
                    os.ftruncate(self._descriptor, self._size + len(self._end))
            raise
        self._size += len(self._pending)
        self._pending.clear()

    def _pwrite(self, data: bytes, offset: int) -> None:
        view = memoryview(data)
        while view:
            count = os.pwrite(self._descriptor, view, offset)
            view, offset = view[count:], offset + count


class _Message(NamedTuple):
    """A serialized message with its stamp [ns since 1970]."""

    stamp: int
    topic: Topic
    data: bytes


class McapRecorder:
    """
    Records events in ``run.mcap``, sorted by their stamps, and writes the rosbag2 metadata.

    The file is created when the session starts.  It is readable after each flush.  The index is
    written at the end.  An error ends the recording, but does not propagate: ``failure`` has the
    reason.

    :param directory: the directory of ``run.mcap`` and ``metadata.yaml``
    """

    def __init__(self, directory: Path) -> None:
        self._path = directory / FILE_NAME
        #: the last planned motion, and the last pose from odometry
        self._motion: MotionPlanned | None = None
        self._pose = ORIGIN
        self._paths = PathSerializer(ODOM)
        self._topics: dict[str, Topic] = {}
        self._pending: list[_Message] = []
        self._span: list[int] = []
        self._is_finished = False
        self._has_factor = False
        self._file: CrashSafeFile | None = None
        self._session: SessionStarted
        self._writer: Writer
        #: the reason why the recording is missing or incomplete; None if there is no failure
        self.failure: str | None = None if importlib.util.find_spec('mcap') else (
            f'{FILE_NAME} is left out: {NEEDS_MCAP}')

    def on_event(self, event: Event) -> None:
        """Record an event; ``flush`` writes it to the disk."""
        if isinstance(event, SessionStarted):
            self._attempt(lambda: self._start(event))
        elif self._file is not None:
            self._attempt(lambda: self._record(event))

    def flush(self, until: float) -> None:
        """
        Write the events up to a time to the disk.

        :param until: the time [s on the steady clock]; later events may arrive out of order, so
            the next flush writes them
        """
        if self._file is not None:
            self._attempt(lambda: self._store(self._stamp(until)))

    def finish(self) -> str | None:
        """
        Write the remaining events, the index and ``metadata.yaml``.

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

    def _start(self, session: SessionStarted) -> None:
        # Imported here, because the report also works without mcap.
        from mcap.writer import Writer
        if not hasattr(Writer, 'flush'):
            raise ImportError(NEEDS_MCAP)
        self._session = session
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
        self._add_topic('velocity', Topic(
            session.velocity_topic, VELOCITY_TYPES[session.message_type]))
        if session.odometry_topic is not None:
            self._add_topic('odometry', Topic(
                session.odometry_topic, ODOMETRY_TYPE, reliability=BEST_EFFORT))
        self._add_topic('path', Topic(
            PATH_TOPIC, PATH_TYPE, depth=1, durability=TRANSIENT_LOCAL))
        self._add_topic('factor', Topic(
            FACTOR_TOPIC, FACTOR_TYPE, depth=1, durability=TRANSIENT_LOCAL))

    def _add_topic(self, kind: str, topic: Topic) -> None:
        schema = self._writer.register_schema(
            topic.message_type, 'ros2msg', definition(topic.message_type).encode())
        topic.channel = self._writer.register_channel(
            topic.name, 'cdr', schema, {'offered_qos_profiles': topic.qualities})
        self._topics[kind] = topic

    def _record(self, event: Event) -> None:
        match event:
            case SpeedFactorChanged():
                self._has_factor = True
                self._add('factor', self._stamp(event.time), float64(event.product))
            case VelocitySent() | OdometryReceived() | MotionStarted() if not self._has_factor:
                # The factor is 1 until the first change.
                self._has_factor = True
                self._add('factor', self._stamp(event.time), float64(1.0))
        match event:
            case MotionPlanned():
                self._motion = event
            case OdometryReceived():
                self._pose = event.pose
        match event:
            case VelocitySent():
                time = self._stamp(event.time)
                self._add('velocity', time, twist(event.velocity)
                          if self._session.message_type == 'Twist' else
                          twist_stamped(event.velocity, time, self._session.frame))
            case OdometryReceived() if 'odometry' in self._topics:
                time = self._stamp(event.time)
                self._add('odometry', time, odometry(event.pose, event.velocity, time))
            case MotionStarted() if event.has_plan:
                time = self._stamp(event.time)
                self._add('path', time, self._planned_path(time))

    def _add(self, kind: str, time: int, data: bytes) -> None:
        self._pending.append(_Message(time, self._topics[kind], data))

    def _planned_path(self, time: int) -> bytes:
        motion = self._motion
        assert motion is not None
        planned = plan(motion.motion, motion.limits, motion.rate)
        poses = sample_path(planned, self._pose)
        return self._paths.path([self._paths.pose(pose) for pose in poses], time)

    def _store(self, until: int) -> None:
        self._pending.sort(key=lambda message: message.stamp)
        due = [message for message in self._pending if message.stamp <= until]
        if not due:
            return
        del self._pending[:len(due)]
        for message in due:
            self._writer.add_message(
                message.topic.channel, message.stamp, message.data, message.stamp)
        self._writer.flush()
        for message in due:
            message.topic.count += 1
        stamps = [*self._span, due[0].stamp, due[-1].stamp]
        self._span = [min(stamps), max(stamps)]

    def _finish(self) -> None:
        if self._pending:
            self._store(max(message.stamp for message in self._pending))
        self._writer.add_metadata('rosbag2', {'serialized_metadata': self._information()})
        self._writer.finish()
        if self._file is not None:
            self._file.close()
        self._is_finished = True

    def _write_metadata(self) -> None:
        """Write ``metadata.yaml``, unless the recording has no message and is not finished."""
        if not self._span and not self._is_finished:
            return
        file = self._path.with_name('metadata.yaml')
        try:
            file.write_text(folder_information(self._information()), encoding='utf-8')
        except OSError:
            file.unlink(missing_ok=True)
            raise

    def _information(self) -> str:
        first, last = self._span or (0, 0)
        return bag_information([*self._topics.values()], first, last, self._path.name)

    def _stamp(self, time: float) -> int:
        return stamp(self._session.epoch, time)


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
