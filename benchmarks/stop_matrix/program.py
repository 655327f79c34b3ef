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
"""A program that drives a robot: started, let go, asked how it ended."""

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

from program import children_of, environment, fill, is_running

#: How long a program may take until it is ready to move [s]; a busy machine has no influence.
MEETING = 40.0
GLANCE = 0.02


class Program:
    """
    A script in a session of its own.

    It says that it is ready by a file, waits on its standard input, then moves.
    """

    def __init__(
            self, text: str, options: list[str], variables: dict[str, str],
            outlet: str = 'file') -> None:
        """
        Start it.

        :param text: the script
        :param options: its arguments
        :param variables: what is added to its environment
        :param outlet: what it prints to: 'file', 'pipe', 'terminal', which is its input, too, or
            'full', a pipe that can be filled
        """
        self.folder = Path(tempfile.mkdtemp(prefix='stop_matrix_'))
        self._log = self.folder / 'log.txt'
        self._outlet = outlet
        self._printed = ''
        script = self.folder / 'script.py'
        script.write_text(text)
        ours, theirs = os.openpty() if outlet == 'terminal' else os.pipe()
        self._output = ours
        with self._log.open('w') as log:
            out = log.fileno() if outlet == 'file' else theirs
            self.process = subprocess.Popen(
                [sys.executable, str(script), *options], cwd=self.folder,
                stdin=theirs if outlet == 'terminal' else subprocess.PIPE, stdout=out,
                stderr=out, start_new_session=True,
                # No other thread of this process starts programs, and none of ours holds a lock
                # that the child would need.
                preexec_fn=_take_terminal if outlet == 'terminal' else None,  # noqa: PLW1509
                env={**environment(), **variables})
        self._inlet = theirs if outlet == 'full' else -1
        if self._inlet < 0:
            os.close(theirs)
        self._children: list[int] = []

    def wait_until_ready(self) -> None:
        """
        Wait until it has met its robot.

        :raises RuntimeError: if it does not, with what it printed
        """
        end = time.monotonic() + MEETING
        while not (self.folder / 'ready').exists():
            if time.monotonic() > end or self.process.poll() is not None:
                raise RuntimeError(f'a program met no robot; it printed:\n{self.text}')
            time.sleep(GLANCE)
        self._children = children_of(self.process.pid)

    def go(self) -> None:
        """Let it move."""
        if self._outlet == 'terminal':
            os.write(self._output, b'\n')
        else:
            assert self.process.stdin is not None
            self.process.stdin.write(b'\n')
            self.process.stdin.flush()

    def hang_up(self) -> float:
        """
        Close what it prints to: the reader of the pipe ends, or the terminal is closed.

        :returns: when [s, system clock]
        """
        self._read()
        now = time.time()
        os.close(self._output)
        self._output = -1
        return now

    def read_no_more(self) -> None:
        """Leave no room in what it prints to: the pipe is full, or Ctrl+S stops the terminal."""
        self._read()
        if self._outlet == 'full':
            fill(self._inlet)
        else:
            os.write(self._output, b'\x13')

    def send(self, signum: int) -> float:
        """
        Send it a signal.

        :param signum: the signal
        :returns: when [s, system clock]
        """
        # Directly: Popen's own way asks the system first, and may wait for other threads there.
        # The process has not been waited for, so that its id cannot be another's.
        now = time.time()
        os.kill(self.process.pid, signum)
        return now

    @property
    def guardian(self) -> int:
        """Return the process id of its guardian."""
        for child in self._children:
            with contextlib.suppress(OSError):
                if b'guardian_process' in Path(f'/proc/{child}/cmdline').read_bytes():
                    return child
        raise RuntimeError('the program has no guardian')

    @property
    def fault(self) -> float | None:
        """Return when it let something happen by itself [s, system clock]; None before that."""
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
        :returns: the exit code, as a shell tells it; None if it did not end
        """
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self.process.wait(timeout)
            return 128 - code if code < 0 else code
        return None

    def end(self) -> bool:
        """
        End it, and see to it that nothing of it is left.

        :returns: whether its guardian had gone by itself
        """
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        end = time.monotonic() + 3.0
        while (left := [*filter(is_running, self._children)]) and time.monotonic() < end:
            time.sleep(GLANCE)
        for child in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        for descriptor in (self._output, self._inlet):
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
        if self._output < 0:
            return
        os.set_blocking(self._output, False)
        with contextlib.suppress(OSError):
            while part := os.read(self._output, 65536):
                self._printed += part.decode(errors='replace')


def _take_terminal() -> None:
    # In the child: the terminal on its input becomes the one that can hang up on it.
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
