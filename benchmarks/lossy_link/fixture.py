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
"""What every measurement needs: the network, a robot at its end, and the log of that robot."""

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

#: How long a robot may take to start [s].
START_TIMEOUT = 20.0
#: How long a robot has been there before a program is started [s].
SETTLING_TIME = 2.0
#: How long until what reached the robot is in its log [s].
LOG_LATENCY = 0.1
#: How long after a movement a robot is at rest: its command timeout, and more [s].
REST_TIME = 0.6


@dataclass
class Fixture:
    """
    A network with a robot at one end.

    :param network: the network
    :param log: what the robot reports
    """

    network: Network
    log: RobotLog

    def start_driver(self, rate: float) -> NetworkProcess:
        """Start the driver at the node's end; it sends a velocity at a rate [Hz]."""
        return NetworkProcess(
            self.network, NODE, ['-m', 'benchmarks.lossy_link.driver', str(rate)])

    def connect(self, driver: NetworkProcess) -> None:
        """
        Let a driver find the robot.

        :raises EndedError: if it does not
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
        Wait for a motion command to reach the robot.

        :param since: not one before this time [s]
        :param timeout: how long [s]
        :param condition: returns whether a command is the one
        :returns: the first that meets the condition; None if none came in time
        """
        return poll(
            lambda: next(filter(condition, self.log.motions_since(since)), None), timeout)


@contextlib.contextmanager
def fixture() -> Iterator[Fixture]:
    """
    Make a network with a robot, and wait until the robot has been there for a while.

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
