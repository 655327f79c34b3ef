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
"""The setup of every measurement: the network, a robot at one end, and the robot's log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from dataclasses import dataclass
import time

from benchmarks.lossy_link.network import Network, NODE, ROBOT
from benchmarks.lossy_link.observed import ReceivedVelocity, RobotLog
from benchmarks.lossy_link.process import NetworkProcess
from program import EndedError
from waiting import poll

#: The longest start of a robot [s].
START_TIMEOUT = 20.0
#: The time between the start of a robot and the start of a program [s].
SETTLING_TIME = 2.0
#: The delay of the robot's log [s].
LOG_LATENCY = 0.1
#: The time after a movement until the robot is at rest: its command timeout and a margin [s].
REST_TIME = 0.6


@dataclass
class Fixture:
    """
    A network with a robot at one end.

    :param network: the network
    :param log: the reports of the robot
    """

    network: Network
    log: RobotLog

    def start_driver(self, rate: float) -> NetworkProcess:
        """Start the driving program at the node's end, with a rate of velocities [Hz]."""
        return NetworkProcess(
            self.network, NODE, ['-m', 'benchmarks.lossy_link.driver', str(rate)])

    def connect(self, driver: NetworkProcess) -> None:
        """
        Wait until a driving program has found the robot.

        :raises EndedError: if the program does not find the robot
        """
        driver.write(['move', 0.0, 0.2])
        ended_by = driver.ask('wait')['ended by']
        if ended_by is not None:
            raise EndedError(f'the robot was not met: {ended_by}')

    def wait_for_motion(
            self, since: float, timeout: float,
            condition: Callable[[ReceivedVelocity], bool] = lambda _: True,
            ) -> ReceivedVelocity | None:
        """
        Wait until a motion command reaches the robot.

        :param since: the earliest time of the command [s]
        :param timeout: the longest wait [s]
        :param condition: returns whether a command matches
        :returns: the first matching command; None after the timeout
        """
        return poll(
            lambda: next(filter(condition, self.log.motions_since(since)), None), timeout)


@contextlib.contextmanager
def fixture() -> Iterator[Fixture]:
    """
    Make a network with a robot, and wait until the robot is ready.

    :raises NetworkError: if the network cannot be made
    :raises EndedError: if the robot does not start
    """
    log = RobotLog()
    with (Network() as network,
          NetworkProcess(network, ROBOT, ['-m', 'benchmarks.lossy_link.robot'], log.add) as robot):
        poll(lambda: log.is_ready or robot.is_over, START_TIMEOUT)
        if not log.is_ready:
            raise EndedError(f'the robot does not begin; {robot}')
        time.sleep(SETTLING_TIME)
        yield Fixture(network, log)
