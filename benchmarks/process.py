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
"""Start contenders, talk with them, and leave none of them behind."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
#: How long a contender may take to find the robot [s].
MEETING = 30.0


class Contender:
    """A contender's process; leaving the ``with`` block ends it."""

    def __init__(self, name: str, mode: str, rate: float, namespace: str) -> None:
        """
        Start it.

        :param name: which loop
        :param mode: what it does
        :param rate: how often it sends a velocity [Hz]
        :param namespace: where the robot is
        """
        self.name = name
        self._log = tempfile.TemporaryFile('w+')  # noqa: SIM115 (closed on leaving)
        self.started = time.time()
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'benchmarks.loop_process', name, mode, str(rate), namespace],
            cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log,
            text=True, start_new_session=True)
        self._said: queue.Queue[Any] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()

    def __enter__(self) -> Contender:
        """Return it."""
        return self

    def __exit__(self, *error: object) -> None:
        """Let it end by itself if it can, and see to it that it does."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(0.0 if self.process.poll() is None and error[0] else 8.0)
        # The process is not yet waited for, or the group is empty: its id cannot be another's.
        if self.process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self._log.close()

    def ask(self, durations: list[float]) -> dict[str, Any]:
        """
        Let it move.

        :param durations: how long each movement is [s]
        :returns: what it cost
        """
        assert self.process.stdin is not None
        print(json.dumps(durations), file=self.process.stdin, flush=True)
        answer: dict[str, Any] = self.hear(20.0 + 3.0 * sum(durations))
        return answer

    def hear(self, timeout: float = MEETING) -> Any:
        """
        Wait for what it says next.

        :param timeout: how long [s]
        :returns: what it says
        :raises RuntimeError: if it says nothing, with what it has printed
        """
        with contextlib.suppress(queue.Empty):
            said = self._said.get(timeout=timeout)
            if said is not None:
                return said
        raise RuntimeError(f'{self.name} does not answer; it printed:\n{self._printed()}')

    def wait(self, timeout: float) -> None:
        """
        Wait until it ends by itself, and show what it printed if it fails.

        :param timeout: how long [s]
        """
        if self.process.wait(timeout) != 0:
            print(f'\n{self.name} ended with {self.process.returncode}:\n{self._printed()}')

    def send(self, signum: int) -> float:
        """
        Send it a signal.

        :param signum: the signal
        :returns: when it was sent [s, system clock]
        """
        now = time.time()
        self.process.send_signal(signum)
        return now

    def _printed(self) -> str:
        self._log.seek(0)
        return self._log.read()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._said.put(json.loads(line))
        self._said.put(None)
