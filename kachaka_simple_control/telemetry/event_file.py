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
"""
Keep the events of a drive on disk, for a table at its end.

Tested by test/telemetry/test_subscriber_process.py.
"""

from __future__ import annotations

from collections.abc import Iterator
import errno
import io
import os
import tempfile

from kachaka_simple_control.control.events import Event
from kachaka_simple_control.telemetry.subscriber_process import decode, encode


class EventFile:
    """
    Stores the events of a drive in an unnamed temporary file, in the thread of the event bus.

    In memory, Python's garbage collector would search them in motion, and delay velocities: after
    a drive of 38 s at 200 Hz, one search took 58 ms (measured).
    """

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 (open until close())
        #: what was written; None until ``close``
        self._kept: bytes | None = None

    def send(self, event: Event) -> None:
        """
        Store an event.

        :raises OSError: if the disk is full
        """
        for packet in encode(event):
            # A full disk may still take a part.
            if self._file.write(packet) < len(packet):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def events(self) -> Iterator[Event]:
        """Yield all events that were sent so far, in order."""
        yield from decode(io.BytesIO(self._read() if self._kept is None else self._kept))

    def close(self) -> None:
        """Close the file; ``events()`` goes on yielding what was stored."""
        if self._kept is None:
            self._kept = self._read()
            self._file.close()

    def _read(self) -> bytes:
        descriptor = self._file.fileno()
        # With ``pread``: another thread may be writing at the position of the file.
        return os.pread(descriptor, os.fstat(descriptor).st_size, 0)
