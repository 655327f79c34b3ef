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
"""A simulated robot and its clock, for the many who look at it at once."""

from __future__ import annotations

import asyncio
import contextlib
import math

from kachaka_simple_control.robot.grpc_server.clock import Clock
from kachaka_simple_control.robot.grpc_server.localisation import Localisation
from kachaka_simple_control.robot.simulated import SimulatedKachaka


class Station:
    """
    Where the robot stands; of one event loop, so that nobody has to lock anything.

    Whoever changes the robot says so, and whoever waits for a change is woken: by that, and by
    ``keep()`` whenever the robot changes by itself.
    """

    def __init__(self, robot: SimulatedKachaka, clock: Clock) -> None:
        """
        Take the robot in.

        :param robot: told the time from now on by nobody else
        :param clock: the time
        """
        self.robot = robot
        self.clock = clock
        self.localisation = Localisation()
        self._changed = asyncio.Event()
        self._cursor = 0

    def now(self) -> float:
        """Return the time [s]."""
        return self.clock.now()

    def announce(self) -> None:
        """Wake all who wait, for something changed."""
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    def new_cursor(self) -> int:
        """Return a number that no reading had before, not even of a robot that ran earlier."""
        # On the robot, too, it is a time.
        self._cursor = max(self._cursor + 1, int(self.now() * 1e9))
        return self._cursor

    async def wait(self, until: float = math.inf) -> None:
        """
        Return when something changed, or at a time.

        :param until: the time [s]
        """
        timeout = self.clock.delay(until) if math.isfinite(until) else None
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._changed.wait(), timeout)
        if timeout == 0.0:
            await asyncio.sleep(0.0)

    async def keep(self) -> None:
        """Let the robot live on while nobody asks for it, and say what becomes of it."""
        while True:
            following = self.robot.next_change(self.now())
            await self.wait(following)
            if self.now() >= following:
                self.robot.state(self.now())
                self.announce()
