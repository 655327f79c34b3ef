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
"""The process of a program that drives a robot."""

from __future__ import annotations

import contextlib
import fcntl
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import termios
import time

from kachaka_simple_control.control.processes import is_running
from program import children_of, environment, fill, find_process

#: How long a program may take to be ready to move, also on a loaded machine [s].
READY_TIMEOUT = 40.0
POLL_PERIOD = 0.02


class Program:
    """
    A script in a session of its own.

    It makes a file when it is ready, waits for a line on its standard input, then moves.

    :param text: the script
    :param options: its arguments
    :param variables: added to its environment
    :param output: what it prints to: 'file', 'pipe', 'terminal', which is its input, too, or
        'full', a pipe that can be filled
    """

    def __init__(
            self, text: str, options: list[str], variables: dict[str, str],
            output: str = 'file') -> None:
        self.folder = Path(tempfile.mkdtemp(prefix='stop_matrix_'))
        self._log = self.folder / 'log.txt'
        self._output_kind = output
        self._printed = ''
        script = self.folder / 'script.py'
        script.write_text(text)
        ours, theirs = os.openpty() if output == 'terminal' else os.pipe()
        self._descriptor = ours
        with self._log.open('w') as log:
            out = log.fileno() if output == 'file' else theirs
            self.process = subprocess.Popen(
                [sys.executable, str(script), *options], cwd=self.folder,
                stdin=theirs if output == 'terminal' else subprocess.PIPE, stdout=out,
                stderr=out, start_new_session=True,
                # No other thread of this process starts programs or holds a lock that the child
                # needs.
                preexec_fn=_take_terminal if output == 'terminal' else None,  # noqa: PLW1509
                env={**environment(), **variables})
        self._filled = theirs if output == 'full' else -1
        if self._filled < 0:
            os.close(theirs)
        self._children: list[int] = []

    def wait_until_ready(self) -> None:
        """
        Wait until it is connected to its robot.

        :raises RuntimeError: if it fails to, with what it printed
        """
        end = time.monotonic() + READY_TIMEOUT
        while not (self.folder / 'ready').exists():
            if time.monotonic() > end or self.process.poll() is not None:
                raise RuntimeError(f'a program met no robot; it printed:\n{self.text}')
            time.sleep(POLL_PERIOD)
        self._children = children_of(self.process.pid)

    def go(self) -> None:
        """Start its motion."""
        self.write_line('')

    def write_line(self, line: str) -> None:
        """Write a line to its standard input."""
        data = f'{line}\n'.encode()
        if self._output_kind == 'terminal':
            os.write(self._descriptor, data)
        else:
            assert self.process.stdin is not None
            self.process.stdin.write(data)
            self.process.stdin.flush()

    def close_output(self) -> float:
        """
        Close the other end of what it prints to: a pipe or a terminal.

        :returns: when [s, system clock]
        """
        self._read()
        now = time.time()
        os.close(self._descriptor)
        self._descriptor = -1
        return now

    def block_output(self) -> None:
        """Leave no room in what it prints to: fill the pipe, or stop the terminal by Ctrl+S."""
        self._read()
        if self._output_kind == 'full':
            fill(self._filled)
        else:
            os.write(self._descriptor, b'\x13')

    def send(self, signum: int) -> float:
        """
        Send it a signal.

        :returns: when [s, system clock]
        """
        # Popen.send_signal polls first, and may wait there for another thread.  The process has
        # not been waited for, so that its id cannot be another's.
        now = time.time()
        os.kill(self.process.pid, signum)
        return now

    @property
    def guardian(self) -> int:
        """Return the process id of its guardian."""
        guardian = find_process(self._children, 'guardian_program')
        if guardian is None:
            raise RuntimeError('the program has no guardian')
        return guardian

    @property
    def fault(self) -> float | None:
        """Return when it caused its own fault [s, system clock]; None before that."""
        with contextlib.suppress(OSError, ValueError):
            return float((self.folder / 'fault').read_text())
        return None

    @property
    def text(self) -> str:
        """Return what it has printed."""
        self._read()
        return self._printed + self._log.read_text()

    def wait(self, timeout: float) -> int | None:
        """
        Wait for its end.

        :param timeout: how long [s]
        :returns: the exit code, as a shell gives it; None if it did not end
        """
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self.process.wait(timeout)
            return 128 - code if code < 0 else code
        return None

    def end(self) -> bool:
        """
        End it and its children, and remove its files.

        :returns: whether its children had ended by themselves
        """
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        end = time.monotonic() + 3.0
        while (left := [*filter(is_running, self._children)]) and time.monotonic() < end:
            time.sleep(POLL_PERIOD)
        for child in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        for descriptor in (self._descriptor, self._filled):
            if descriptor >= 0:
                os.close(descriptor)
        if self.process.stdin is not None:
            with contextlib.suppress(OSError):
                self.process.stdin.close()
        for file in self.folder.iterdir():
            file.unlink()
        self.folder.rmdir()
        return not left

    def _read(self) -> None:
        if self._descriptor < 0:
            return
        os.set_blocking(self._descriptor, False)
        with contextlib.suppress(OSError):
            while part := os.read(self._descriptor, 65536):
                self._printed += part.decode(errors='replace')


def _take_terminal() -> None:
    # In the child: make the terminal on its input the controlling one, which sends SIGHUP.
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
