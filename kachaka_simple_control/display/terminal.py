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
Start the display process of a driving program, draw in fixed terminal rows, and read single keys.

The lowest rows of the terminal are excluded from scrolling, so that the output of other programs
scrolls above them.  Each text for them must be written in one call.  Keys may be read in the
foreground only, where the display process never is: the driving program reads them.  It imports
this module, which must load quickly, without rich.

Tested by test/display/test_display_process.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import contextlib
import os
import select
import signal
import termios
import threading
import time

from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.process import processes
from kachaka_simple_control.process.output import has_room, STDERR
from kachaka_simple_control.telemetry.subscriber_process import SubscriberProcess

_SAVE, _RESTORE = '\x1b7', '\x1b8'
_HIDE, _SHOW = '\x1b[?25l', '\x1b[?25h'
_SCROLL_ALL = '\x1b[r'
_CLEAR_BELOW, _CLEAR_LINE = '\x1b[J', '\x1b[2K'

#: The escape sequences that remove the fixed rows and keep the cursor position.  They are harmless
#: if there are no fixed rows.
RELEASE_ROWS = f'{_SAVE}{_SCROLL_ALL}{_RESTORE}{_CLEAR_BELOW}{_SHOW}'
DISPLAY_MODULE = 'kachaka_simple_control.display.display_program'
#: How long the display may take to clear the terminal at the end [s].
DISPLAY_EXIT_TIMEOUT = 1.0
STDIN = 0
#: The time between two checks whether the program is in the foreground [s].
FOREGROUND_PERIOD = 0.2
#: How often the same warning is given while a key is held [s].
WARN_PERIOD = 1.0
#: The largest number of bytes that one read of the keyboard returns.
KEY_COUNT = 64
#: The index of the local modes in the list that ``termios.tcgetattr`` returns.
LOCAL_MODES = 3
#: The terminal modes that are cleared to get each key at once and without echo.  Ctrl+C still
#: sends a signal.
LINE_MODES = termios.ICANON | termios.ECHO


def reserve_rows(rows: int, height: int) -> str:
    """Return the escape sequences that reserve rows at the bottom, and clear below the cursor."""
    room = '\n' * height + f'\x1b[{height}A'
    return f'{_CLEAR_BELOW}{room}{_SAVE}\x1b[1;{rows - height}r{_RESTORE}'


def draw_rows(rows: int, lines: Sequence[str]) -> str:
    """Return the text that draws the rows at the bottom; the cursor stays where it is."""
    first = rows - len(lines) + 1
    drawn = ''.join(
        f'\x1b[{first + index};1H{_CLEAR_LINE}{line}' for index, line in enumerate(lines))
    return f'{_SAVE}{_HIDE}{drawn}{_RESTORE}{_SHOW}'


def is_terminal(descriptor: int) -> bool:
    """Return whether a file descriptor is a terminal that can keep rows fixed at the bottom."""
    try:
        return os.isatty(descriptor) and os.environ.get('TERM', 'dumb') not in ('', 'dumb')
    except OSError:
        return False


class DisplayProcess(SubscriberProcess):
    """
    Starts the process that displays a drive in the terminal, and ends it.

    If it is killed, the terminal is restored at once.  If it does not exit at the end of the
    drive, it is killed, unless Ctrl+S blocks the terminal: then it clears that after Ctrl+Q.
    """

    def __init__(self) -> None:
        super().__init__(processes.python_command(DISPLAY_MODULE))
        self._restoring = threading.Thread(target=self._restore, name='display', daemon=True)
        self._restoring.start()

    def close(self, timeout: float) -> int | None:
        """
        Close the pipe to the display, and wait for its exit code, at most 1 s.

        :returns: None if it still waits for a terminal that Ctrl+S has blocked
        """
        if super().close(min(timeout, DISPLAY_EXIT_TIMEOUT)) is None:
            if not has_room(STDERR):
                return None
            self._process.kill()
        code = self._process.wait()
        self._restoring.join(DISPLAY_EXIT_TIMEOUT)
        return code

    def _restore(self) -> None:
        if self._process.wait() != 0 and is_terminal(STDERR):
            with contextlib.suppress(OSError):
                os.write(STDERR, RELEASE_ROWS.encode())


class Keyboard:
    """
    Reads keys in a thread, and calls a function for each; a context manager.

    Without functions, or if standard input is no terminal, it does nothing.

    :param functions: by the character that is typed
    :param warn: called with the text of a ControlError that one of them raises
    """

    def __init__(
            self, functions: Mapping[str, Callable[[], object]],
            warn: Callable[[str], object]) -> None:
        self._functions, self._warn = functions, warn
        #: the newest warning, and when it was given [s on the steady clock]
        self._warning, self._warned = '', float('-inf')
        self._end, self._is_reading = threading.Event(), threading.Event()
        self._setting_modes = threading.Lock()
        self._thread = threading.Thread(target=self._run, name='keyboard', daemon=True)

    def __enter__(self) -> Keyboard:
        """Start to read keys; while this program is in the background, it does not read."""
        if self._functions and is_keyboard():
            self._thread.start()
            self._is_reading.wait(FOREGROUND_PERIOD)
        return self

    def __exit__(self, *error: object) -> None:
        """Stop reading keys, and switch the line mode and the echo of the terminal on again."""
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
        # An Enter that was pressed before this thread started must not start a motion.
        ignored = '\n'
        with contextlib.suppress(OSError, termios.error):  # the terminal was closed
            while not self._end.is_set():
                if not _is_foreground():
                    self._end.wait(FOREGROUND_PERIOD)
                    continue
                with self._setting_modes:
                    # Set each time, because a shell sets its own modes while in the foreground.
                    if not self._end.is_set():
                        set_line_modes(STDIN, is_on=False)
                timeout = 0.0 if ignored else FOREGROUND_PERIOD
                if select.select([STDIN], [], [], timeout)[0] and not self._read(ignored):
                    return
                ignored = ''
                self._is_reading.set()

    def _read(self, ignored: str) -> bool:
        """Read the pressed keys, and call the function of each key."""
        try:
            keys = os.read(STDIN, KEY_COUNT)
        except OSError:  # the program has just left the foreground
            time.sleep(FOREGROUND_PERIOD)
            return True
        for key in keys.decode(errors='replace'):
            if key in self._functions and key not in ignored:
                try:
                    self._functions[key]()
                except ControlError as error:
                    self._warn_once(str(error))
        return bool(keys)

    def _warn_once(self, text: str) -> None:
        """Give a warning, but not for each repetition of a key that is held."""
        now = time.monotonic()
        if text != self._warning or now - self._warned >= WARN_PERIOD:
            self._warning, self._warned = text, now
            self._warn(text)


def is_keyboard() -> bool:
    """Return whether standard input is a terminal, where a user can press keys."""
    return os.isatty(STDIN)


def set_line_modes(descriptor: int, is_on: bool) -> None:
    """Switch whole lines with echo on, or off for single keys without echo."""
    attributes = termios.tcgetattr(descriptor)
    modes = attributes[LOCAL_MODES]
    wanted = modes | LINE_MODES if is_on else modes & ~LINE_MODES
    if modes != wanted:
        attributes[LOCAL_MODES] = wanted
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


def _is_foreground() -> bool:
    return os.tcgetpgrp(STDIN) == os.getpgrp()
