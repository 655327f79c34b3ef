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
The program that shows a running drive, in its own process.

Drawing therefore never holds the GIL of the driving program, and an error in this program does
not end the drive.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import termios
import threading
import time

from kachaka_simple_control.control.events import Event, VelocitySent
from kachaka_simple_control.control.output import make_blocking, STDERR
from kachaka_simple_control.control.processes import (
    is_in_background,
    is_stopped,
    set_idle_priority,
)
from kachaka_simple_control.display.drive_status import DriveTracker
from kachaka_simple_control.display.keyboard import set_line_modes
from kachaka_simple_control.display.renderers import Renderer, renderer_for
from kachaka_simple_control.telemetry.subscriber_process import decode

#: The longest time between the kill of a process and its end [s].
KILL_TIMEOUT = 0.5
#: The longest time that a frame waits for the next velocity [s].
VELOCITY_TIMEOUT = 0.1


class TerminalDisplay:
    """
    Shows the drive whose events arrive on standard input.

    :param renderer: the renderer of the status
    :param parent: the process id of the driving program
    """

    def __init__(self, renderer: Renderer, parent: int) -> None:
        self._renderer, self._parent = renderer, parent
        self._tracker = DriveTracker()
        self._lock = threading.Lock()
        self._end = threading.Event()
        self._velocity_sent = threading.Event()

    def run(self) -> None:
        """Show the drive until the end of standard input."""
        threading.Thread(target=self._read_events, name='events', daemon=True).start()
        try:
            while not self._end.wait(self._renderer.period):
                # After a velocity the robot's thread sleeps, so drawing does not delay it.
                self._velocity_sent.clear()
                self._velocity_sent.wait(VELOCITY_TIMEOUT)
                self._show()
        finally:
            self._renderer.close()
        if self._tracker.session_ended is None and self._is_orphan():
            if self._tracker.has_keys:  # the killed program could not restore the modes
                with contextlib.suppress(OSError, termios.error):
                    set_line_modes(STDERR, is_on=True)
            # The line break is for a shell prompt that may already be there.
            print(f'\n{describe_killed(self._tracker)}', file=sys.stderr, flush=True)

    def _read_events(self) -> None:
        try:
            for event in decode(sys.stdin.buffer):
                self._on_event(event)
        finally:
            self._end.set()
            self._velocity_sent.set()

    def _on_event(self, event: Event) -> None:
        with self._lock:
            self._tracker.on_event(event)
            if not isinstance(event, VelocitySent):
                return
            status = self._tracker.status_at(event.time)
        self._velocity_sent.set()
        self._renderer.on_event(status, event.time)

    def _show(self) -> None:
        if is_stopped(self._parent):
            # After Ctrl+Z the terminal belongs to another program.
            self._renderer.close()
            return
        now = time.monotonic()
        with self._lock:
            status = self._tracker.status_at(now)
        self._renderer.show(
            status, now, stop_hint(self._parent, self._tracker.has_keys, status.is_held))

    def _is_orphan(self) -> bool:
        end = time.monotonic() + KILL_TIMEOUT
        while os.getppid() == self._parent and time.monotonic() < end:
            time.sleep(0.01)
        return os.getppid() != self._parent


def describe_killed(tracker: DriveTracker) -> str:
    """Return a line about a killed program: whether it was driving, and who stops the robot."""
    killed = 'kachaka_simple_control was killed'
    if not tracker.is_under_way:
        return killed
    if tracker.is_guarded:
        return f'{killed} in mid-motion: its guardian stops the robot'
    return f'{killed} in mid-motion, and has no guardian: nothing but the robot itself stops it'


def stop_hint(pid: int, has_keys: bool, is_held: bool) -> str:
    """
    Return a short text that says how to stop a driving program, with its other keys.

    :param pid: the process id of the program
    :param has_keys: whether the program reads keys
    :param is_held: whether the motion is paused, or the next motion will start paused
    """
    if is_in_background(pid):
        return f'`kill {pid}` stops the robot'
    if not has_keys:
        return 'Ctrl+C stops the robot'
    return f'{"r resumes" if is_held else "space pauses"}, + - speed, q stops'


def main() -> int:
    """Show the drive; return the exit code, which is 0 only if the terminal is restored."""
    parent = os.getppid()
    make_blocking(STDERR)  # a partly written frame would corrupt the terminal
    set_idle_priority()  # a frame may be late, a velocity may not
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        TerminalDisplay(renderer_for(STDERR), parent).run()
    except OSError:  # the terminal is closed or does not accept output
        return 1
    return 0
