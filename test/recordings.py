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
"""Read recordings by public libraries."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from kachaka_simple_control.control.events import SessionStarted, VelocitySent
import pytest


class Read(NamedTuple):
    """A message in a recording."""

    topic: str
    stamp: int
    message: Any


def read_with_mcap(file: Path) -> list[Read]:
    """Return the messages that the mcap library finds in a file."""
    make_reader = pytest.importorskip('mcap.reader').make_reader
    decoder = pytest.importorskip('mcap_ros2.decoder').DecoderFactory()
    with file.open('rb') as stream:
        found = []
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[decoder])
        for decoded in reader.iter_decoded_messages():
            assert decoded.message.publish_time == decoded.message.log_time
            found.append(Read(
                decoded.channel.topic, decoded.message.log_time, decoded.decoded_message))
        return found


def read_with_rosbags(path: Path) -> list[Read]:
    """Return the messages that rosbags finds in a file or folder, by the definitions there."""
    pytest.importorskip('numpy')
    highlevel = pytest.importorskip('rosbags.highlevel')
    with highlevel.AnyReader([path]) as reader:
        return [Read(connection.topic, stamp, reader.deserialize(data, connection.msgtype))
                for connection, stamp, data in reader.messages()]


READERS = [read_with_mcap, read_with_rosbags]


def velocities(found: list[Read], opened: SessionStarted) -> list[tuple[int, float, float]]:
    """Return stamp, linear and angular velocity of all velocities, in the order of a file."""
    messages = [read for read in found if read.topic == opened.velocity_topic]
    twists = [getattr(read.message, 'twist', read.message) for read in messages]
    for read, twist in zip(messages, twists):
        if twist is not read.message:
            assert header_stamp(read.message) == read.stamp
            assert read.message.header.frame_id == opened.frame
        rest = (twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y)
        assert rest == (0.0, 0.0, 0.0, 0.0)
    return [(read.stamp, twist.linear.x, twist.angular.z)
            for read, twist in zip(messages, twists)]


def header_stamp(message: Any) -> int:
    """Return the stamp in the header of a message [ns since 1970]."""
    return message.header.stamp.sec * 10 ** 9 + message.header.stamp.nanosec


def stamp_of(opened: SessionStarted, time: float) -> int:
    """Return the stamp that a time of the steady clock must have [ns since 1970]."""
    return round(opened.epoch * 1e9) + round(time * 1e9)


def sent_velocities(sent: list[VelocitySent], opened: SessionStarted) -> list[
        tuple[int, float, float]]:
    """Return stamp, linear and angular velocity of sent velocities, in order of time."""
    return sorted((stamp_of(opened, one.time), one.velocity.linear_x, one.velocity.angular_z)
                  for one in sent)
