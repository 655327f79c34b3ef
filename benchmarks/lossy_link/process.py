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
"""Programs at one end of the network: start them, talk with them, leave none behind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from typing import Any

from kachaka_simple_control.ros.dds_transport import CHOICES

from benchmarks.lossy_link.network import Network

ROOT = Path(__file__).resolve().parent.parent.parent
#: How long a program may take to answer [s]: under loss, a service may take many tries.
PATIENCE = 60.0
#: Both ends may share memory, which loses nothing: DDS must take the cable.
SETTINGS = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}


class EndedError(RuntimeError):
    """A program did not say what it should have said."""


class Process:
    """A Python program at one end; what it says is a JSON value a line."""

    def __init__(
            self, network: Network, end: str, arguments: Sequence[str],
            on_said: Callable[[Any], None] | None = None) -> None:
        """
        Start it.

        :param network: the network
        :param end: at which end
        :param arguments: what Python is told, such as ``-m MODULE``
        :param on_said: called, in a thread, with what it says; None to keep that for ``hear``
        """
        self._name = ' '.join(arguments)
        self._log = tempfile.TemporaryFile('w+')  # noqa: SIM115 (closed on leaving)
        self._said: queue.Queue[Any] = queue.Queue()
        self._on_said = on_said or self._said.put
        self.process = subprocess.Popen(
            network.command(end, [sys.executable, *arguments]), cwd=ROOT, env=environment(),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, text=True,
            start_new_session=True)
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()

    def __enter__(self) -> Process:
        """Return it."""
        return self

    def __exit__(self, *error: object) -> None:
        """Let it end by itself if it can, and see to it that it does."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(1.0 if error[0] else 8.0)
        # The process is not yet waited for: its number cannot be another's.
        if self.process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self._listening.join(1.0)
        self._log.close()

    @property
    def text(self) -> str:
        """Return what it has printed beside."""
        # Its own place in the file, for the program goes on writing at the end.
        return os.pread(self._log.fileno(), 1 << 20, 0).decode(errors='replace')

    def tell(self, *words: object) -> None:
        """
        Tell it something.

        :param words: what, as one JSON array
        """
        assert self.process.stdin is not None
        try:
            print(json.dumps(words), file=self.process.stdin, flush=True)
        except OSError:
            raise self._failure('has ended') from None

    def hear(self, timeout: float = PATIENCE) -> Any:
        """
        Wait for what it says next.

        :param timeout: how long [s]
        :returns: what it says
        :raises EndedError: if it says nothing
        """
        with contextlib.suppress(queue.Empty):
            return self._said.get(timeout=timeout)
        raise self._failure(f'said nothing for {timeout:g} s')

    def ask(self, *words: object, timeout: float = PATIENCE) -> Any:
        """
        Tell it something, and wait for the answer.

        :param words: what, as one JSON array
        :param timeout: how long to wait [s]
        :returns: the answer
        """
        self.tell(*words)
        return self.hear(timeout)

    def end(self, timeout: float) -> int | None:
        """
        Wait until it ends by itself.

        :param timeout: how long [s]
        :returns: its exit code; None if it does not end
        """
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(timeout)
        return None

    def _failure(self, what: str) -> EndedError:
        return EndedError(f'{self._name} {what}; it printed:\n{self.text}')

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._on_said(json.loads(line))


def environment() -> dict[str, str]:
    """
    Return the environment for a program that is to use the cable.

    :returns: ours, but for what would keep it from that
    """
    kept = {name: value for name, value in os.environ.items() if name not in CHOICES}
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH')]))
    return {**kept, **SETTINGS, 'PYTHONPATH': path}
