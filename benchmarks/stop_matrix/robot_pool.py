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
"""A pool of robots for the programs; a robot without a fault is reused."""

from __future__ import annotations

import itertools
from pathlib import Path
import signal
import tempfile
from typing import NamedTuple

from benchmarks.grpc_robot import GrpcRobot
from benchmarks.stop_matrix.observer import Observer, RobotRecorder
from benchmarks.stop_matrix.robot_process import RobotProcess
from ros_domain import claim_domain, release_domain
from waiting import poll

_NUMBERS = itertools.count(1)
#: The longest time until a robot publishes odometry [s].
START_TIMEOUT = 20.0
#: The longest time until a robot ends [s].
EXIT_TIMEOUT = 3.0


class SecondRobot(NamedTuple):
    """A second robot for one program, and the recorder of its topics."""

    process: RobotProcess
    recorder: RobotRecorder


class PooledRobot:
    """
    A robot in its own ROS domain, with the recorder of its topics.

    When a program joins or leaves a domain, DDS may delay all other programs in it.  With separate
    domains, programs in preparation do not delay the measured program.

    :param slow: whether each call to the robot takes 250 ms
    :param over_grpc: whether robot and bridge are two processes, as with a real robot
    """

    def __init__(self, slow: bool, over_grpc: bool = False) -> None:
        number = next(_NUMBERS)
        self.domain = claim_domain()
        self.observer = Observer(self.domain)
        self.recorder = self.observer.record(f'stop_{number}')
        self._folder = tempfile.TemporaryDirectory(prefix='stop_matrix_') if slow else None
        #: the file of the velocities that a slow robot executes; None for other robots
        self.executed = Path(self._folder.name) / 'executed.txt' if self._folder else None
        self._over_grpc = over_grpc
        self.process = self._start()
        self._second: SecondRobot | None = None

    def wait_until_there(self) -> None:
        """
        Wait for the odometry of the robot.

        :raises RuntimeError: if no odometry arrives within START_TIMEOUT
        """
        if not poll(lambda: self.recorder.odometry_count, START_TIMEOUT):
            raise RuntimeError('a simulated robot did not come')

    def second(self) -> SecondRobot:
        """Return another robot in the same domain, for a program that drives two."""
        if self._second is None:
            recorder = self.observer.record(f'{self.recorder.namespace}_second')
            self._second = SecondRobot(RobotProcess(recorder.namespace, self.domain), recorder)
        return self._second

    def clear(self) -> None:
        """Discard all recorded data, before another program starts."""
        self.recorder.clear()
        if self._second is not None:
            self._second.recorder.clear()

    def replace(self) -> None:
        """Start a new robot in place of the robot that has left."""
        self.process.close(EXIT_TIMEOUT, signal.SIGTERM)
        self.process = self._start()

    def end(self) -> None:
        """End the robot and the recorder."""
        self.process.close(EXIT_TIMEOUT, signal.SIGTERM)
        if self._second is not None:
            self._second.process.close(EXIT_TIMEOUT, signal.SIGTERM)
        self.observer.close()
        if self._folder is not None:
            self._folder.cleanup()
        release_domain(self.domain)

    def _start(self) -> RobotProcess | GrpcRobot:
        if self._over_grpc:
            return GrpcRobot(self.recorder.namespace, self.domain)
        return RobotProcess(self.recorder.namespace, self.domain, self.executed)


class RobotPool:
    """
    A context manager for all robots, which ends them at its exit.

    :param over_grpc: whether a bridge connects each robot over gRPC
    """

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

    def take(self, slow: bool) -> PooledRobot:
        """Return a free robot, or start a new robot, which may not be ready yet."""
        robot = self._free.pop(0) if self._free and not slow else PooledRobot(
            slow, self._over_grpc)
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
