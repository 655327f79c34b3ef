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
"""What the gRPC services share: the robot, its clock, and values to wait for."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import contextlib
import math
import time
from typing import Generic, TypeVar

from kachaka_simple_control.kachaka.simulator.grpc_messages import MapToOdom
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka


class Clock:
    """
    The clocks of this machine.

    Tests put another one in its place, which they move, and tell the server when they did.
    """

    def now(self) -> float:
        """Return the steady time [s], which the robot lives in."""
        return time.monotonic()

    def stamp(self) -> int:
        """Return the time of day, for the headers of messages [ns since 1970]."""
        return time.time_ns()

    def delay(self, until: float) -> float | None:
        """
        Return how long to wait for a time.

        :param until: the steady time [s]
        :returns: how long [s]; None for a clock that says by itself when it moved on
        """
        return max(until - self.now(), 0.0)


T = TypeVar('T')


class LongPollValue(Generic[T]):
    """
    A value and its cursor, as the maker describes them (docs/GRPC.md in pf-robotics/kachaka-api).

    A client sends the cursor of the value it has.  If it is that of the newest value, the answer
    waits for a newer one; with any other, and with 0, the newest value is the answer.
    """

    def __init__(
            self, station: SimulatorState, read: Callable[[float], T],
            period: float = 0.0) -> None:
        """
        Show a value.

        :param station: where it is read
        :param read: what reads it, told the time [s]
        :param period: how often it is new, whatever it is [s]; 0 for whenever it is another one
        """
        self._station = station
        self._read = read
        self._period = period
        self._begin = station.now()
        self._index = 0
        self._refresh_at(station.now())

    async def get(self, cursor: int) -> tuple[int, T]:
        """
        Return the value once it is newer than what the client has.

        :param cursor: of what the client has; 0 for nothing
        :returns: cursor and value
        """
        while True:
            self._refresh()
            if cursor != self._cursor:
                return self._cursor, self._value
            await self._station.wait(self._next)

    @property
    def _next(self) -> float:
        return self._begin + (self._index + 1) * self._period if self._period else math.inf

    def _refresh(self) -> None:
        now = self._station.now()
        if self._period:
            if now >= self._next:
                # At the very time the quotient may be rounded down, and would be due for ever.
                self._index = max(self._index + 1, int((now - self._begin) / self._period))
                self._refresh_at(now)
        elif self._read(now) != self._value:
            self._refresh_at(now)

    def _refresh_at(self, now: float) -> None:
        self._value = self._read(now)
        self._cursor = self._station.new_cursor()


def constant(station: SimulatorState) -> LongPollValue[None]:
    """
    Return the topic of all that never changes, which has one cursor for good.

    :param station: where it does not change
    :returns: the topic
    """
    return LongPollValue(station, lambda _: None)


class SimulatorState:
    """
    Where the robot stands; of one event loop, so that nobody has to lock anything.

    Whoever changes the robot says so, and whoever waits for a change is woken: by that, and by
    ``run()`` whenever the robot changes by itself.
    """

    def __init__(self, robot: SimulatedKachaka, clock: Clock) -> None:
        """
        Take the robot in.

        :param robot: told the time from now on by nobody else
        :param clock: the time
        """
        self.robot = robot
        self.clock = clock
        self.localisation = MapToOdom()
        self._changed = asyncio.Event()
        self._cursor = 0

    def now(self) -> float:
        """Return the time [s]."""
        return self.clock.now()

    def notify(self) -> None:
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

    async def run(self) -> None:
        """Let the robot live on while nobody asks for it, and say what becomes of it."""
        while True:
            following = self.robot.next_change(self.now())
            await self.wait(following)
            if self.now() >= following:
                self.robot.state(self.now())
                self.notify()
