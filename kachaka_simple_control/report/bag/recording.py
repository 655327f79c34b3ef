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
"""A recording while it is made: an MCAP file as rosbag2 makes them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from kachaka_simple_control.motion.kinematics import ORIGIN
from kachaka_simple_control.report.bag import messages
from kachaka_simple_control.report.bag.bag_file import BagFile
from kachaka_simple_control.report.bag.metadata import (
    bag_information,
    BEST_EFFORT,
    folder_information,
    Topic,
    TRANSIENT_LOCAL,
)
from kachaka_simple_control.report.bag.schemas import (
    definition,
    ODOMETRY_TYPE,
    PATH_TYPE,
    VELOCITY_TYPES,
)
from kachaka_simple_control.report.events import Answered, Began, Event, Opened, Sent
from kachaka_simple_control.report.path_bytes import PathBytes
from kachaka_simple_control.report.planned_way import planned_way
from kachaka_simple_control.report.record import Record
from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, Writer

PATH_TOPIC = '/kachaka_simple_control/planned_path'
#: Messages are compressed and indexed in parts of this size at most [bytes].
CHUNK = 1 << 20


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


class Recording:
    """
    Puts events into a file, in the order of their stamps, whatever order they come in.

    Each flush leaves a whole file, though one without an index; that comes at the end.
    """

    def __init__(self, path: Path, opened: Opened, record: Record) -> None:
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
        self._paths = PathBytes(messages.ODOM)
        self._pending: list[Message] = []
        self._span: list[int] = []
        self._is_finished = False
        self._file = BagFile(path, _end())
        # Of a file, the writer wants no more than this one has.
        self._writer = Writer(cast('Any', self._file), chunk_size=CHUNK)
        self._writer.start('ros2', 'kachaka_simple_control')
        try:
            self._file.flush()
        except OSError:
            self._file.leave()
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

    def hear(self, event: Event) -> None:
        """
        Take an event; the disk gets it with ``flush``.

        :param event: what happened
        """
        match event:
            case Sent():
                self._take('velocity', event.time, self._velocity(event))
            case Answered() if 'odometry' in self._channels:
                self._take('odometry', event.time, messages.odometry(
                    event.pose, event.velocity, self._stamp(event.time)))
            case Began():
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

    def leave(self) -> None:
        """Let the file be as it is on the disk."""
        self._file.leave()

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

    def _velocity(self, sent: Sent) -> bytes:
        if self._opened.message_type == 'Twist':
            return messages.twist(sent.velocity)
        return messages.twist_stamped(
            sent.velocity, self._stamp(sent.time), self._opened.frame)

    def _path_of(self, began: Began) -> bytes:
        record = self._record
        start = record.odometry[-1].pose if record.odometry else ORIGIN
        when = self._stamp(began.time)
        return self._paths.path(
            [self._paths.pose(pose) for pose in planned_way(record.motions[-1].plan, start)],
            when)

    def _stamp(self, time: float) -> int:
        return messages.stamp(self._opened.epoch, time)


def _end() -> bytes:
    """Return what ends a file without an index."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    Footer(0, 0, 0).write(builder)
    return bytes(builder.end()) + MCAP0_MAGIC
