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
"""Start programs as a user would, read what they print, and end them with their children."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
import contextlib
import json
import os
from pathlib import Path
import queue
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

from kachaka_simple_control.process.processes import is_running
from waiting import poll

ROOT = Path(__file__).resolve().parent.parent
COMMAND = [sys.executable, '-m', 'kachaka_simple_control']
#: Quick to start, for tests of neither guardian nor prime time; more parameters may follow.
QUICK_COMMAND = [*COMMAND, '--ros-args', '-p', 'guardian:=false', '-p', 'prime_time:=0.2']
#: What reading of a process or a thread that has ended raises.
GONE = (FileNotFoundError, ProcessLookupError)
#: How long a guardian may go on when its program has ended [s].
CHILD_EXIT_TIMEOUT = 3.0
_END = object()


class EndedError(RuntimeError):
    """A process did not write what it should have written."""


class Program:
    """
    A process in a session of its own, and all it printed; leaving the ``with`` block ends it.

    What it prints goes to a file, which cannot be full as a pipe that nobody reads.

    :param log: that file; None for one without a name
    """

    #: How long it may take to end after the block before it is killed [s].
    exit_timeout = 0.0

    def __init__(
            self, command: Sequence[str], log: Path | None = None, **options: Any) -> None:
        self._log = log.open('w+') if log else tempfile.TemporaryFile('w+')  # noqa: SIM115
        self._logged = ''
        #: ids of processes that it has started, as far as they are known
        self.children: list[int] = []
        self.process = subprocess.Popen(command, **{
            'stdin': subprocess.DEVNULL, 'stdout': self._log, 'stderr': self._log,
            'start_new_session': True, 'env': environment(), 'text': True, **options})

    def __enter__(self) -> Any:
        """Return it."""
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        """End it; after an error at once or within a second, and print what it printed."""
        if error is not None:
            print(self)
        self.close(self.exit_timeout if error is None else min(self.exit_timeout, 1.0))

    def __str__(self) -> str:
        """Return its command, and what it has printed."""
        return f'{self.process.args} printed:\n{self.text}'

    @property
    def text(self) -> str:
        """Return what it has printed."""
        return self._read_log()

    @property
    def is_over(self) -> bool:
        """Return whether it will print nothing more."""
        return self.process.poll() is not None

    def send(self, signum: int) -> float:
        """Send it a signal; return when [s, system clock]."""
        now = time.time()  # before: the stop may be quicker than we are
        # Popen.send_signal would poll first, and may wait there for another thread.  A process
        # that has not been waited for keeps its id.
        if self.process.returncode is None:
            os.kill(self.process.pid, signum)
        return now

    def wait_for_text(self, text: str, timeout: float = 20.0) -> None:
        """Return when it has printed a text; fail if it does not."""
        poll(lambda: text in self.text or self.is_over, timeout)
        assert text in self.text, f'{text!r} never came; {self}'

    def end(self, timeout: float = 30.0) -> int:
        """Wait for its end; return its exit code as a shell gives it."""
        code = self.process.wait(timeout)
        return 128 - code if code < 0 else code

    def code_within(self, timeout: float) -> int | None:
        """Wait for its end; return its exit code as a shell gives it, None if it goes on."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.end(timeout)
        return None

    def close(self, timeout: float = 0.0, signum: int = 0) -> bool:
        """
        End it and what it has started; harmless if that is done.

        :param timeout: how long it may take to end without standard input before it is killed [s]
        """
        if self._log.closed:
            return True
        children = {*self.children, *children_of(self.process.pid)}
        if self.process.stdin is not None:
            with contextlib.suppress(OSError):
                self.process.stdin.close()
        for number, patience in ((signum, timeout), (signal.SIGKILL, None)):
            with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
                os.killpg(self.process.pid, number)
                self.process.wait(patience)
        # A guardian sends zeros after its node was killed: not into the next test.
        poll(lambda: not any(map(is_running, children)), CHILD_EXIT_TIMEOUT, 0.02)
        left = [*filter(is_running, children)]
        for child in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        self._logged = self._read_log()
        self._log.close()
        return not left

    def _read_log(self) -> str:
        if self._log.closed:
            return self._logged
        # By position: the program goes on writing at the end of the open file.
        log = self._log.fileno()
        return os.pread(log, os.fstat(log).st_size, 0).decode(errors='replace')


class JsonProcess(Program):
    """
    A process that reads and writes a JSON value a line, and logs to standard error.

    :param on_value: called in a thread with each value; None to keep them for ``read``
    """

    exit_timeout = 8.0

    def __init__(
            self, command: Sequence[str], on_value: Callable[[Any], None] | None = None,
            **options: Any) -> None:
        self._values: queue.Queue[Any] = queue.Queue()
        self._on_value = on_value or self._values.put
        super().__init__(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, **options)
        threading.Thread(target=self._read_output, daemon=True).start()

    def write(self, value: object) -> None:
        """Write it a value, as a line of JSON."""
        try:
            print(json.dumps(value), file=self.process.stdin, flush=True)
        except OSError:
            raise EndedError(f'it has ended; {self}') from None

    def read(self, timeout: float = 30.0) -> Any:
        """
        Wait for its next value.

        :raises EndedError: if there is none within the timeout [s], with what it has printed
        """
        try:
            value = self._values.get(timeout=timeout)
        except queue.Empty:
            raise EndedError(f'it wrote nothing for {timeout:g} s; {self}') from None
        if value is _END:
            raise EndedError(f'it has ended; {self}')
        return value

    def _read_output(self) -> None:
        with self.process.stdout as lines:
            for line in lines:
                self._on_value(json.loads(line))
        self._values.put(_END)


def quick_drive(folder: Path, *options: str, duration: float = 0.5) -> list[str]:
    """Return a command that is quick to start, and drives 0.1 m/s for a while [s]."""
    motion = folder / 'quick.yaml'
    motion.write_text(
        'name: quick\nrate: 20 Hz\n'
        f'steps: [move: {{linear_x: 0.1 m/s, angular_z: 0 rad/s, duration: {duration} s}}]\n')
    return [*COMMAND, str(motion), *options, *QUICK_COMMAND[len(COMMAND):]]


def restore_signals() -> None:
    """Restore signals that the background of a shell ignores, for all that is started here."""
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


def program(command: list[str], scratch: Path, folder: Path | None = None) -> Program:
    """Run a command in a ``with`` block, in a folder if one is given."""
    return Program(command, scratch / 'log.txt', cwd=folder)


def without(modules: Sequence[str], text: str) -> list[str]:
    """Return the command of a Python program that cannot import some modules."""
    return [sys.executable, '-c', f"""
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {modules!r}:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)
sys.meta_path.insert(0, Block())
{text}"""]


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


def script(text: str, folder: Path, *arguments: str) -> Program:
    """Run a script as a user would have written it, in a folder of its own."""
    file = folder / 'script.py'
    file.write_text(text)
    return program([sys.executable, str(file), *arguments], folder, folder)


def final_pose(text: str) -> list[float]:
    """Return x [m], y [m] and heading [degrees] from what the command printed."""
    found = re.search(r'x (\S+) m, y (\S+) m, heading (\S+) degrees', text)
    assert found is not None, text
    return [float(number) for number in found.groups()]


def call(main: Callable[[Sequence[str]], int], arguments: Sequence[str], capsys: Any) -> tuple[
        int, str, str]:
    """Run a command in this process; return its exit code and what it printed."""
    try:
        code = main(arguments)
    except SystemExit as ended:
        code = int(ended.code or 0)
    printed = capsys.readouterr()
    return code, printed.out, printed.err
