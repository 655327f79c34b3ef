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
Read single keys from the terminal of a drive.

The driving program reads the keys, because only a foreground process may read from a terminal.
In the background it does not read: the read would suspend the program and end the drive.

The driving program imports this module, so it must load quickly, and without rich.
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
#: The period of the check whether the program is in the foreground [s].
FOREGROUND_PERIOD = 0.2
#: The largest number of bytes of one read.
KEY_COUNT = 64
#: The index of the local modes in the attributes of a terminal.
LOCAL_MODES = 3
#: The modes that are cleared to get each key at once and without echo; Ctrl+C stays a signal.
LINE_MODES = termios.ICANON | termios.ECHO


class Keyboard:
    """
    A context manager that calls a function for each pressed key, in its own thread.

    It does nothing if there are no functions or if standard input is not a terminal.

    :param functions: the function to call for each key; other keys are ignored
    """

    def __init__(self, functions: Mapping[str, Callable[[], None]]) -> None:
        self._functions = functions
        self._end, self._is_reading = threading.Event(), threading.Event()
        self._setting_modes = threading.Lock()
        self._thread = threading.Thread(target=self._run, name='keyboard', daemon=True)

    def __enter__(self) -> Keyboard:
        """Start to read keys; keys are read only while the program is in the foreground."""
        if self._functions and is_keyboard():
            self._thread.start()
            self._is_reading.wait(FOREGROUND_PERIOD)
        return self

    def __exit__(self, *error: object) -> None:
        """Stop reading keys, and set the terminal to line mode."""
        self._end.set()
        if self._thread.ident is not None:
            with self._setting_modes, contextlib.suppress(OSError, termios.error):
                # The program must not be suspended if it leaves the foreground now.
                signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTTOU})
                if _is_foreground():
                    set_line_modes(STDIN, is_on=True)

    def _run(self) -> None:
        # With blocked signals, a read in the background fails instead of suspending the program.
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        # An Enter that was typed before must not start a motion.
        ignored = '\n'
        with contextlib.suppress(OSError, termios.error):  # the terminal was closed
            while not self._end.is_set():
                if not _is_foreground():
                    self._end.wait(FOREGROUND_PERIOD)
                    continue
                with self._setting_modes:
                    # Repeated, because a shell sets its own modes while in the foreground.
                    if not self._end.is_set():
                        set_line_modes(STDIN, is_on=False)
                timeout = 0.0 if ignored else FOREGROUND_PERIOD
                if select.select([STDIN], [], [], timeout)[0] and not self._read(ignored):
                    return
                ignored = ''
                self._is_reading.set()

    def _read(self, ignored: str) -> bool:
        """Read keys and call their functions; return False at the end of input."""
        try:
            keys = os.read(STDIN, KEY_COUNT)
        except OSError:  # the program has just left the foreground
            time.sleep(FOREGROUND_PERIOD)
            return True
        for key in keys.decode(errors='replace'):
            if key in self._functions and key not in ignored:
                self._functions[key]()
        return bool(keys)


def is_keyboard() -> bool:
    """Return whether standard input is a terminal, where a user can press keys."""
    return os.isatty(STDIN)


def set_line_modes(descriptor: int, is_on: bool) -> None:
    """
    Switch the line mode and the echo of a terminal on or off.

    :param descriptor: the file descriptor of the terminal
    :param is_on: True for whole lines with echo, False for single keys without echo
    """
    attributes = termios.tcgetattr(descriptor)
    modes = attributes[LOCAL_MODES]
    wanted = modes | LINE_MODES if is_on else modes & ~LINE_MODES
    if modes != wanted:
        attributes[LOCAL_MODES] = wanted
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


def _is_foreground() -> bool:
    return os.tcgetpgrp(STDIN) == os.getpgrp()
