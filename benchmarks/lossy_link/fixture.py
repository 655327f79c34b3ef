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
"""What every measurement needs: the network, a robot at its end, and what that robot says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from dataclasses import dataclass
import time

from benchmarks.lossy_link.network import Network, NODE, ROBOT
from benchmarks.lossy_link.observed import Log, Told
from benchmarks.lossy_link.process import EndedError, Process

#: How long a robot may take to begin [s].
PATIENCE = 20.0
#: How long a robot has been there before a program is started [s].
AT_HOME = 2.0
#: What reached the robot, it has said, and this program has read, after this time [s].
SAID = 0.1
#: How long after a movement a robot stands still for good: its hold, and more [s].
STILL = 0.6


@dataclass
class Rig:
    """
    A network with a robot at one end.

    :param network: the network
    :param log: what the robot says
    :param robot: the robot's program
    """

    network: Network
    log: Log
    robot: Process

    def driver(self, rate: float) -> Process:
        """
        Start a program that drives.

        :param rate: how often it sends a velocity [Hz]
        :returns: its process, at the node's end
        """
        return Process(self.network, NODE, ['-m', 'benchmarks.lossy_link.driver', str(rate)])

    def meet(self, driver: Process) -> None:
        """
        Let a program that drives find the robot.

        :param driver: the program
        :raises EndedError: if it does not
        """
        driver.tell('move', 0.0, 0.2)
        ended_by = driver.ask('wait')['ended by']
        if ended_by is not None:
            raise EndedError(f'the robot was not met: {ended_by}')

    def motion(
            self, since: float, timeout: float,
            fits: Callable[[Told], bool] = lambda _: True) -> Told | None:
        """
        Wait for a motion command that reaches the robot.

        :param since: not one before this time [s]
        :param timeout: how long [s]
        :param fits: which one
        :returns: the first that fits; None if none came
        """
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            found = [told for told in self.log.motions_from(since) if fits(told)]
            if found:
                return found[0]
            time.sleep(0.002)
        return None


@contextlib.contextmanager
def rig() -> Iterator[Rig]:
    """
    Have a robot at its end of a new network, for some time already.

    :returns: both
    :raises NetworkError: if the network cannot be made
    """
    log = Log()
    with (Network() as network,
          Process(network, ROBOT, ['-m', 'benchmarks.lossy_link.robot'], log.add) as robot):
        end = time.monotonic() + PATIENCE
        while not log.is_ready:
            if time.monotonic() > end or robot.process.poll() is not None:
                raise EndedError(f'the robot does not begin; it printed:\n{robot.text}')
            time.sleep(0.02)
        time.sleep(AT_HOME)
        yield Rig(network, log, robot)
