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
"""Start and control the process of a program that drives a robot."""

from __future__ import annotations

import contextlib
import fcntl
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import termios
import time

from benchmarks.stop_matrix.network import Network, NODE
from program import children_of, environment, fill, find_process, Program
from waiting import poll

#: The longest time until a program is ready to move, also on a loaded machine [s].
READY_TIMEOUT = 40.0


class ScriptProgram(Program):
    """
    The process of a script, in its own session.

    The script creates a file when it is ready, waits for a line on standard input, and then moves.
    """

    def __init__(
            self, text: str, options: list[str], variables: dict[str, str],
            output: str = 'file', network: Network | None = None) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix='stop_matrix_'))
        self._printed = ''
        script = self.folder / 'script.py'
        script.write_text(text)
        has_terminal = output == 'terminal'
        ours, theirs = os.openpty() if has_terminal else os.pipe()
        self._descriptor = ours
        command = [sys.executable, str(script), *options]
        super().__init__(
            network.command(NODE, command) if network else command, cwd=self.folder,
            stdin=theirs if has_terminal else subprocess.PIPE,
            # Safe: no other thread starts programs or holds a lock that the child needs.
            preexec_fn=_take_terminal if has_terminal else None,
            env=(network.environment if network else environment)(**variables),
            **({} if output == 'file' else {'stdout': theirs, 'stderr': theirs}))
        self._has_terminal = has_terminal
        self._filled = theirs if output == 'full' else -1
        if self._filled < 0:
            os.close(theirs)

    def wait_until_ready(self) -> None:
        """
        Wait until the program is connected to its robot.

        :raises RuntimeError: if the program does not connect; the error contains its output
        """
        ready = self.folder / 'ready'
        poll(lambda: ready.exists() or self.is_over, READY_TIMEOUT)
        if not ready.exists():
            raise RuntimeError(f'a program met no robot; {self}')
        self.children = children_of(self.process.pid)

    def go(self) -> None:
        """Start the motion of the program."""
        self.write_line('')

    def write_line(self, line: str) -> None:
        """Write a line to the program's standard input."""
        if self._has_terminal:
            os.write(self._descriptor, f'{line}\n'.encode())
        else:
            print(line, file=self.process.stdin, flush=True)

    def close_output(self) -> float:
        """Close the other end of the program's output pipe or terminal."""
        self._read()
        now = time.time()
        os.close(self._descriptor)
        self._descriptor = -1
        return now

    def block_output(self) -> None:
        """Block the program's output: fill the pipe, or stop the terminal with Ctrl+S."""
        self._read()
        if self._has_terminal:
            os.write(self._descriptor, b'\x13')
        else:
            fill(self._filled)

    @property
    def guardian(self) -> int:
        """Return the process id of the program's guardian."""
        guardian = find_process(self.children, 'guardian_program')
        if guardian is None:
            raise RuntimeError('the program has no guardian')
        return guardian

    @property
    def fault(self) -> float | None:
        """Return the time of the fault that the program caused [s, system clock], or None."""
        with contextlib.suppress(OSError, ValueError):
            return float((self.folder / 'fault').read_text())
        return None

    @property
    def text(self) -> str:
        """Return the output of the program until now."""
        self._read()
        return self._printed + super().text

    def close(self, timeout: float = 0.0, signum: int = 0) -> bool:
        """End the program and its children, and remove its files; see ``Program``."""
        have_ended = super().close(timeout, signum)
        self._close_descriptors()
        shutil.rmtree(self.folder, ignore_errors=True)
        return have_ended

    def _close_descriptors(self) -> None:
        for descriptor in (self._descriptor, self._filled):
            if descriptor >= 0:
                os.close(descriptor)
        self._descriptor = self._filled = -1

    def _read(self) -> None:
        if self._descriptor < 0:
            return
        os.set_blocking(self._descriptor, False)
        with contextlib.suppress(OSError):
            while part := os.read(self._descriptor, 65536):
                self._printed += part.decode(errors='replace')


def _take_terminal() -> None:
    # In the child: make the terminal on its input the controlling terminal, which sends SIGHUP.
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
