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
"""Show the status of a drive as a panel or as plain lines."""

from __future__ import annotations

from collections.abc import Callable
import math
import os
import sys
import threading
from typing import Protocol

from kachaka_simple_control.display import terminal
from kachaka_simple_control.display.drive_status import DriveState, DriveStatus, STEP, StepStatus
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.text import one_line, pluralize

#: The shortest time between two lines [s].
MIN_LINE_PERIOD = 0.5
#: The time of waiting for a robot after which a line says so [s].
WAIT_NOTICE_DELAY = 2.0
#: The largest width of a name [columns].
MAX_NAME_WIDTH = 36

#: A function that writes a text in one call.
Write = Callable[[str], None]
#: The columns and rows of a terminal.
Size = tuple[int, int]


class StepLogger:
    """Returns a log line for each step that begins, and one for a long wait for the robot."""

    def __init__(self) -> None:
        self._last_line = float('-inf')
        self._number = 0
        self._state = DriveState.READY
        self._state_since = float('-inf')
        self._has_noted_wait = False

    def update(self, status: DriveStatus, now: float) -> list[str]:
        """
        Return the lines that are due; usually there are none.

        :param status: the status of the drive
        :param now: the time [s on the steady clock]; not earlier than in the last call
        """
        if status.state is not self._state:
            self._state, self._state_since = status.state, now
            begins = status.state in (DriveState.WAITING, DriveState.CONNECTING)
            if begins and (status.step is None or status.step.noun == STEP):
                self._number = 0  # steps restart with each motion, movements continue
        if status.state is DriveState.DRIVING and status.step is not None:
            return self._step_line(status.step, now)
        if (status.state is DriveState.WAITING and not self._has_noted_wait
                and now - self._state_since >= WAIT_NOTICE_DELAY):
            self._has_noted_wait = True
            name = one_line(status.title, MAX_NAME_WIDTH)
            topic = f' on {status.topic}' if status.topic else ''
            left = '' if status.wait_left is None else f', {math.ceil(status.wait_left)} s left'
            return [f'{name}: waiting for the robot{topic}{left}']
        return []

    def _step_line(self, step: StepStatus, now: float) -> list[str]:
        if step.number == self._number or now - self._last_line < MIN_LINE_PERIOD:
            return []
        passed = step.number - self._number - 1
        self._number, self._last_line = step.number, now
        duration = format_number(round(step.duration, 3))
        line = f'{step.label}: {step.description} ({duration} s)'
        return [f'{line}; {pluralize(passed, step.noun)} before it passed' if passed > 0 else line]


class Renderer(Protocol):
    """The interface of a class that shows the status of a drive."""

    #: the period at which ``show`` must be called [s]
    period: float

    def show(self, status: DriveStatus, now: float, hint: str) -> None:
        """
        Show the current status.

        :param status: the status
        :param now: the time [s on the steady clock]
        :param hint: the text that says how to stop
        """

    def on_event(self, status: DriveStatus, now: float) -> None:
        """
        Show the status at an event, which may be in the past.

        Another thread calls this method than the other methods.

        :param status: the status at the event
        :param now: the time of the event [s on the steady clock]
        """

    def close(self) -> None:
        """Remove temporary output from the terminal."""


class LineRenderer:
    """
    Shows a drive as plain lines.

    :param write: a function that writes a text
    :param has_hint: whether the first line says how to stop, for a user at the terminal
    """

    period = 0.1

    def __init__(self, write: Write, has_hint: bool = True) -> None:
        self._write = write
        self._has_hint = has_hint
        self._logger = StepLogger()
        self._lock = threading.Lock()

    def show(self, status: DriveStatus, now: float, hint: str) -> None:
        """Write the lines that are due; write the hint once, before the robot moves."""
        if self._has_hint and status.state in (DriveState.CONNECTING, DriveState.DRIVING):
            self._has_hint = False
            self._write(f'{hint}\n')
        self.on_event(status, now)

    def on_event(self, status: DriveStatus, now: float) -> None:
        """Write the lines that were due at an event, also if this program is late."""
        with self._lock:
            for line in self._logger.update(status, now):
                self._write(f'{line}\n')

    def close(self) -> None:
        """Do nothing: the lines stay in the terminal."""


class PanelRenderer:
    """
    Shows a panel at the bottom of a terminal, or plain lines while the terminal is too small.

    :param write: a function that writes a text
    :param size: a function that returns the size of the terminal
    :param render: a function that returns the lines of a panel for a width, a status and a hint
    :param min_size: the smallest terminal for a panel [columns, rows]
    """

    #: a panel is drawn at most 5 times a second
    period = 0.2

    def __init__(
            self, write: Write, size: Callable[[], os.terminal_size],
            render: Callable[[int, DriveStatus, str], list[str]], min_size: Size) -> None:
        self._write, self._size, self._render, self._min_size = write, size, render, min_size
        self._lines = LineRenderer(write)
        self._drawn: tuple[os.terminal_size, list[str]] | None = None
        self._is_small = self._is_too_small(size())

    def show(self, status: DriveStatus, now: float, hint: str) -> None:
        """Draw the panel if it has changed."""
        size = self._size()
        if self._is_too_small(size):
            self.close()
            self._is_small = True
            self._lines.show(status, now, hint)
            return
        self._is_small = False
        lines = self._render(size.columns, status, hint)
        if self._drawn == (size, lines):
            return
        text = ''
        if self._drawn is None or self._drawn[0] != size:
            self.close()
            text = terminal.reserve_rows(size.lines, len(lines))
        self._write(text + terminal.draw_rows(size.lines, lines))
        self._drawn = size, lines

    def on_event(self, status: DriveStatus, now: float) -> None:
        """Write lines while the terminal is too small for a panel."""
        if self._is_small:
            self._lines.on_event(status, now)

    def close(self) -> None:
        """Release the rows of the panel."""
        if self._drawn is not None:
            self._write(terminal.RELEASE_ROWS)
            self._drawn = None

    def _is_too_small(self, size: os.terminal_size) -> bool:
        columns, rows = self._min_size
        return size.columns < columns or size.lines < rows


def renderer_for(descriptor: int) -> Renderer:
    """
    Return a renderer: a panel if the terminal and rich support it, else plain lines.

    :param descriptor: the file descriptor for the output
    """
    def write(text: str) -> None:
        # One write call, so that no output of other programs comes in between.
        os.write(descriptor, text.encode(sys.stderr.encoding, 'replace'))

    if not terminal.is_terminal(descriptor):
        return LineRenderer(write, has_hint=False)
    try:
        from kachaka_simple_control.display import panel
        from rich.console import Console
    except ModuleNotFoundError:
        write('To see more of the drive, install rich (`pip install rich`); until then each step '
              'is one line.\n')
        return LineRenderer(write)
    console = Console(file=sys.stderr, highlight=False, markup=False)
    return PanelRenderer(
        write, lambda: os.get_terminal_size(descriptor),
        lambda columns, status, hint: panel.render_panel(console, columns, status, hint),
        panel.MIN_SIZE)
