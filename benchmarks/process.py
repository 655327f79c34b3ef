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
"""Processes that write a JSON value a line, and that of one loop; none is left behind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

from benchmarks import ROOT

_END = object()
#: How long a loop may take to find the robot [s].
READY_TIMEOUT = 30.0
#: How long a process may take to end: after an error in the ``with`` block, and otherwise [s].
ERROR_EXIT_TIMEOUT, EXIT_TIMEOUT = 1.0, 8.0


class EndedError(RuntimeError):
    """A process did not write what it should have written."""


class JsonProcess:
    """
    A process that writes a JSON value a line; leaving the ``with`` block ends it.

    :param name: for messages
    :param command: program and arguments
    :param environment: its environment; None for ours
    :param on_value: called in a thread with each value; None to keep them for ``read``
    """

    def __init__(
            self, name: str, command: Sequence[str],
            environment: Mapping[str, str] | None = None,
            on_value: Callable[[Any], None] | None = None) -> None:
        self.name = name
        self._log = tempfile.TemporaryFile('w+')  # noqa: SIM115 (closed on leaving)
        self._values: queue.Queue[Any] = queue.Queue()
        self._on_value = on_value or self._values.put
        self.process = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=self._log, text=True, start_new_session=True)
        self._reader = threading.Thread(target=self._read_output, daemon=True)
        self._reader.start()

    def __exit__(self, *error: object) -> None:
        """Close its standard input, which lets it end by itself, and kill it if it does not."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(ERROR_EXIT_TIMEOUT if error[0] else EXIT_TIMEOUT)
        # The process is not yet waited for: its id cannot be another's.
        if self.process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self._reader.join(1.0)
        self._log.close()

    @property
    def text(self) -> str:
        """Return what it has printed to standard error."""
        # By position: the program goes on writing at the end of the open file.
        return os.pread(self._log.fileno(), 1 << 20, 0).decode(errors='replace')

    def write(self, value: object) -> None:
        """Write it a value, as a line of JSON."""
        assert self.process.stdin is not None
        try:
            print(json.dumps(value), file=self.process.stdin, flush=True)
        except OSError:
            raise self._failure('has ended') from None

    def read(self, timeout: float = READY_TIMEOUT) -> Any:
        """
        Wait for its next value.

        :raises EndedError: if there is none within the timeout [s], with what it has printed
        """
        try:
            value = self._values.get(timeout=timeout)
        except queue.Empty:
            raise self._failure(f'wrote nothing for {timeout:g} s') from None
        if value is _END:
            raise self._failure('has ended')
        return value

    def _failure(self, what: str) -> EndedError:
        return EndedError(f'{self.name} {what}; it printed:\n{self.text}')

    def _read_output(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._on_value(json.loads(line))
        self._values.put(_END)


class LoopProcess(JsonProcess):
    """
    The process of one loop.

    :param name: of the loop
    :param mode: what it does, see ``benchmarks.loop_process``
    :param rate: how often it sends a velocity [Hz]
    :param namespace: of the robot
    """

    def __init__(self, name: str, mode: str, rate: float, namespace: str) -> None:
        self.started = time.time()
        super().__init__(name, [
            sys.executable, '-m', 'benchmarks.loop_process', name, mode, str(rate), namespace])

    def __enter__(self) -> LoopProcess:
        """Return it."""
        return self

    def move(self, durations: list[float]) -> dict[str, Any]:
        """Let it make movements of these durations [s]; return what they cost."""
        self.write(durations)
        costs: dict[str, Any] = self.read(20.0 + 3.0 * sum(durations))
        return costs

    def wait(self, timeout: float) -> None:
        """Wait until it ends by itself, and print its output if it fails."""
        if self.process.wait(timeout) != 0:
            print(f'\n{self.name} ended with {self.process.returncode}:\n{self.text}')

    def send(self, signum: int) -> float:
        """Send it a signal; return when [s, system clock]."""
        now = time.time()
        self.process.send_signal(signum)
        return now
