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
"""A bridge to a robot for the length of a ``with`` block, in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import subprocess
import sys
import threading
import time

from kachaka_simple_control.control import processes
from kachaka_simple_control.errors import ControlError, RobotNotFoundError
from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.files.robot_profile import KACHAKA

#: How long the process may take to end when it is asked to [s].
EXIT_TIMEOUT = 2.0
#: How long it may take to start, and to meet a robot or to say why it cannot [s].
START_TIMEOUT = 20.0
#: What the bridge says once it listens, and what its last words begin with.
READY = 'ready: '
ERROR_PREFIX = 'kachaka_bridge: '
#: What comes before the line in which it tells who it is.
PARTICIPANT = 'participant: '
#: Its exit code when no robot answers.
NO_ROBOT = 3


@contextlib.contextmanager
def simulated_bridge(
        namespace: str = KACHAKA.namespace,
        options: Sequence[str] = ()) -> Iterator[BridgeProcess]:
    """
    Run a simulated robot on ROS 2, and end it whatever happens.

    Returns at once: whoever waits for a robot waits for this one, too.

    :param namespace: of its topics and its service
    :param options: more options of ``kachaka_bridge``
    :returns: a context manager for its process
    :raises ControlError: if the robot ended before the block did; in place of the errors that
        the block raised because of it
    """
    with _running(BridgeProcess(
            ['--sim', '--namespace', namespace, *options], 'the simulated robot')) as process:
        yield process


@contextlib.contextmanager
def real_bridge(
        address: str, namespace: str = KACHAKA.namespace) -> Iterator[BridgeProcess]:
    """
    Run a bridge to a real robot, and end it whatever happens.

    Returns when the robot has answered.  When the robot refuses to move, or is lost while it
    moves, the bridge ends, and with it whatever is driven through it.

    :param address: of the robot, HOST or HOST:PORT
    :param namespace: of its topics and its service
    :returns: a context manager for its process
    :raises RobotNotFoundError: if no robot answers
    :raises ControlError: if the bridge ended before the block did; in place of the errors that
        the block raised because of it
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
    The bridge with its robot, as a child of this process.

    In its own session, so that Ctrl+C at the terminal does not reach it before the robot was
    stopped.  Its standard input is a pipe that only this process holds: it ends with us even if
    we are killed.
    """

    def __init__(
            self, options: Sequence[str], name: str = 'the simulated robot') -> None:
        """
        Start it.

        :param options: options of ``kachaka_bridge``
        :param name: what to call it
        """
        self._name = name
        self._last_line = 'it said nothing'
        #: who it is among all that publish and subscribe; None as long as it has not said so
        self.participant: bytes | None = None
        self._ready = threading.Event()
        self._failure: ControlError | None = None
        # Text that is no UTF-8 is shown somehow: it must not end the thread that shows it.
        self._process = subprocess.Popen(
            [*processes.python_command('kachaka_simple_control.kachaka.bridge_command'),
             '--with-parent', *options],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            start_new_session=True, env=processes.child_environment(), text=True, errors='replace')
        self._showing = threading.Thread(target=self._show, name='simulation', daemon=True)
        self._showing.start()

    @property
    def pid(self) -> int:
        """Return the number of the process."""
        return self._process.pid

    @property
    def is_over(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    @property
    def failure(self) -> ControlError:
        """Return what to raise once the process has ended; the same each time."""
        if self._failure is None:
            # What it said last may be on its way.
            self._showing.join(EXIT_TIMEOUT)
            self._failure = self._what_happened(self._process.returncode)
        return self._failure

    def _what_happened(self, code: int) -> ControlError:
        if code == NO_ROBOT:
            return RobotNotFoundError(self._last_line.removeprefix(ERROR_PREFIX))
        return ControlError(f'{self._name} ended early (exit code {code}): {self._last_line}')

    def check(self) -> None:
        """
        Make sure that the robot is still there.

        :raises ControlError: if the process has ended
        """
        if self.is_over:
            raise self.failure

    def require_participant(self) -> bytes | None:
        """
        Return who it is among all that publish and subscribe.

        :returns: its DDS participant; None as long as it has not said so
        :raises ControlError: if the process has ended
        """
        self.check()
        return self.participant

    def wait_until_ready(self) -> None:
        """
        Return when it listens.

        :raises ControlError: if it ends instead, or does neither in time
        """
        end = time.monotonic() + START_TIMEOUT
        while not self._ready.wait(0.02):
            self.check()
            if time.monotonic() > end:
                raise ControlError(f'{self._name} is not ready after {START_TIMEOUT:g} s')

    def end(self) -> None:
        """End the process, at the latest after a patience of 2 s; harmless if it is over."""
        try:
            self._process.terminate()
            self._process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            pass
        finally:
            # Also when a signal cuts the waiting short.
            self._process.kill()
            self._process.wait()
            self._close()

    def _close(self) -> None:
        self._showing.join(EXIT_TIMEOUT)
        for pipe in (self._process.stdin, self._process.stderr):
            if pipe is not None:
                pipe.close()

    def _show(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            if line.startswith(PARTICIPANT):
                self.participant = bytes.fromhex(line.removeprefix(PARTICIPANT))
                continue
            self._last_line = escaped(line.strip(), 1000) or self._last_line
            if READY in line:
                self._ready.set()
            if not line.startswith(ERROR_PREFIX):  # whoever is told of its end hears them
                sys.stderr.write(line)
                sys.stderr.flush()
