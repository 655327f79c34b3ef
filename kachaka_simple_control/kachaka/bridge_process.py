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
"""Run the program ``kachaka_bridge`` as a child process of a script or a ROS node."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
import contextlib
import os
import subprocess
import sys
import tempfile
import threading
import time
from typing import ClassVar, TYPE_CHECKING

from kachaka_simple_control.errors import ControlError, RobotNotFoundError, UsageError
from kachaka_simple_control.files.document import is_path
from kachaka_simple_control.files.robot_profile import KACHAKA, RobotProfile
from kachaka_simple_control.process import processes
from kachaka_simple_control.process.exit_codes import NO_ROBOT
from kachaka_simple_control.text import escaped

if TYPE_CHECKING:
    from kachaka_simple_control.kachaka.simulated_fleet import SimulatedStart

#: The longest time for the process to end after SIGTERM [s].
EXIT_TIMEOUT = 2.0
#: The longest time for the process to start and connect to a robot, or to print an error [s].
START_TIMEOUT = 20.0
#: Texts in the output of the process: the start of the text that the process prints when it is
#: ready, the prefix of the error line, and the prefix of the line with the identifier of its DDS
#: participant.
READY = 'ready: '
ERROR_PREFIX = 'kachaka_bridge: '
PARTICIPANT = 'participant: '


@contextlib.contextmanager
def simulated_bridge(
        namespace: str = KACHAKA.namespace,
        options: Sequence[str] = ()) -> Iterator[BridgeProcess]:
    """
    Run a simulated Kachaka with ROS 2 topics in a child process, during a ``with`` block.

    The block starts before the robot is ready, so its code has to wait for the robot.

    :raises RobotNotFoundError: if another bridge already uses the same ROS names
    :raises ControlError: if the process ends before the block; its ``__cause__`` is an error of
        the block
    """
    with _running(BridgeProcess(['--sim', '--namespace', namespace, *options])) as process:
        yield process


@contextlib.contextmanager
def simulated_fleet(
        robots: str | Mapping[str, SimulatedStart],
        options: Sequence[str] = ()) -> Iterator[BridgeProcess]:
    """
    Run the simulated robots of a fleet in one child process, as ``simulated_bridge`` runs one.

    :param robots: by name where each begins, and its errors; or a fleet's name, or its file
    """
    with contextlib.ExitStack() as stack:
        if not isinstance(robots, str):
            from kachaka_simple_control.kachaka.simulated_fleet import robots_text
            file = stack.enter_context(tempfile.NamedTemporaryFile('w', suffix='.yaml'))
            file.write(robots_text(robots))
            file.flush()
            robots = file.name
        yield stack.enter_context(_running(BridgeProcess(
            ['--sim', '--robots', robots, *options], 'the simulated fleet')))


@contextlib.contextmanager
def real_bridge(address: str, namespace: str = KACHAKA.namespace) -> Iterator[BridgeProcess]:
    """
    Connect a real robot to ROS 2 in a child process, during a ``with`` block.

    The block starts when the robot has responded.  The process ends early if the robot refuses to
    move, or the connection is lost during a motion; a motion of the block then ends, too.

    :raises RobotNotFoundError: if no robot responds, or another bridge uses the same ROS names
    :raises ControlError: if the bridge is not ready within 20 s, or ends before the block; its
        ``__cause__`` is an error of the block
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
    A child process that runs ``kachaka_bridge``.

    It has its own POSIX session, so Ctrl+C does not end it before the parent has stopped the
    robot. Its standard input is a pipe: it ends with the parent, even by SIGKILL.
    """

    def __init__(self, options: Sequence[str], name: str = 'the simulated robot') -> None:
        self._name = name
        self._last_line = 'it printed nothing'
        #: the identifier of the child's DDS participant; None until the child has printed it
        self.participant: bytes | None = None
        self._ready = threading.Event()
        self._failure: ControlError | None = None
        # errors='replace': text that is not UTF-8 must not end the reader thread.
        self._process = subprocess.Popen(
            [*processes.python_command('kachaka_simple_control.kachaka.bridge_command'),
             '--with-parent', *options],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            start_new_session=True, env=processes.child_environment(), text=True, errors='replace')
        self._reader = threading.Thread(target=self._read, name='bridge-output', daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Return the process id of the child process."""
        return self._process.pid

    @property
    def is_over(self) -> bool:
        """Return whether the child process has ended."""
        return self._process.poll() is not None

    @property
    def failure(self) -> ControlError:
        """
        Return the error that says why the child process has ended; always the same object.

        :returns: a ``RobotNotFoundError`` if no robot was found or another bridge uses its names
        """
        if self._failure is None:
            # The last line of the process may not be read yet.
            self._reader.join(EXIT_TIMEOUT)
            code = self._process.returncode
            self._failure = (
                RobotNotFoundError(self._last_line.removeprefix(ERROR_PREFIX))
                if code == NO_ROBOT else
                ControlError(f'{self._name} ended early (exit code {code}): {self._last_line}'))
        return self._failure

    def check(self) -> None:
        """Raise an error, with its last line of output, if the child process has ended."""
        if self.is_over:
            raise self.failure

    def require_participant(self) -> bytes | None:
        """
        Return the DDS participant of the child process; None if it has not printed it yet.

        :raises ControlError: if the child process has ended
        """
        self.check()
        return self.participant

    def wait_until_ready(self) -> None:
        """
        Wait until the child process has printed that the bridge is ready.

        :raises ControlError: if the child process ends, or if it is not ready within 20 s
        """
        end = time.monotonic() + START_TIMEOUT
        while not self._ready.wait(0.02):
            self.check()
            if time.monotonic() > end:
                raise ControlError(f'{self._name} is not ready after {START_TIMEOUT:g} s')

    def end(self) -> None:
        """End the child process, if it runs: SIGTERM, and SIGKILL after 2 s."""
        try:
            self._process.terminate()
            self._process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            pass
        finally:
            # This runs also if a signal interrupts the wait.
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
            if not line.startswith(ERROR_PREFIX):  # ``failure`` has this text
                with contextlib.suppress(OSError):  # stderr is a file on a full disk
                    sys.stderr.write(line)
                    sys.stderr.flush()


def require_floor(floor: str | os.PathLike[str] | None, sim: bool) -> None:
    """
    Check the floor that a program wants for its simulated robots; None is an empty one.

    :raises FloorFileError: if it cannot be read; a line for each problem
    :raises UsageError: if there are no simulated robots
    """
    if floor is None:
        return
    if not sim:
        raise UsageError('floor= is about simulated robots: it needs sim=True')
    from kachaka_simple_control.files.floor_file import find_floor
    find_floor(floor)


def floor_option(floor: str | os.PathLike[str] | None) -> list[str]:
    """Return the option of the bridge for a floor; none for an empty one."""
    if floor is None:
        return []
    path = os.fspath(floor)
    # A path object without a slash is a file, too; as a text it would be a name.
    is_name = isinstance(floor, str) or is_path(path)
    return [f'--floor={path if is_name else f"./{path}"}']


class OwnSimulation:
    """
    A simulated Kachaka that a node starts for itself.

    :param profile: that of the robot that the node drives; it must be a Kachaka
    :param floor: the name or the file of its floor; None for an empty floor
    :raises UsageError: if it is not, or an earlier node of this process has one in this namespace
    """

    #: the namespaces of all simulated robots that nodes of this process run now
    _running: ClassVar[set[str]] = set()

    def __init__(
            self, profile: RobotProfile, namespace: str,
            floor: str | os.PathLike[str] | None = None) -> None:
        if not profile.is_kachaka:
            raise UsageError(f'sim=True starts a simulated kachaka, not a {profile.name}')
        if namespace in self._running:
            raise UsageError(
                f'an earlier node of this program has the simulated robot {namespace}: call its '
                'destroy_node() first, or choose another robot_namespace')
        self._running.add(namespace)
        self._namespace = namespace
        self._bridge = BridgeProcess(
            ['--sim', '--namespace', namespace, *floor_option(floor)])
        #: returns the identifier of the robot's DDS participant, for ``Session.require_robot()``
        self.require_participant = self._bridge.require_participant

    def end(self) -> None:
        """End the simulated robot."""
        self._bridge.end()
        self._running.discard(self._namespace)
