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
"""Record what happens; whatever goes wrong with that ends the recording and nothing else."""

from __future__ import annotations

from collections.abc import Callable
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

from kachaka_simple_control.report.drive_log import DriveLog
from kachaka_simple_control.report.report_directory import NEEDS_MCAP
from kachaka_simple_control.telemetry.events import Event, SessionStarted

if TYPE_CHECKING:
    from kachaka_simple_control.report.mcap_recorder import McapRecorder

NAME = 'run.mcap'


class FaultTolerantRecorder:
    """A recording that may fail, and says why."""

    def __init__(self, folder: Path, record: DriveLog) -> None:
        """
        Know where it will be; the file is made when a program begins.

        :param folder: where it will be, and ``metadata.yaml`` beside it
        :param record: what happened so far; told of every event before this is
        """
        self._path = folder / NAME
        self._record = record
        self._recording: McapRecorder | None = None
        #: why there is no recording or not all of it; None as long as there is
        self.failure: str | None = None if importlib.util.find_spec('mcap') else (
            f'{NAME} is left out: {NEEDS_MCAP}')

    def on_event(self, event: Event) -> None:
        """
        Take note of what happened.

        :param event: what it was
        """
        if isinstance(event, SessionStarted):
            self._try(lambda: self._begin(event))
        elif (recording := self._recording) is not None:
            self._try(lambda: recording.on_event(event))

    def flush(self, until: float) -> None:
        """
        Hand what happened so far to the disk.

        What happened just now is better left for the next time: others may still be telling what
        was before it.

        :param until: what happened later stays for the next time [s on the steady clock]
        """
        if (recording := self._recording) is not None:
            self._try(lambda: recording.flush(until))

    def finish(self) -> str | None:
        """
        End the recording.

        :returns: why there is none or it ended early, as a sentence; None if it is whole
        """
        if self._recording is None:
            return self.failure or f'{NAME} is left out: nothing was told'
        self._try(self._recording.finish)
        try:
            self._recording.describe()
        except OSError as error:
            self.failure = self.failure or f'metadata.yaml is left out: {_reason(error)}'
        return self.failure

    def _begin(self, opened: SessionStarted) -> None:
        # Here, for a report can be made without it.
        from mcap.writer import Writer
        if not hasattr(Writer, 'flush'):
            raise ImportError(NEEDS_MCAP)
        from kachaka_simple_control.report.mcap_recorder import McapRecorder
        self._recording = McapRecorder(self._path, opened, self._record)

    def _try(self, action: Callable[[], None]) -> None:
        if self.failure is not None:
            return
        try:
            action()
        except Exception as error:  # whatever it is, the rest of the report is to be made
            self._end(error)

    def _end(self, error: Exception) -> None:
        reason = _reason(error)
        if self._recording is None:
            self.failure = f'{NAME} is left out: {reason}'
        else:
            self.failure = f'{NAME} ends early: {reason}'
            self._recording.abandon()


def _reason(error: Exception) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error)
    return str(error) if isinstance(error, ImportError) else repr(error)
