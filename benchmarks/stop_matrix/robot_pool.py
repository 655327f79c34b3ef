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
"""Robots for the programs to drive: kept as long as nothing happens to them."""

from __future__ import annotations

from collections.abc import Sequence
import itertools
from pathlib import Path
import random
import tempfile
import time

from benchmarks.grpc_robot import GrpcRobot
from benchmarks.stop_matrix.observer import Observer
from benchmarks.stop_matrix.robot_process import RobotProcess
from benchmarks.stop_matrix.rows import Row

_NUMBERS = itertools.count(1)
#: What Linux leaves of ROS domains, from 1 on.
DOMAINS = 100
_BASE = random.randrange(DOMAINS)
#: How long a robot may take until it is there [s].
COMING = 20.0


class Member:
    """
    A robot in a ROS domain of its own, and what is heard of it.

    While a program joins or leaves a domain, DDS may hold up all others in it: programs that are
    not on stage are not to be noticed by the one that is.
    """

    def __init__(self, slow: bool, over_grpc: bool = False) -> None:
        """
        Start the robot.

        :param slow: whether it takes 250 ms a call
        :param over_grpc: whether robot and bridge are two processes, as with a real robot
        """
        number = next(_NUMBERS)
        self.domain = (_BASE + number) % DOMAINS + 1
        self.observer = Observer(self.domain)
        self.ears = self.observer.ears(f'stop_{number}')
        self._folder = tempfile.TemporaryDirectory(prefix='stop_matrix_') if slow else None
        #: where a slow robot tells what it plays
        self.played = Path(self._folder.name) / 'played.txt' if self._folder else None
        self._over_grpc = over_grpc
        self.robot = self._start()

    def wait_until_there(self) -> None:
        """
        Wait until its odometry is heard.

        :raises RuntimeError: if it is not in time
        """
        end = time.monotonic() + COMING
        while not self.ears.samples:
            if time.monotonic() > end:
                raise RuntimeError('a simulated robot did not come')
            time.sleep(0.02)

    def replace_robot(self) -> None:
        """Start another robot in place of one that has left."""
        self.robot.end()
        self.robot = self._start()

    def end(self) -> None:
        """End the robot, and listen no more."""
        self.robot.end()
        self.observer.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _start(self) -> RobotProcess | GrpcRobot:
        if self._over_grpc:
            return GrpcRobot(self.ears.namespace, self.domain)
        return RobotProcess(self.ears.namespace, self.domain, self.played)


class Cast:
    """Every robot there is; leaving the ``with`` block ends them."""

    def __init__(self, over_grpc: bool = False) -> None:
        """
        Have none.

        :param over_grpc: whether each is to be reached over gRPC, by a bridge
        """
        self._over_grpc = over_grpc
        self._free: list[Member] = []
        self._all: list[Member] = []

    def __enter__(self) -> Cast:
        """Return it."""
        return self

    def __exit__(self, *error: object) -> None:
        """End them all."""
        self.dismiss(self._all)

    def take(self, rows: Sequence[Row]) -> list[Member]:
        """
        Have a robot for each of some rows, each of which is there.

        :param rows: the rows
        :returns: the robots, in order
        """
        taken = [self._one(row) for row in rows]
        for member in taken:
            member.wait_until_there()
        return taken

    def put_back(self, rows: Sequence[Row], members: Sequence[Member]) -> None:
        """
        Keep those robots for other rows that nothing happened to, and end the others.

        :param rows: the rows that they were taken for
        :param members: the robots
        """
        self.dismiss([member for row, member in zip(rows, members) if row.harms])
        for row, member in zip(rows, members):
            if not row.harms:
                member.ears.forget()
                self._free.append(member)

    def spare(self, count: int) -> None:
        """
        End those that nobody needs.

        :param count: how many to keep
        """
        while len(self._free) > count:
            self.dismiss([self._free.pop()])

    def dismiss(self, members: Sequence[Member]) -> None:
        """
        End some robots.

        :param members: which
        """
        for member in [*members]:
            member.end()
            self._all.remove(member)
            if member in self._free:
                self._free.remove(member)

    def _one(self, row: Row) -> Member:
        for member in self._free:
            if not row.slow:
                self._free.remove(member)
                return member
        member = Member(row.slow, self._over_grpc)
        self._all.append(member)
        return member
