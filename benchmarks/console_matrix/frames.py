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
"""The frames of a WebSocket (RFC 6455), as far as the matrix needs them."""

from __future__ import annotations

from collections.abc import Iterator
import os
import struct

TEXT, CLOSE, PING, PONG = 1, 8, 9, 10


def frame(payload: bytes, opcode: int = TEXT) -> bytes:
    """
    Return a frame of a client, which is masked.

    :param payload: the text, in UTF-8
    :param opcode: the kind of the frame
    """
    size, mask = len(payload), os.urandom(4)
    if size < 126:
        head = struct.pack('!BB', 0x80 | opcode, 0x80 | size)
    elif size < 65536:
        head = struct.pack('!BBH', 0x80 | opcode, 0x80 | 126, size)
    else:
        head = struct.pack('!BBQ', 0x80 | opcode, 0x80 | 127, size)
    return head + mask + _masked(payload, mask)


class FrameReader:
    """Splits a stream of bytes into frames.  Messages in several frames are not joined."""

    def __init__(self) -> None:
        self._rest = b''

    def feed(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """
        Take the next bytes, and yield the opcode and the payload of each frame that is complete.

        :param data: the bytes
        """
        self._rest += data
        while (found := self._next()) is not None:
            opcode, payload, self._rest = found
            yield opcode, payload

    def _next(self) -> tuple[int, bytes, bytes] | None:
        data = self._rest
        if len(data) < 2:
            return None
        size, start = data[1] & 0x7f, 2
        if size >= 126:
            width = 2 if size == 126 else 8
            size, start = int.from_bytes(data[2:2 + width], 'big'), 2 + width
        mask = b''
        if data[1] & 0x80:
            mask, start = data[start:start + 4], start + 4
        if len(data) < start + size:
            return None
        payload = data[start:start + size]
        return data[0] & 0x0f, _masked(payload, mask) if mask else payload, data[start + size:]


def _masked(payload: bytes, mask: bytes) -> bytes:
    size = len(payload)
    key = (mask * (size // 4 + 1))[:size]
    return (int.from_bytes(payload, 'big') ^ int.from_bytes(key, 'big')).to_bytes(size, 'big')
