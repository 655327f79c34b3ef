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
The program that shows a drive while it goes on; a process of its own.

Drawing never competes with the thread that moves the robot for Python's lock, and whatever
becomes of this program, the one that drives does not notice.
"""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
import signal
import sys
import threading
import time

from kachaka_simple_control.control.output import make_blocking, STDERR
from kachaka_simple_control.control.processes import is_stopped, set_idle_priority
from kachaka_simple_control.display.drive_status import DriveTracker
from kachaka_simple_control.display.renderers import Renderer, renderer_for
from kachaka_simple_control.telemetry.events import Event, VelocitySent
from kachaka_simple_control.telemetry.subscriber_process import decode

#: How long a process that was killed may take to be gone [s].
FAREWELL = 0.5
#: How long a frame waits for a velocity to be sent [s].
BREATH = 0.1


class TerminalDisplay:
    """
    Shows what it hears of.

    :param screen: where
    :param parent: the process that drives
    """

    def __init__(self, screen: Renderer, parent: int) -> None:
        """Have heard nothing."""
        self._screen, self._parent = screen, parent
        self._progress = DriveTracker()
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._sent = threading.Event()

    def run(self) -> None:
        """Show until there is nothing more to hear."""
        threading.Thread(target=self._listen, name='events', daemon=True).start()
        try:
            while not self._over.wait(self._screen.period):
                # Then the robot's thread sleeps for a period: two at once slow each other down.
                self._sent.clear()
                self._sent.wait(BREATH)
                self._show()
        finally:
            self._screen.close()
        if self._progress.closed is None and self._is_orphan():
            # The prompt of a shell may be there by now.
            print(f'\n{describe_killed(self._progress)}', file=sys.stderr, flush=True)

    def _listen(self) -> None:
        try:
            for event in decode(sys.stdin.buffer):
                self._hear(event)
        finally:
            self._over.set()
            self._sent.set()

    def _hear(self, event: Event) -> None:
        with self._lock:
            self._progress.on_event(event)
            if not isinstance(event, VelocitySent):
                return
            glance = self._progress.status_at(event.time)
        self._sent.set()
        self._screen.on_event(glance, event.time)

    def _show(self) -> None:
        if is_stopped(self._parent):
            # Ctrl+Z: the terminal is somebody else's now.
            self._screen.close()
            return
        now = time.monotonic()
        with self._lock:
            glance = self._progress.status_at(now)
        self._screen.show(glance, now, stop_hint(self._parent))

    def _is_orphan(self) -> bool:
        end = time.monotonic() + FAREWELL
        while os.getppid() == self._parent and time.monotonic() < end:
            time.sleep(0.01)
        return os.getppid() != self._parent


def describe_killed(progress: DriveTracker) -> str:
    """
    Return what to say of a program that was killed.

    :param progress: what was heard of it
    :returns: a line
    """
    gone = 'kachaka_simple_control was killed'
    if not progress.is_under_way:
        return gone
    if progress.is_guarded:
        return f'{gone} in mid-motion: its guardian stops the robot'
    return f'{gone} in mid-motion, and has no guardian: nothing but the robot itself stops it'


def stop_hint(pid: int) -> str:
    """
    Return how to stop a program that drives.

    :param pid: the program
    :returns: a few words
    """
    return 'Ctrl+C stops the robot' if has_keyboard(pid) else f'`kill {pid}` stops the robot'


def has_keyboard(pid: int) -> bool:
    """
    Tell whether Ctrl+C reaches a process.

    :param pid: the process
    :returns: false if it is known to be in the background of its terminal
    """
    try:
        status = Path(f'/proc/{pid}/stat').read_text()
    except OSError:
        return True
    # After the name: state, parent, group, session, terminal, the terminal's foreground group.
    fields = status.rpartition(')')[2].split()
    group, foreground = int(fields[2]), int(fields[5])
    return foreground in (-1, group)


def main(args: Sequence[str] | None = None) -> int:
    """
    Show what is heard from standard input.

    :param args: none
    :returns: the exit code; anything but 0 if the terminal may not be as it was
    """
    del args
    parent = os.getppid()
    make_blocking(STDERR)  # half a frame would spoil the terminal
    set_idle_priority()  # a frame that comes late is no harm, and a velocity is
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        TerminalDisplay(renderer_for(STDERR), parent).run()
    except OSError:  # the terminal is gone, or does not take more
        return 1
    return 0
