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
"""A bridge to a robot in a process of its own, for the length of a ``with`` block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import subprocess
import sys
import threading
import time

from kachaka_simple_control.control import processes
from kachaka_simple_control.errors import ControlError, RobotNotFoundError
from kachaka_simple_control.exit_codes import NO_ROBOT
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.text import escaped

#: How long the process may take to end after SIGTERM [s].
EXIT_TIMEOUT = 2.0
#: How long it may take to start and to connect to a robot, or to print why it cannot [s].
START_TIMEOUT = 20.0
#: Its output: printed once it serves; the prefix of its error line; the prefix of the line with
#: its DDS participant.
READY = 'ready: '
ERROR_PREFIX = 'kachaka_bridge: '
PARTICIPANT = 'participant: '


@contextlib.contextmanager
def simulated_bridge(
        namespace: str = KACHAKA.namespace,
        options: Sequence[str] = ()) -> Iterator[BridgeProcess]:
    """
    Run a simulated robot on ROS 2, and end it whatever happens.

    Returns at once: code that waits for a robot waits for this one, too.

    :param namespace: the namespace of its topics and its service
    :param options: more options of ``kachaka_bridge``
    :returns: a context manager for its process
    :raises ControlError: if the process ended before the block; instead of the errors that the
        block raised because of it
    """
    with _running(BridgeProcess(
            ['--sim', '--namespace', namespace, *options], 'the simulated robot')) as process:
        yield process


@contextlib.contextmanager
def real_bridge(
        address: str, namespace: str = KACHAKA.namespace) -> Iterator[BridgeProcess]:
    """
    Run a bridge to a real robot, and end it whatever happens.

    Returns when the robot has responded.  When the robot refuses to move, or the connection is
    lost during a motion, the bridge ends, and with it the run that uses it.

    :param address: the address of the robot, HOST or HOST:PORT
    :param namespace: the namespace of its topics and its service
    :returns: a context manager for its process
    :raises RobotNotFoundError: if no robot responds
    :raises ControlError: if the process ended before the block; instead of the errors that the
        block raised because of it
    """
    with _running(BridgeProcess(
            ['--address', address, '--give-up', '--namespace', namespace],
            'the bridge to the robot')) as process:
        process.wait_until_ready()
        yield process


@contextlib.contextmanager
def _running(process: BridgeProcess) -> Iterator[BridgeProcess]:
    try:
        yield process
        process.check()
    except Exception as error:
        if process.is_over and error is not process.failure:
            raise process.failure from error
        raise
    finally:
        process.end()


class BridgeProcess:
    """
    The bridge as a child process.

    It is in a session of its own: Ctrl+C in the terminal must not end it before the robot is
    stopped.  Its standard input is a pipe that only this process holds, so it ends with this
    process even if that is killed.

    :param options: options of ``kachaka_bridge``
    :param name: its name in messages
    """

    def __init__(
            self, options: Sequence[str], name: str = 'the simulated robot') -> None:
        self._name = name
        self._last_line = 'it printed nothing'
        #: its DDS participant; None until it has printed it
        self.participant: bytes | None = None
        self._ready = threading.Event()
        self._failure: ControlError | None = None
        # errors='replace': text that is not UTF-8 must not end the thread that reads it.
        self._process = subprocess.Popen(
            [*processes.python_command('kachaka_simple_control.kachaka.bridge_command'),
             '--with-parent', *options],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            start_new_session=True, env=processes.child_environment(), text=True, errors='replace')
        self._reader = threading.Thread(target=self._read, name='bridge-output', daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Return the process id."""
        return self._process.pid

    @property
    def is_over(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    @property
    def failure(self) -> ControlError:
        """Return the error to raise once the process has ended; the same object each time."""
        if self._failure is None:
            # Its last line may not have been read yet.
            self._reader.join(EXIT_TIMEOUT)
            code = self._process.returncode
            self._failure = (
                RobotNotFoundError(self._last_line.removeprefix(ERROR_PREFIX))
                if code == NO_ROBOT else
                ControlError(f'{self._name} ended early (exit code {code}): {self._last_line}'))
        return self._failure

    def check(self) -> None:
        """
        Check that the process is running.

        :raises ControlError: if it has ended
        """
        if self.is_over:
            raise self.failure

    def require_participant(self) -> bytes | None:
        """
        Return its DDS participant; None until it has printed it.

        :raises ControlError: if the process has ended
        """
        self.check()
        return self.participant

    def wait_until_ready(self) -> None:
        """
        Return when it serves.

        :raises ControlError: if it ends, or takes longer than its time limit
        """
        end = time.monotonic() + START_TIMEOUT
        while not self._ready.wait(0.02):
            self.check()
            if time.monotonic() > end:
                raise ControlError(f'{self._name} is not ready after {START_TIMEOUT:g} s')

    def end(self) -> None:
        """End the process: SIGTERM, and SIGKILL after 2 s; harmless if it has ended."""
        try:
            self._process.terminate()
            self._process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            pass
        finally:
            # Also if a signal interrupts the wait.
            self._process.kill()
            self._process.wait()
            self._reader.join(EXIT_TIMEOUT)
            for pipe in (self._process.stdin, self._process.stderr):
                if pipe is not None:
                    pipe.close()

    def _read(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            if line.startswith(PARTICIPANT):
                self.participant = bytes.fromhex(line.removeprefix(PARTICIPANT))
                continue
            self._last_line = escaped(line.strip(), 1000) or self._last_line
            if READY in line:
                self._ready.set()
            if not line.startswith(ERROR_PREFIX):  # the text of ``failure``
                with contextlib.suppress(OSError):  # a full disk
                    sys.stderr.write(line)
                    sys.stderr.flush()
