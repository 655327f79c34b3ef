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
"""A terminal emulator, and programs that run in it."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import select
import struct
import sys
import termios

from program import children_of, environment, find_process, Program
from waiting import poll

SEQUENCE = re.compile(r'\x1b(?:\[([?0-9;]*)([A-Za-z])|([78]))')

NEVER_WAITS = os.open(os.devnull, os.O_RDONLY)


class Typed(io.StringIO):
    """Standard input at a terminal where something was typed."""

    def fileno(self) -> int:
        """Return a file that `select` calls readable."""
        return NEVER_WAITS

    def isatty(self) -> bool:
        """Return that it is one."""
        return True


class Screen:
    """A screen that implements the escape sequences that our programs use."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self.lines = [''] * rows
        #: lines that have scrolled out at the top
        self.history: list[str] = []
        self.row = self.column = 0
        self.bottom = rows
        self.cursor_is_shown = True
        #: whether a frame has begun that has not ended yet
        self.in_frame = False
        self._saved = (0, 0)

    def write(self, text: str) -> None:
        """Write text and escape sequences."""
        place = 0
        for match in SEQUENCE.finditer(text):
            self._print(text[place:match.start()])
            self._execute(*match.groups())
            place = match.end()
        self._print(text[place:])

    @property
    def above(self) -> list[str]:
        """Return the lines above the panel, from the first on."""
        lines = [*self.history, *self.lines[:self.bottom]]
        while lines and not lines[-1].strip():
            lines.pop()
        return [line.rstrip() for line in lines]

    def _print(self, text: str) -> None:
        for sign in text:
            if sign == '\n':
                self._feed()
            elif sign == '\r':
                self.column = 0
            else:
                if self.column == self.columns:
                    self.column = 0
                    self._feed()
                line = self.lines[self.row].ljust(self.column)
                self.lines[self.row] = line[:self.column] + sign + line[self.column + 1:]
                self.column += 1

    def _feed(self) -> None:
        if self.row == self.bottom - 1:
            self.history.append(self.lines.pop(0))
            self.lines.insert(self.bottom - 1, '')
        else:
            self.row = min(self.row + 1, self.rows - 1)

    def _execute(self, numbers: str | None, letter: str | None, digit: str | None) -> None:
        if digit:
            self.in_frame = digit == '7'
            if self.in_frame:
                self._saved = self.row, self.column
            else:
                self.row, self.column = self._saved
        elif letter == 'A':
            self.row = max(0, self.row - int(numbers or 1))
        elif letter == 'H':
            row, column = (int(number) for number in (numbers or '1;1').split(';'))
            self.row, self.column = row - 1, column - 1
        elif letter == 'K':
            self.lines[self.row] = ''
        elif letter == 'J':
            self.lines[self.row] = self.lines[self.row][:self.column]
            self.lines[self.row + 1:] = [''] * (self.rows - self.row - 1)
        elif letter == 'r':
            self.bottom = int(numbers.split(';')[1]) if numbers else self.rows
            self.row = self.column = 0
        elif numbers == '?25':
            self.cursor_is_shown = letter == 'h'
        else:
            assert letter == 'm', f'unknown: ESC {numbers}{letter}'


class TerminalProgram(Program):
    """A process at a terminal of its own, whose screen has all that it writes."""

    def __init__(self, command: list[str], columns: int, rows: int) -> None:
        """Start it with the terminal as its controlling one, so that Ctrl+C reaches it."""
        self.leader, follower = pty.openpty()
        self.screen = Screen(columns, rows)
        self._rest = b''
        self._is_over = False
        self.resize(columns, rows)
        starter = (
            'import fcntl, os, sys, termios; fcntl.ioctl(2, termios.TIOCSCTTY, 0); '
            'os.execv(sys.argv[1], sys.argv[1:])')
        super().__init__(
            [sys.executable, '-c', starter, *command], stdin=follower, stdout=follower,
            stderr=follower, env=environment(TERM='xterm-256color'))
        os.close(follower)

    @property
    def text(self) -> str:
        """Read what it has written, up to the end of a frame; return the text of the terminal."""
        # A frame of a fleet is larger than what a terminal holds.
        while not self._is_over and select.select(
                [self.leader], [], [], 1.0 if self.screen.in_frame else 0.0)[0]:
            self._read()
        return '\n'.join([*self.screen.history, '-' * 20, *self.screen.lines])

    @property
    def is_over(self) -> bool:
        """Return whether all that could write to the terminal is gone."""
        return self._is_over

    def resize(self, columns: int, rows: int) -> None:
        """Set the size of the terminal."""
        size = struct.pack('HHHH', rows, columns, 0, 0)
        fcntl.ioctl(self.leader, termios.TIOCSWINSZ, size)

    def press(self, keys: bytes) -> None:
        """Press keys."""
        os.write(self.leader, keys)

    def read_for(self, seconds: float) -> None:
        """Read what it writes for a while."""
        poll(lambda: self.text and self._is_over, seconds)

    def end(self, timeout: float = 30.0) -> int:
        """Read what it writes until its end; return its exit code as a shell gives it."""
        poll(lambda: self.text and self.process.poll() is not None, timeout)
        self.read_for(0.3)
        return super().end(0.0)

    def display(self) -> int:
        """Return the id of the display process."""
        display = find_process(children_of(self.process.pid), 'display.display_program')
        assert display is not None, f'there is no display process; {self}'
        return display

    def close(self, timeout: float = 0.0, signum: int = 0) -> bool:
        """End it and its children, and close the terminal."""
        have_ended = super().close(timeout, signum)
        self._is_over = True
        os.close(self.leader)
        return have_ended

    def _read(self) -> None:
        try:
            data = self._rest + os.read(self.leader, 65536)
        except OSError:  # all followers are closed
            self._is_over = True
            return
        # A character or a sequence may be cut in two.
        text = data.decode(errors='ignore')
        cut = text.rfind('\x1b')
        if cut >= 0 and not SEQUENCE.match(text, cut):
            text = text[:cut]
        self._rest = data[len(text.encode()):]
        self.screen.write(text)


def at_terminal(command: list[str], columns: int = 100, rows: int = 24) -> TerminalProgram:
    """Run a command at a terminal in a ``with`` block."""
    return TerminalProgram(command, columns, rows)
