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
"""Robots for the programs to drive: reused as long as no fault happens to them."""

from __future__ import annotations

import itertools
from pathlib import Path
import signal
import tempfile

from benchmarks.grpc_robot import GrpcRobot
from benchmarks.stop_matrix.observer import Observer
from benchmarks.stop_matrix.robot_process import RobotProcess
from ros_domain import claim_domain
from waiting import poll

_NUMBERS = itertools.count(1)
#: How long a robot may take until it publishes odometry [s].
START_TIMEOUT = 20.0
#: How long it may take to end [s].
EXIT_TIMEOUT = 3.0


class PooledRobot:
    """
    A robot in a ROS domain of its own, and the recorder of its topics.

    While a program joins or leaves a domain, DDS may delay all others in it: programs that are
    being prepared must not delay the one that is measured.

    :param slow: whether each call to the robot takes 250 ms
    :param over_grpc: whether robot and bridge are two processes, as with a real robot
    """

    def __init__(self, slow: bool, over_grpc: bool = False) -> None:
        number = next(_NUMBERS)
        self.domain = claim_domain()
        self.observer = Observer(self.domain)
        self.recorder = self.observer.record(f'stop_{number}')
        self._folder = tempfile.TemporaryDirectory(prefix='stop_matrix_') if slow else None
        #: where a slow robot writes the velocities it executes; None for any other
        self.executed = Path(self._folder.name) / 'executed.txt' if self._folder else None
        self._over_grpc = over_grpc
        self.process = self._start()

    def wait_until_there(self) -> None:
        """
        Wait for its odometry.

        :raises RuntimeError: if it does not come in time
        """
        if not poll(lambda: self.recorder.odometry_count, START_TIMEOUT):
            raise RuntimeError('a simulated robot did not come')

    def replace(self) -> None:
        """Start another robot in place of one that has left."""
        self.process.close(EXIT_TIMEOUT, signal.SIGTERM)
        self.process = self._start()

    def end(self) -> None:
        """End robot and recorder."""
        self.process.close(EXIT_TIMEOUT, signal.SIGTERM)
        self.observer.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _start(self) -> RobotProcess | GrpcRobot:
        if self._over_grpc:
            return GrpcRobot(self.recorder.namespace, self.domain)
        return RobotProcess(self.recorder.namespace, self.domain, self.executed)


class RobotPool:
    """
    All robots; leaving the ``with`` block ends them.

    :param over_grpc: whether each is connected over gRPC, by a bridge
    """

    def __init__(self, over_grpc: bool = False) -> None:
        self._over_grpc = over_grpc
        self._free: list[PooledRobot] = []
        self._taken: list[PooledRobot] = []

    def __enter__(self) -> RobotPool:
        """Return it."""
        return self

    def __exit__(self, *error: object) -> None:
        """End all robots."""
        for robot in [*self._taken, *self._free]:
            robot.end()

    def take(self, slow: bool) -> PooledRobot:
        """Return a free robot, or a new one, which may not be there yet."""
        robot = self._free.pop(0) if self._free and not slow else PooledRobot(
            slow, self._over_grpc)
        self._taken.append(robot)
        return robot

    def put_back(self, robot: PooledRobot, reusable: bool) -> None:
        """Keep a robot for another trial, or end it."""
        self._taken.remove(robot)
        if reusable:
            robot.recorder.clear()
            self._free.append(robot)
        else:
            robot.end()

    def limit_free(self, count: int) -> None:
        """End free robots beyond a number."""
        while len(self._free) > count:
            self._free.pop().end()
