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
"""A pool of robots for the programs, and the processes of each robot."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import itertools
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile

from benchmarks import ROOT
from benchmarks.stop_matrix.lasers import Lasers
from benchmarks.stop_matrix.network import Network, NODE, ROBOT
from benchmarks.stop_matrix.observer import Observer, RobotRecorder
from grpc_client_support import SimulatedRobot
from program import environment, Program
from ros_domain import claim_domain, release_domain
from ros_support import BRIDGE, BridgeProcess
from waiting import poll

#: The longest time until a robot publishes odometry [s].
START_TIMEOUT = 20.0
#: The longest time until a robot ends [s].
EXIT_TIMEOUT = 3.0
#: The duration of a call to the robot over a slow link [s].
CALL_DURATION = 0.25
#: Matches the log line of the bridge for released manual control, and its time [s, system clock].
RELEASED = re.compile(r'\[([\d.]+)\] \[[\w./]+\]: manual control disabled')
#: The numbers of the robots.
_NUMBERS = itertools.count(1)


class RobotPool:
    """A context manager for all robots, which ends them at its exit."""

    def __init__(self, over_grpc: bool = False) -> None:
        self._over_grpc = over_grpc
        self._free: list[PooledRobot] = []
        self._taken: list[PooledRobot] = []

    def __enter__(self) -> RobotPool:
        """Return the pool."""
        return self

    def __exit__(self, *error: object) -> None:
        """End all robots."""
        for robot in [*self._taken, *self._free]:
            robot.end()

    def take(self, slow: bool, over_link: bool) -> PooledRobot:
        """Return a free robot, or start a new robot, which may not be ready yet."""
        robot = self._free.pop(0) if self._free and not (slow or over_link) else PooledRobot(
            slow, self._over_grpc, over_link)
        self._taken.append(robot)
        return robot

    def put_back(self, robot: PooledRobot, reusable: bool) -> None:
        """Keep a robot for another trial if it is reusable, else end it."""
        self._taken.remove(robot)
        if reusable:
            robot.clear()
            self._free.append(robot)
        else:
            robot.end()

    def limit_free(self, count: int) -> None:
        """End free robots until at most ``count`` remain."""
        while len(self._free) > count:
            self._free.pop().end()


class PooledRobot:
    """
    A robot in its own ROS domain, with the recorder of its topics.

    When a program joins or leaves a domain, DDS may delay all other programs in it. With separate
    domains, programs in preparation do not delay the measured program.
    """

    def __init__(
            self, slow: bool, over_grpc: bool = False, over_link: bool = False) -> None:
        number = next(_NUMBERS)
        self.domain = claim_domain()
        self._resources = contextlib.ExitStack()
        #: the network between program and robot; None if both are on this machine
        self.network = self._resources.enter_context(Network()) if over_link else None
        with self.network.entered(NODE) if self.network else contextlib.nullcontext():
            self.observer = Observer(self.domain)
        self.recorder = self.observer.record(f'stop_{number}')
        #: the file of the velocities that the robot executes; None if it writes none
        self.executed = Path(self._resources.enter_context(
            tempfile.TemporaryDirectory(prefix='stop_matrix_'))) / 'executed.txt' if (
                slow or over_link) else None
        self._over_grpc = over_grpc
        self.process = self._start()
        #: of more robots in the same domain, for programs that drive several
        self._others: list[RobotRecorder] = []
        self._other_processes: list[OtherRobots] = []
        #: the process of the lasers; None before a row needs one
        self._lasers: Lasers | None = None

    def wait_until_there(self) -> None:
        """
        Wait for the odometry of the robot.

        :raises RuntimeError: if no odometry arrives within START_TIMEOUT
        """
        # Over a link the program alone meets the robot.
        if self.network is None and not poll(lambda: self.recorder.odometry_count, START_TIMEOUT):
            raise RuntimeError('a simulated robot did not come')

    def others(self, count: int) -> list[RobotRecorder]:
        """Return the recorders of more robots in the same domain, which share a bridge."""
        known = len(self._others)
        names = [f'{self.recorder.namespace}_{number}' for number in range(known, count)]
        if names:
            folder = self._resources.enter_context(
                tempfile.TemporaryDirectory(prefix='stop_matrix_'))
            self._others += map(self.observer.record, names)
            self._other_processes.append(OtherRobots(names, self.domain, Path(folder)))
        return self._others[:count]

    def lasers(self, count: int) -> Lasers | None:
        """Return the process of the lasers of the first robots in the domain; None for none."""
        names = [recorder.namespace for recorder in (
            self.recorder, *self.others(count - 1))] if count else []
        if self._lasers is not None and (self._lasers.is_over or self._lasers.names != names):
            self._lasers.close(EXIT_TIMEOUT)
            self._lasers = None
        if names and self._lasers is None:
            self._lasers = Lasers(names, self.domain)
        return self._lasers

    def clear(self) -> None:
        """Discard all recorded data, before another program starts."""
        self.recorder.clear()
        for recorder in self._others:
            recorder.clear()
        if self._lasers is not None and not self._lasers.is_over:
            self._lasers.clear()

    def replace(self) -> None:
        """Start a new robot in place of the robot that has left."""
        self.process.close(EXIT_TIMEOUT, signal.SIGTERM)
        self.process = self._start()

    def end(self) -> None:
        """End the robot and the recorder."""
        self.process.close(EXIT_TIMEOUT, signal.SIGTERM)
        for process in self._other_processes:
            process.close(EXIT_TIMEOUT, signal.SIGTERM)
        self.lasers(0)
        self.observer.close()
        self._resources.close()
        release_domain(self.domain)

    def _start(self) -> RobotProcess | GrpcRobot:
        if self._over_grpc:
            return GrpcRobot(self.recorder.namespace, self.domain)
        return RobotProcess(
            self.recorder.namespace, self.domain, self.executed, self.network)


class OtherRobots(Program):
    """The process of a bridge with several simulated robots, which ends with this process."""

    def __init__(self, names: Sequence[str], domain: int, folder: Path) -> None:
        robots = folder / 'robots.yaml'
        robots.write_text('\n'.join([
            'robots:', *(f'  {name}: {{motion: straight}}' for name in names), '']))
        super().__init__(
            [*BRIDGE, '--sim', '--with-parent', '--robots', str(robots)], cwd=ROOT,
            stdin=subprocess.PIPE, env=environment(ROS_DOMAIN_ID=str(domain)))


class RobotProcess(Program):
    """
    The process of this package's bridge with a simulated robot, or of the slow bridge.

    :param log: the file of the velocities that the slow bridge executes; None for this package's
        bridge
    """

    def __init__(
            self, namespace: str, domain: int, log: Path | None = None,
            network: Network | None = None) -> None:
        command = [*BRIDGE, '--sim', '--with-parent', '--namespace', namespace]
        if log:
            duration = 0.0 if network else CALL_DURATION
            command = [sys.executable, '-m', 'benchmarks.stop_matrix.slow_bridge', namespace,
                       str(log), str(duration)]
        # The bridge ends with this process, which holds the other end of its standard input.
        super().__init__(
            network.command(ROBOT, command) if network else command, cwd=ROOT,
            stdin=subprocess.PIPE,
            env=(network.environment if network else environment)(ROS_DOMAIN_ID=str(domain)))

    def released_since(self, since: float) -> bool:
        """Return whether manual control was disabled after a time [s, system clock]."""
        return any(float(at) > since for at in RELEASED.findall(self.text))


class GrpcRobot:
    """
    The processes ``kachaka_sim`` and ``kachaka_bridge --address``; ``close`` ends both.

    :raises AssertionError: if the robot does not start
    """

    def __init__(self, namespace: str, domain: int) -> None:
        self._robot = SimulatedRobot()
        #: the address of the robot, ``HOST:PORT``
        self.address = self._robot.address
        # The bridge ends with this process, which holds the other end of its standard input.
        self._bridge = BridgeProcess(
            '--address', self.address, '--namespace', namespace, '--with-parent',
            stdin=subprocess.PIPE, env=environment(ROS_DOMAIN_ID=str(domain)))

    def send(self, signum: int) -> float:
        """Send the bridge a signal; return the time of the signal [s, system clock]."""
        return self._bridge.send(signum)

    def close(self, timeout: float = 0.0, signum: int = 0) -> None:
        """End both processes, the bridge first; do nothing if they have ended."""
        for process in (self._bridge, self._robot):
            process.close(timeout, signum)
