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
"""The writing end of a pipe to the drive process: it takes a line at once, or refuses it."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
import struct
import termios

#: The wanted capacity of the pipe [bytes]: the longest line and some short ones.
CAPACITY = 262_144


class CommandPipe:
    """
    A pipe that is closed at first; closed, it refuses every line.

    All methods must be called in the thread of the event loop.
    """

    def __init__(self) -> None:
        self._pipe: int | None = None
        self._rest = b''

    def open(self, pipe: int) -> None:  # noqa: A003
        """Take over the writing end of a pipe; ``close()`` closes it."""
        self._pipe, self._rest = pipe, b''
        os.set_blocking(pipe, False)
        with contextlib.suppress(OSError):
            fcntl.fcntl(pipe, getattr(fcntl, 'F_SETPIPE_SZ', 1031), CAPACITY)

    @property
    def unread(self) -> int:
        """Return how many bytes the process has not read."""
        if self._pipe is None:
            return 0
        data = fcntl.ioctl(self._pipe, termios.FIONREAD, b'\0' * 4)
        return len(self._rest) + int(struct.unpack('i', data)[0])

    def write(self, line: bytes) -> bool:
        """Write a line, completely or not at all; return whether it was written."""
        if self._pipe is None or self._rest:
            return False
        try:
            count = os.write(self._pipe, line)
        except OSError:  # the pipe is full, or the process ends
            return False
        if count < len(line):
            # Only a line of more than a page can be cut.  Its rest must follow before any other.
            self._rest = line[count:]
            asyncio.get_running_loop().add_writer(self._pipe, self._write_rest)
        return True

    def _write_rest(self) -> None:
        if self._pipe is None:
            return
        try:
            self._rest = self._rest[os.write(self._pipe, self._rest):]
        except BlockingIOError:
            return
        except OSError:
            self._rest = b''
        if not self._rest:
            asyncio.get_running_loop().remove_writer(self._pipe)

    def close(self) -> None:
        """Close the pipe, if it is open."""
        if self._pipe is not None:
            asyncio.get_running_loop().remove_writer(self._pipe)
            os.close(self._pipe)
            self._pipe = None
