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
"""Start programs as a user would, and check how they end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import contextlib
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from kachaka_simple_control.control.processes import is_running

ROOT = Path(__file__).resolve().parent.parent
COMMAND = [sys.executable, '-m', 'kachaka_simple_control']
#: What reading of a process or a thread that has ended raises.
GONE = (FileNotFoundError, ProcessLookupError)


class Program:
    """A process, and all it printed."""

    def __init__(self, command: list[str], log: Path, folder: Path | None) -> None:
        """Start it in a session of its own, and in a folder if one is given."""
        self._log = log
        with log.open('w') as out:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT,
                cwd=folder, start_new_session=True, env=environment())

    @property
    def text(self) -> str:
        """Return what it has printed."""
        return self._log.read_text()

    def send(self, signum: int) -> float:
        """Send it a signal; return when [s, system clock]."""
        now = time.time()  # before: the stop may be quicker than we are
        self.process.send_signal(signum)
        return now

    def wait_for_text(self, text: str, timeout: float = 20.0) -> None:
        """Return when it has printed a text."""
        end = time.monotonic() + timeout
        while text not in self.text:
            assert time.monotonic() < end, f'{text!r} never came; it printed:\n{self.text}'
            assert self.process.poll() is None, f'it ended; it printed:\n{self.text}'
            time.sleep(0.01)

    def end(self, timeout: float = 30.0) -> int:
        """Wait for its end; return its exit code as a shell gives it."""
        code = self.process.wait(timeout)
        return 128 - code if code < 0 else code


def restore_signals() -> None:
    """
    Restore signals that this process, and so all programs that it starts, would ignore.

    The background of a shell ignores Ctrl+C, and so does all that is started there.
    """
    for signum in (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP):
        if signal.getsignal(signum) == signal.SIG_IGN:
            signal.signal(signum, signal.SIG_DFL)


def fill(pipe: int) -> None:
    """Fill a pipe; other writers go on waiting for room, or not."""
    # Opened again: O_NONBLOCK belongs to all that share the open file.
    filler = os.open(f'/proc/self/fd/{pipe}', os.O_WRONLY | os.O_NONBLOCK)
    try:
        for size in (4096, 1):
            with contextlib.suppress(BlockingIOError):
                while True:
                    os.write(filler, b'\n' * size)
    finally:
        os.close(filler)


def environment(**more: str) -> dict[str, str]:
    """Return an environment in which the package under test is found first, with variables."""
    paths = [str(ROOT), os.environ.get('PYTHONPATH', '')]
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, paths)), **more}


@contextlib.contextmanager
def program(
        command: list[str], scratch: Path, folder: Path | None = None) -> Iterator[Program]:
    """Run a command, in a folder if one is given; kill it and its children in the end."""
    started = Program(command, scratch / 'log.txt', folder)
    try:
        yield started
    except BaseException:
        print(f'{command} printed:\n{started.text}')
        raise
    finally:
        children = children_of(started.process.pid)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(started.process.pid, signal.SIGKILL)
        started.process.wait()
        # A guardian sends zeros after its node was killed: not into the next test.
        end = time.monotonic() + 3.0
        while any(map(is_running, children)) and time.monotonic() < end:
            time.sleep(0.02)


def children_of(pid: int) -> list[int]:
    """Return the ids of the child processes that a process has not reaped."""
    children: list[int] = []
    with contextlib.suppress(*GONE):
        for file in Path(f'/proc/{pid}/task').glob('*/children'):
            with contextlib.suppress(*GONE):  # a thread may have ended
                children += map(int, file.read_text().split())
    return children


def find_process(pids: Iterable[int], module: str) -> int | None:
    """Return the first of some processes that runs a module; None if none does."""
    for pid in pids:
        with contextlib.suppress(OSError):
            if module.encode() in Path(f'/proc/{pid}/cmdline').read_bytes():
                return pid
    return None


@contextlib.contextmanager
def script(text: str, folder: Path) -> Iterator[Program]:
    """Run a script as a user would have written it, in a folder of its own."""
    file = folder / 'script.py'
    file.write_text(text)
    with program([sys.executable, str(file)], folder, folder) as started:
        yield started
