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
Single keys at the terminal of a drive.

The program that drives reads them, for only the foreground of a terminal may.  In the background
nothing is read: who tries that is suspended, and a drive that is suspended has ended.

The program that drives imports this module: it must load quickly, and without rich.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import contextlib
import os
import select
import signal
import termios
import threading
import time

STDIN = 0
#: How often a program looks whether it is in the foreground [s].
FOREGROUND_PERIOD = 0.2
#: How many keys are read at once [bytes].
KEY_COUNT = 64
#: The place of the local modes among the attributes of a terminal.
LOCAL_MODES = 3
#: Without these a terminal passes on each key at once, and does not show it; Ctrl+C is a signal.
LINE_MODES = termios.ICANON | termios.ECHO


class Keyboard:
    """
    Calls a function for each key, in a thread of its own; a context manager.

    Does nothing without keys, or where standard input is no terminal.

    :param functions: what to call, by key; other keys are ignored
    """

    def __init__(self, functions: Mapping[str, Callable[[], None]]) -> None:
        self._functions = functions
        self._end, self._is_reading = threading.Event(), threading.Event()
        self._setting_modes = threading.Lock()
        self._thread = threading.Thread(target=self._run, name='keyboard', daemon=True)

    def __enter__(self) -> Keyboard:
        """Read keys from now on, as soon as the program is in the foreground."""
        if self._functions and is_keyboard():
            self._thread.start()
            self._is_reading.wait(FOREGROUND_PERIOD)
        return self

    def __exit__(self, *error: object) -> None:
        """Read no more keys, and let the terminal collect lines again."""
        self._end.set()
        if self._thread.ident is not None:
            with self._setting_modes, contextlib.suppress(OSError, termios.error):
                # Who leaves the foreground just now must not be suspended by this.
                signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
                if _is_foreground():
                    set_line_modes(STDIN, is_on=True)

    def _run(self) -> None:
        # Blocked, these refuse a read in the background instead of suspending the program.
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        # Keys typed before were not meant to start something.
        ignored = '\n'
        with contextlib.suppress(OSError, termios.error):  # the terminal is gone
            while not self._end.is_set():
                if not _is_foreground():
                    self._end.wait(FOREGROUND_PERIOD)
                    continue
                with self._setting_modes:
                    # Each time: a shell sets its own modes while it has the foreground.
                    if not self._end.is_set():
                        set_line_modes(STDIN, is_on=False)
                timeout = 0.0 if ignored else FOREGROUND_PERIOD
                if select.select([STDIN], [], [], timeout)[0] and not self._read(ignored):
                    return
                ignored = ''
                self._is_reading.set()

    def _read(self, ignored: str) -> bool:
        """Read keys, and serve those that are not ignored; return False at the end of input."""
        try:
            keys = os.read(STDIN, KEY_COUNT)
        except OSError:  # in the background since just now
            time.sleep(FOREGROUND_PERIOD)
            return True
        for key in keys.decode(errors='replace'):
            if key in self._functions and key not in ignored:
                self._functions[key]()
        return bool(keys)


def is_keyboard() -> bool:
    """Return whether somebody can press keys: standard input is a terminal."""
    return os.isatty(STDIN)


def set_line_modes(descriptor: int, is_on: bool) -> None:
    """
    Let a terminal collect lines and show what is typed, or pass on each key.

    :param is_on: whether to collect lines
    """
    attributes = termios.tcgetattr(descriptor)
    modes = attributes[LOCAL_MODES]
    wanted = modes | LINE_MODES if is_on else modes & ~LINE_MODES
    if modes != wanted:
        attributes[LOCAL_MODES] = wanted
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


def _is_foreground() -> bool:
    return os.tcgetpgrp(STDIN) == os.getpgrp()
