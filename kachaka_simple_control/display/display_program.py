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
The program that shows a running drive in the terminal, as a panel or as plain lines.

A process of its own: drawing never holds the GIL of the driving program, and an error here does
not end the drive.  Tested by test/display/test_display_process.py.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from functools import partial
import math
import os
import signal
import sys
import termios
import threading
import time

from kachaka_simple_control.control.events import (
    DriveState,
    Event,
    FleetStarted,
    RobotEvent,
    VelocitySent,
)
from kachaka_simple_control.display import terminal
from kachaka_simple_control.display.drive_status import DriveStatus, DriveTracker, STEP, StepStatus
from kachaka_simple_control.display.fleet_status import (
    FleetLogger,
    FleetStatus,
    FleetTracker,
)
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.process import processes
from kachaka_simple_control.process.output import make_blocking, STDERR
from kachaka_simple_control.process.waiting import wait_until
from kachaka_simple_control.telemetry.subscriber_process import decode
from kachaka_simple_control.text import one_line, pluralize

#: How long to wait for the end of the driving program after its pipe was closed [s].
KILL_TIMEOUT = 0.5
#: How long the display waits for the next velocity before it draws [s].
VELOCITY_TIMEOUT = 0.1
#: The shortest time between two lines about steps [s].
MIN_LINE_PERIOD = 0.5
#: If the program waits for a robot for this time, a line reports the wait [s].
WAIT_NOTICE_DELAY = 2.0
#: The largest width of a motion's name [columns].
MAX_NAME_WIDTH = 36
#: The smallest size of a terminal that shows a panel [columns], [rows].
MIN_COLUMNS, MIN_ROWS = 60, 12


class StepLogger:
    """Creates text lines that say that a step begins, or that the program waits for the robot."""

    def __init__(self) -> None:
        self._last_line = float('-inf')
        self._number = 0
        self._state = DriveState.READY
        self._state_since = float('-inf')
        self._has_noted_wait = False

    def update(self, status: DriveStatus, now: float) -> list[str]:
        """
        Return the new lines to print for the current status; usually there are none.

        One for each new step, at most one in 0.5 s, with how many had none; one when the program
        has waited for the robot for 2 s.
        """
        if status.state is not self._state:
            self._state, self._state_since = status.state, now
            begins = status.state in (DriveState.WAITING, DriveState.CONNECTING)
            if begins and (status.step is None or status.step.noun == STEP):
                self._number = 0  # each motion counts its steps from 1; movements are counted on
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


class LineRenderer:
    """
    Shows the status of a drive as plain lines of text.

    :param write: a function that writes a text to the output with a single system call
    """

    #: the period at which ``show`` must be called [s]
    period = 0.1

    def __init__(self, write: Callable[[str], None], has_hint: bool = True) -> None:
        self._write = write
        self._has_hint = has_hint
        self._logger, self._fleet_logger = StepLogger(), FleetLogger()
        self._lock = threading.Lock()

    def show(self, status: DriveStatus | FleetStatus, now: float, hint: str) -> None:
        """Write lines about a new step or a long wait and, before the first motion, the hint."""
        if self._has_hint and status.state in (DriveState.CONNECTING, DriveState.DRIVING):
            self._has_hint = False
            self._write(f'{hint}\n')
        self.on_event(status, now)

    def on_event(self, status: DriveStatus | FleetStatus, now: float) -> None:
        """Write such lines after an event; called by the threads that read and that draw."""
        with self._lock:
            for line in (self._fleet_logger.update(status, now)
                         if isinstance(status, FleetStatus) else
                         self._logger.update(status, now)):
                self._write(f'{line}\n')

    def close(self) -> None:
        """Do nothing, because plain lines stay in the terminal when the display ends."""


class PanelRenderer(LineRenderer):
    """
    Shows a panel, rows at the bottom of the terminal; plain lines while it is too small.

    :param write: writes a text to the terminal with a single system call
    """

    #: a panel is drawn at most 5 times a second
    period = 0.2

    def __init__(
            self, write: Callable[[str], None], size: Callable[[], os.terminal_size],
            render: Callable[
                [os.terminal_size, DriveStatus | FleetStatus, str], list[str]]) -> None:
        super().__init__(write)
        self._size, self._render = size, render
        self._drawn: tuple[os.terminal_size, list[str]] | None = None
        self._is_small = _is_too_small(size())

    def show(self, status: DriveStatus | FleetStatus, now: float, hint: str) -> None:
        """Draw the panel if its text or the size of the terminal has changed."""
        size = self._size()
        if _is_too_small(size):
            self.close()
            self._is_small = True
            super().show(status, now, hint)
            return
        self._is_small = False
        lines = self._render(size, status, hint)
        if self._drawn == (size, lines):
            return
        text = ''
        if self._drawn is None or self._drawn[0] != size or len(self._drawn[1]) != len(lines):
            self.close()
            text = terminal.reserve_rows(size.lines, len(lines))
        self._write(text + terminal.draw_rows(size.lines, lines))
        self._drawn = size, lines

    def on_event(self, status: DriveStatus | FleetStatus, now: float) -> None:
        """Write plain lines if the terminal is too small for the panel; otherwise do nothing."""
        if self._is_small:
            super().on_event(status, now)

    def close(self) -> None:
        """Remove the panel, so that the whole terminal scrolls again."""
        if self._drawn is not None:
            self._write(terminal.RELEASE_ROWS)
            self._drawn = None


def _is_too_small(size: os.terminal_size) -> bool:
    return size.columns < MIN_COLUMNS or size.lines < MIN_ROWS


def renderer_for(descriptor: int) -> LineRenderer:
    """Return what shows the status: a panel if the terminal and rich are there, else lines."""
    def write(text: str) -> None:
        # One write call, so that no output of other programs comes in between.
        os.write(descriptor, text.encode(sys.stderr.encoding, 'replace'))

    if not terminal.is_terminal(descriptor):
        return LineRenderer(write, has_hint=False)
    try:
        from kachaka_simple_control.display.fleet_panel import render_fleet
        from kachaka_simple_control.display.panel import render_panel
        from rich.console import Console
    except ModuleNotFoundError:
        write('To see more of the drive, install rich (`pip install rich`); until then each step '
              'is one line.\n')
        return LineRenderer(write)
    console = Console(file=sys.stderr, highlight=False, markup=False)

    def render(
            size: os.terminal_size, status: DriveStatus | FleetStatus, hint: str) -> list[str]:
        if isinstance(status, FleetStatus):
            return render_fleet(console, size, status, hint)
        return render_panel(console, size.columns, status, hint)

    return PanelRenderer(write, partial(os.get_terminal_size, descriptor), render)


class TerminalDisplay:
    """
    Shows a drive, or that of a fleet; it reads the events of the program from standard input.

    :param renderer: the object that shows the status, as a panel or as plain lines
    """

    def __init__(self, renderer: LineRenderer, parent: int) -> None:
        self._renderer, self._parent = renderer, parent
        self._tracker: DriveTracker | FleetTracker = DriveTracker()
        self._lock = threading.Lock()
        self._end = threading.Event()
        self._velocity_sent = threading.Event()

    def run(self) -> None:
        """
        Show the drive until the driving program closes the pipe to standard input.

        If the driving program was killed, restore the terminal, and print a line that says so.
        """
        threading.Thread(target=self._read_events, name='events', daemon=True).start()
        try:
            while not self._end.wait(self._renderer.period):
                # Draw just after a velocity: the driving thread then sleeps and is not delayed.
                self._velocity_sent.clear()
                self._velocity_sent.wait(VELOCITY_TIMEOUT)
                self._show()
        finally:
            self._renderer.close()
        if self._tracker.session_ended is None and wait_until(
                lambda: os.getppid() != self._parent, KILL_TIMEOUT):
            if self._tracker.has_keys:  # the killed program left the line mode off
                with contextlib.suppress(OSError, termios.error):
                    terminal.set_line_modes(STDERR, is_on=True)
            # The line break separates the text from a shell prompt that may already be printed.
            print(f'\n{describe_killed(self._tracker)}', file=sys.stderr, flush=True)

    def _read_events(self) -> None:
        try:
            for event in decode(sys.stdin.buffer):
                self._on_event(event)
        finally:
            self._end.set()
            self._velocity_sent.set()

    def _on_event(self, event: Event | RobotEvent) -> None:
        with self._lock:
            if isinstance(event, FleetStarted):
                self._tracker = FleetTracker(event)
            if isinstance(self._tracker, FleetTracker):
                self._tracker.on_event(event)
            if isinstance(self._tracker, FleetTracker) or isinstance(event, RobotEvent):
                return
            self._tracker.on_event(event)
            if not isinstance(event, VelocitySent):
                return
            status = self._tracker.status_at(event.time)
        self._velocity_sent.set()
        self._renderer.on_event(status, event.time)

    def _show(self) -> None:
        if processes.is_stopped(self._parent):
            # After Ctrl+Z another program uses the terminal.
            self._renderer.close()
            return
        now = time.monotonic()
        with self._lock:
            status = self._tracker.status_at(now)
        self._renderer.show(
            status, now, stop_hint(self._parent, self._tracker, status.waits_for_resume))


def describe_killed(tracker: DriveTracker | FleetTracker) -> str:
    """
    Return a line for the user about a driving program that was killed in a motion or at rest.

    It says whether a guardian stops what it drove.
    """
    killed = f'{tracker.program} was killed'
    if not tracker.is_under_way:
        return killed
    if tracker.is_guarded:
        return f'{killed} in mid-motion: its guardian stops {tracker.what}'
    return f'{killed} in mid-motion, and has no guardian: nothing but the robot itself stops it'


def stop_hint(
        pid: int, tracker: DriveTracker | FleetTracker, waits_for_resume: bool) -> str:
    """Return a short text that says how to stop the robot, and which other keys there are."""
    if processes.is_in_background(pid):
        return f'`kill {pid}` stops {tracker.what}'
    if not tracker.has_keys:
        return f'Ctrl+C stops {tracker.what}'
    if isinstance(tracker, FleetTracker):  # its speed is chosen before the start
        return f'{"r resumes" if waits_for_resume else "space pauses"}, Ctrl+C stops all'
    return f'{"r resumes" if waits_for_resume else "space pauses"}, + - speed, q stops'


def main() -> int:
    """
    Show the drive of the program that started this process.

    :returns: 1 if writing failed, so the driving program must restore the terminal
    """
    parent = os.getppid()
    make_blocking(STDERR)  # a partly written frame would corrupt the terminal
    processes.set_idle_priority()  # drawing may be late, but velocities may not
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        TerminalDisplay(renderer_for(STDERR), parent).run()
    except OSError:  # the terminal is closed or does not accept output
        return 1
    return 0
