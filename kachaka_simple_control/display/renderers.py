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
import os
import sys
import threading
from typing import Protocol, TYPE_CHECKING

from kachaka_simple_control.display import terminal
from kachaka_simple_control.display.drive_status import DriveState, DriveStatus, StepStatus
from kachaka_simple_control.report.plan_view import format_number, pluralize
from kachaka_simple_control.report.text_tables import one_line

if TYPE_CHECKING:
    from rich.console import Console

#: Lines do not come faster than this [s].
APART = 0.5
#: Nobody needs to be told of a robot that answers sooner [s].
PATIENCE = 2.0
#: The longest name there is room for.
NAME = 36


class StepLogger:
    """Finds out what is worth a line: each step that begins, a robot waited for, an early end."""

    def __init__(self) -> None:
        """Have told nothing."""
        self._last_line = float('-inf')
        self._number = 0
        self._state = DriveState.READY
        self._state_since = float('-inf')
        self._has_told_wait = False

    def update(self, glance: DriveStatus, now: float) -> list[str]:
        """
        Look at what is going on.

        :param glance: what there is to see
        :param now: the time [s on the steady clock]; never earlier than before
        :returns: the lines that are due, mostly none
        """
        if glance.state is not self._state:
            self._turn(glance.state, now)
        if glance.state is DriveState.DRIVING and glance.step is not None:
            return self._step(glance.step, now)
        if glance.state is DriveState.WAITING and now - self._state_since >= PATIENCE:
            return self._wait(glance)
        return []

    def _turn(self, state: DriveState, now: float) -> None:
        self._state, self._state_since = state, now
        if state in (DriveState.WAITING, DriveState.CONNECTING):  # of a motion that begins now
            self._number = 0

    def _wait(self, glance: DriveStatus) -> list[str]:
        if self._has_told_wait:
            return []
        self._has_told_wait = True
        return [f'{one_line(glance.title, NAME)}: waiting for the robot']

    def _step(self, step: StepStatus, now: float) -> list[str]:
        if step.number == self._number or now - self._last_line < APART:
            return []
        passed = step.number - self._number - 1
        self._number, self._last_line = step.number, now
        line = f'{which(step)}: {step.words} ({format_number(round(step.duration, 3))} s)'
        return [f'{line}; {pluralize(passed, "step")} before it passed' if passed > 0 else line]


def which(step: StepStatus) -> str:
    """
    Return which step it is, in words.

    :param step: the step
    :returns: such as ``step 2 of 9``
    """
    if step.count is None:
        return f'movement {step.number}'
    return f'step {step.number} of {step.count}'


#: What a file descriptor is written to as.
Write = Callable[[str], None]


class Renderer(Protocol):
    """Where a drive is shown."""

    #: how long to wait before it is shown anew [s]
    period: float

    def show(self, glance: DriveStatus, now: float, hint: str) -> None:
        """
        Show what there is to see.

        :param glance: what there is to see
        :param now: the time [s on the steady clock]
        :param hint: how to stop
        """

    def on_event(self, glance: DriveStatus, now: float) -> None:
        """
        Note what there was to see when something happened, perhaps a while ago.

        Called by another thread than the others.

        :param glance: what there was to see
        :param now: when [s on the steady clock]
        """

    def close(self) -> None:
        """Take away what is not to stay."""


class LineRenderer:
    """Plain lines."""

    period = 0.1

    def __init__(self, write: Write) -> None:
        """
        Have written nothing.

        :param write: writes a text at once
        """
        self._write = write
        self._lines = StepLogger()
        self._looking = threading.Lock()

    def show(self, glance: DriveStatus, now: float, hint: str) -> None:
        """
        Write the lines that are due.

        :param glance: what there is to see
        :param now: the time [s on the steady clock]
        :param hint: not used: whoever reads lines cannot press keys
        """
        del hint
        self.on_event(glance, now)

    def on_event(self, glance: DriveStatus, now: float) -> None:
        """
        Write the lines that were due then: none is left out because this program was late.

        :param glance: what there was to see
        :param now: when [s on the steady clock]
        """
        with self._looking:
            for line in self._lines.update(glance, now):
                self._write(f'{line}\n')

    def close(self) -> None:
        """Leave the lines where they are."""


class PanelRenderer:
    """The lowest lines of a terminal; plain lines as long as it is too small for that."""

    #: 5 times a second is as often as anybody can read
    period = 0.2

    def __init__(
            self, write: Write, size: Callable[[], os.terminal_size],
            draw: Callable[[int, DriveStatus, str], list[str]], least: tuple[int, int]) -> None:
        """
        Show nothing yet.

        :param write: writes a text at once
        :param size: returns how large the terminal is
        :param draw: draws lines, told how wide they may be
        :param least: how many columns and rows a panel needs
        """
        self._write, self._size, self._draw, self._least = write, size, draw, least
        self._lines = LineRenderer(write)
        self._shown: tuple[os.terminal_size, list[str]] | None = None
        self._is_small = is_smaller(size(), least)

    def show(self, glance: DriveStatus, now: float, hint: str) -> None:
        """
        Draw what there is to see, if that has changed.

        :param glance: what there is to see
        :param now: the time [s on the steady clock]
        :param hint: how to stop
        """
        size = self._size()
        if is_smaller(size, self._least):
            self.close()
            self._is_small = True
            self._lines.show(glance, now, hint)
            return
        self._is_small = False
        lines = self._draw(size.columns, glance, hint)
        if self._shown == (size, lines):
            return
        text = ''
        if self._shown is None or self._shown[0] != size:
            self.close()
            text = terminal.reserve_rows(size.lines, len(lines))
        self._write(text + terminal.draw_rows(size.lines, lines))
        self._shown = size, lines

    def on_event(self, glance: DriveStatus, now: float) -> None:
        """
        Write lines as long as there is no room for a panel, which shows but what is.

        :param glance: what there was to see
        :param now: when [s on the steady clock]
        """
        if self._is_small:
            self._lines.on_event(glance, now)

    def close(self) -> None:
        """Give the terminal back."""
        if self._shown is not None:
            self._write(terminal.RELEASE_ROWS)
            self._shown = None


def is_smaller(size: os.terminal_size, least: tuple[int, int]) -> bool:
    """
    Tell whether a terminal is smaller than it must be.

    :param size: how large it is
    :param least: how many columns and rows it must have
    :returns: whether it has less of either
    """
    return size.columns < least[0] or size.lines < least[1]


def renderer_for(descriptor: int) -> Renderer:
    """
    Return how to show a drive.

    :param descriptor: where to write
    :returns: a panel on a terminal that can have one, or else plain lines
    """
    def write(text: str) -> None:
        # At once: nothing that others write may come in between.
        os.write(descriptor, text.encode(sys.stderr.encoding, 'replace'))

    if not has_terminal(descriptor):
        return LineRenderer(write)
    try:
        from kachaka_simple_control.display import panel
        from rich.console import Console
    except ModuleNotFoundError:
        write('To see more of the drive, install rich (`pip install rich`); steps are told in '
              'lines meanwhile.\n')
        return LineRenderer(write)
    console: Console = Console(file=sys.stderr, highlight=False, markup=False)
    return PanelRenderer(
        write, lambda: os.get_terminal_size(descriptor),
        lambda columns, glance, hint: panel.render_panel(console, columns, glance, hint),
        (panel.MIN_COLUMNS, panel.MIN_ROWS))


def has_terminal(descriptor: int) -> bool:
    """
    Tell whether a descriptor is a terminal that lines can stay in.

    :param descriptor: the descriptor
    :returns: whether it is
    """
    try:
        return os.isatty(descriptor) and os.environ.get('TERM', 'dumb') not in ('', 'dumb')
    except OSError:
        return False
