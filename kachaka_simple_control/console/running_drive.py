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
Exchange lines with a drive process that has started this console, and not the other way.

Tested by test/commands/test_console_beside.py.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import contextlib
import os
import signal

from kachaka_simple_control.console.drive_process import DriveProcess, STREAM_LIMIT
from kachaka_simple_control.files.protocol import Log, Report


class RunningDrive(DriveProcess):
    """
    A drive process that was there before this console; it is never started or ended from here.

    :param on_report: is called with each report
    :param on_change: is called when ``state`` has changed
    :ivar has_ended: is set when the process has ended
    """

    def __init__(
            self, reports: int, commands: int, pid: int, on_report: Callable[[Report], None],
            on_change: Callable[[], None]) -> None:
        super().__init__(list, on_report, on_change)
        self.has_ended = asyncio.Event()
        self._reports, self._commands, self._drive_pid = reports, commands, pid

    def start(self) -> None:
        """Begin to exchange lines."""
        if self.state == 'ended' and not self.has_ended.is_set():
            self._pipe.open(self._commands)
            self._change('starting')
            self._spawn(self._read_reports())

    async def _read_reports(self) -> None:
        reader = asyncio.StreamReader(limit=STREAM_LIMIT)
        await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(self._reports, 'rb', 0))
        await self._read(reader, self._take_report)
        self._pipe.close()
        self._end(self._stated_reason or 'the drive has ended')
        self.has_ended.set()

    def _interrupt(self, why: str) -> None:
        # Another process may have its ID after its end.
        if os.getppid() != self._drive_pid:
            return
        self._on_report(Log('error', f'the drive process gets SIGINT, because {why}'))
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._drive_pid, signal.SIGINT)
