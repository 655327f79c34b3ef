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
"""Events as bytes in a pipe, from the process that drives to one that listens."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import pickle
import select
from typing import Any, BinaryIO

#: What a pipe takes whole or not at all [bytes]: PIPE_BUF of Linux and POSIX's least on others.
WHOLE = 4096
#: What a part of something larger carries [bytes]; the rest of WHOLE is room for its frame.
CHUNK_SIZE = 3500


@dataclass(frozen=True)
class Chunk:
    """
    A part of an event that is too large to be sent at once.

    :param data: its bytes
    :param is_last: whether the event ends with it
    """

    data: bytes
    is_last: bool


def encode(event: object) -> list[bytes]:
    """
    Return an event as what is written to a pipe.

    Each packet goes in whole or not at all, so that several threads may write.

    :param event: anything that can be pickled
    :returns: its packets, mostly one
    """
    data = pickle.dumps(event, pickle.HIGHEST_PROTOCOL)
    if len(data) <= WHOLE:
        return [data]
    starts = range(0, len(data), CHUNK_SIZE)
    return [pickle.dumps(Chunk(data[start:start + CHUNK_SIZE], start == starts[-1]),
                         pickle.HIGHEST_PROTOCOL) for start in starts]


def decode(stream: BinaryIO) -> Iterator[Any]:
    """
    Return what was written to a pipe, until its end.

    :param stream: the pipe's end to read from
    :returns: the events, in order; of one cut off in the middle, nothing
    """
    parts = b''
    while True:
        try:
            event = pickle.load(stream)  # from the process that started this one
        except (EOFError, pickle.UnpicklingError):
            return
        if isinstance(event, Chunk):
            parts += event.data
            if not event.is_last:
                continue
            event, parts = pickle.loads(parts), b''
        yield event


def wait_for_room(descriptor: int, timeout: float) -> bool:
    """
    Wait until a pipe takes something.

    :param descriptor: its end to write to
    :param timeout: how long [s]
    :returns: whether it does
    """
    return bool(select.select([], [descriptor], [], timeout)[1])
