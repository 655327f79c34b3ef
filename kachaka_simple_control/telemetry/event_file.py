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
"""Keeps events in a file that a process of its own writes, so that none stays in memory."""

from __future__ import annotations

from collections.abc import Iterator
import io
import os
import sys
import tempfile

from kachaka_simple_control.control.events import Event
from kachaka_simple_control.control.waiting import wait_until
from kachaka_simple_control.telemetry.subscriber_process import decode, SubscriberProcess

#: Copies standard input to a file; it needs no module of ours, and keeps nothing.
COPY = """
import os
while data := os.read(0, 1 << 16):
    while data:
        data = data[os.write(1, data):]
"""
#: How long the process may take to write what was sent [s].
WRITE_TIMEOUT = 5.0


class EventFile:
    """
    A file without a name that events are written to as they come.

    What a drive sends and receives would grow in the memory of the process that drives, and
    Python would search it for garbage in mid-motion: 58 ms after 38 s at 200 Hz (measured).
    """

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the object)
        self._process = SubscriberProcess(
            [sys.executable, '-I', '-S', '-c', COPY], stdout=self._file)
        self.send, self.fail = self._process.send, self._process.fail

    @property
    def failure(self) -> str | None:
        """Return why later events are missing; None as long as none is."""
        return self._process.failure

    def close(self) -> None:
        """Write what was sent, and no more; harmless if that is done."""
        self._process.close(WRITE_TIMEOUT)

    def events(self) -> Iterator[Event]:
        """Yield the events so far, in order."""
        descriptor = self._file.fileno()
        wait_until(
            lambda: os.fstat(descriptor).st_size >= self._process.sent_bytes, WRITE_TIMEOUT)
        # By position: the process goes on writing at the end of the open file.
        yield from decode(io.BytesIO(os.pread(descriptor, os.fstat(descriptor).st_size, 0)))
