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
"""A file that is a whole MCAP after each time that something was added to it."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


class BagFile:
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
            self.leave()

    def leave(self) -> None:
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
