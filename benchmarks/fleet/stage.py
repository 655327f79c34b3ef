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
"""The processes of a measurement: simulated robots, their observer, and programs that drive."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import time

from benchmarks import ROOT
from benchmarks.fleet.fleet_files import names_of, write_fleet
from benchmarks.fleet.observer import Observer
from benchmarks.stop_matrix.network import Network, NODE
from kachaka_simple_control.ros.dds_transport import TRANSPORTS
from program import children_of, COMMAND, environment, find_process, Program
from ros_domain import claim_domain, release_domain
from ros_support import BRIDGE
from waiting import poll

#: The command ``kachaka_fleet``.
FLEET = [sys.executable, '-c',
         'import sys; from kachaka_simple_control.entry_points import fleet; sys.exit(fleet())']
#: The longest time until a bridge is ready, a program has started, or a fleet moves [s].
START_TIMEOUT = 60.0
#: The longest time until a program ends [s].
EXIT_TIMEOUT = 10.0
#: What a fleet logs when it has started, and any program when it waits for a request.
STARTED, STANDING_BY = 'Each robot is trusted to stand', 'Standing by: '
#: Matches the line with which a bridge says that it is ready, and its time [s, system clock].
READY = re.compile(r'\[([\d.]+)\] \[[\w./]+\]: ready: ')


class Bridge(Program):
    """The process of a bridge with simulated robots, which ends with this process."""

    exit_timeout = 3.0

    def __init__(self, options: Sequence[str], variables: dict[str, str],
                 command: Sequence[str] = ()) -> None:
        super().__init__(
            [*command, *BRIDGE, '--sim', '--with-parent', *options], cwd=ROOT,
            stdin=subprocess.PIPE, env=variables)

    def wait_until_ready(self) -> float:
        """Return when it was ready [s, system clock]; fail if it is not in time."""
        found = poll(lambda: READY.search(self.text) or self.is_over, START_TIMEOUT, 0.02)
        assert isinstance(found, re.Match), f'a bridge is not ready; {self}'
        return float(found[1])


class DriveProgram(Program):
    """
    The process of a program that drives robots, and its guardian.

    :ivar started: when it was started [s, system clock]
    """

    def __init__(
            self, command: Sequence[str], folder: Path, variables: dict[str, str]) -> None:
        self.started = time.time()
        super().__init__(command, cwd=folder, env=variables)

    def wait_for(self, text: str) -> None:
        """Return when it has printed a text; fail if it does not in time."""
        self.wait_for_text(text, START_TIMEOUT)

    def find_children(self) -> list[int]:
        """Return the processes that it has started, and remember them for its end."""
        self.children = children_of(self.process.pid)
        return self.children

    @property
    def guardian(self) -> int:
        """Return the process id of its guardian."""
        guardian = find_process(self.find_children(), 'guardian_program')
        assert guardian is not None, f'it has no guardian; {self}'
        return guardian

    def last_line(self) -> str:
        """Return the last line that it printed."""
        return ([''] + [line for line in self.text.splitlines() if line.strip()])[-1].strip()


class Stage(contextlib.AbstractContextManager['Stage']):
    """
    Simulated robots in a ROS domain of their own, and an observer of what is sent to them.

    :param count: how many robots
    :param own: how many of them, the last ones, have a bridge process of their own
    :param has_observer: whether velocities are recorded; the observer is one more subscriber
    :param network: where all is, as on a network; None for this machine alone
    :ivar folder: of the files of fleets, in which programs are started
    """

    def __init__(
            self, count: int, own: int = 0, odometry_rate: float = 10.0,
            has_observer: bool = True, network: Network | None = None) -> None:
        self._place = network.command(NODE, ()) if network else []
        #: with these, our programs choose the transport themselves
        self._plain = network_environment(network) if network else environment()
        self.names = names_of(count)
        self.shared, self.alone = self.names[:count - own], self.names[count - own:]
        self._odometry = ['--odometry-rate', f'{odometry_rate:g}']
        self._has_observer = has_observer
        self._parts = contextlib.ExitStack()
        #: the bridge of the robots that share one, then those of the others
        self.bridges: list[Bridge] = []

    def __enter__(self) -> Stage:
        """Start the observer; the robots come with ``start_robots``."""
        with contextlib.ExitStack() as parts:
            self.domain = claim_domain()
            parts.callback(release_domain, self.domain)
            self.folder = Path(parts.enter_context(
                tempfile.TemporaryDirectory(prefix='fleet_bench_')))
            self.variables = {**self._plain, 'ROS_DOMAIN_ID': str(self.domain)}
            if self._has_observer:
                self.observer = parts.enter_context(Observer(
                    self.names, self.variables, lambda command: [*self._place, *command]))
            self._parts = parts.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        """End all processes."""
        self._parts.close()

    def start_robots(self) -> float:
        """Start the robots; return when the last of them was ready [s, system clock]."""
        if self.shared:
            robots = write_fleet(self.folder / 'robots.yaml', self.shared, 'straight', 10.0)
            self.bridges.append(self._parts.enter_context(
                Bridge(['--robots', str(robots), *self._odometry], self.variables, self._place)))
        self.bridges += [self._bridge_of(name) for name in self.alone]
        return max(bridge.wait_until_ready() for bridge in self.bridges)

    def replace_last(self) -> None:
        """Start the last robot again, whose bridge was killed."""
        self.bridges.pop().close()
        self.bridges.append(self._bridge_of(self.names[-1]))
        self.bridges[-1].wait_until_ready()

    def fleet(
            self, file: Path, *options: str, names: Sequence[str] = (),
            patience: float | None = None) -> DriveProgram:
        """
        Start ``kachaka_fleet``.

        :param names: of the robots in the file; empty for those of the stage
        :param patience: how long it waits for its robots [s]; None: 10 s, as by default
        """
        waits = [] if patience is None else ['--ros-args', *(
            word for name in names or self.names
            for word in ('-p', f'{name}.robot_timeout:={patience:g}'))]
        return self._started([*FLEET, str(file), '--quiet', *options, *waits])

    def program(self, name: str, motion: str, rate: float, *options: str) -> DriveProgram:
        """Start the program that drives one of the robots."""
        return self._started([
            *COMMAND, motion, '--rate', f'{rate:g}', '--quiet', *options, '--ros-args',
            '-p', f'robot_namespace:={name}', '-p', f'robot_timeout:={START_TIMEOUT:g}'])

    def run(self, program: DriveProgram) -> DriveProgram:
        """Wait until a program moves all robots; fail if it does not in time."""
        moving = poll(lambda: self.observer.wait_until_moving(1.0) or program.is_over,
                      START_TIMEOUT)
        assert moving, f'the robots do not move; {program}'
        assert not program.is_over, f'it has ended; {program}'
        program.find_children()
        return program

    def _started(self, command: Sequence[str]) -> DriveProgram:
        return DriveProgram([*self._place, *command], self.folder, self.variables)

    def _bridge_of(self, name: str) -> Bridge:
        return self._parts.enter_context(
            Bridge(['--namespace', name, *self._odometry], self.variables, self._place))


def network_environment(network: Network) -> dict[str, str]:
    """Return the environment of programs at an end of a network, which choose the transport."""
    found = network.environment()
    del found[TRANSPORTS]
    return found


def end(program: Program) -> int | None:
    """Interrupt a program, and return its exit code; None if it does not end in time."""
    program.send(signal.SIGINT)
    return program.code_within(EXIT_TIMEOUT)
