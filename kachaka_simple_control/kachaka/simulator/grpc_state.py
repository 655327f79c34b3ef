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
"""The state of the gRPC service: robot, clock, map transform, and values for long polls."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import contextlib
import math
import time
from typing import Generic, TypeVar

from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import compose, ORIGIN, Pose, relative_to


class Clock:
    """
    The clocks of this machine: a steady clock, and the time of day.

    Tests use a subclass whose time they set.  They wake the server after each change of the time.
    """

    def now(self) -> float:
        """Return the time of the steady clock [s], which the robot uses."""
        return time.monotonic()

    def stamp(self) -> int:
        """Return the time of day for message headers [ns since 1970]."""
        return time.time_ns()

    def delay(self, until: float) -> float | None:
        """
        Return how long to wait until a time.

        :param until: the time [s, steady clock]
        :returns: the duration of the wait [s]; None for no limit, if a test sets the time and
            wakes the server
        """
        return max(until - self.now(), 0.0)


class MapToOdom:
    """
    The transform between the map frame and the odometry frame.

    It is the identity until ``correct()`` is called.
    """

    def __init__(self) -> None:
        #: the pose of the odometry frame in the map frame
        self.offset = ORIGIN

    def to_map(self, pose: Pose) -> Pose:
        """Convert a pose in the odometry frame to a pose in the map frame."""
        return compose(self.offset, pose)

    def to_odometry(self, pose: Pose) -> Pose:
        """Convert a pose in the map frame to a pose in the odometry frame."""
        return relative_to(self.offset, pose)

    def correct(self, map_pose: Pose, odometry_pose: Pose) -> None:
        """
        Set the transform so that ``to_map()`` converts the odometry pose to the map pose.

        :param map_pose: the pose of the robot in the map frame
        :param odometry_pose: the pose of the robot in the odometry frame
        """
        self.offset = compose(map_pose, relative_to(odometry_pose, ORIGIN))


class SimulatorState:
    """
    The robot, its clock, and the transform between map and odometry.

    All code that uses this object runs in one event loop, so no lock is needed.  Code that changes
    the robot must call ``notify()`` to wake all waiting calls.  ``run()`` does this when the robot
    changes automatically, for example when manual control expires.

    :param robot: the robot; from now on, code outside of the event loop must not call it
    :param clock: the clock of the robot
    """

    def __init__(self, robot: SimulatedKachaka, clock: Clock) -> None:
        self.robot = robot
        self.clock = clock
        self.map_to_odom = MapToOdom()
        self._changed = asyncio.Event()
        self._cursor = 0

    def now(self) -> float:
        """Return the time of the steady clock [s]."""
        return self.clock.now()

    def notify(self) -> None:
        """Wake all calls that wait for a change of the robot or its values."""
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    def new_cursor(self) -> int:
        """Return a new cursor, a number that neither this nor an earlier process has used."""
        # The cursors of the real robot are times, too.
        self._cursor = max(self._cursor + 1, int(self.now() * 1e9))
        return self._cursor

    async def wait(self, until: float = math.inf) -> None:
        """
        Wait until ``notify()`` is called, or until a time.

        :param until: the time [s, steady clock]; infinity for no limit
        """
        timeout = self.clock.delay(until) if math.isfinite(until) else None
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._changed.wait(), timeout)
        if timeout == 0.0:
            await asyncio.sleep(0.0)

    async def run(self) -> None:
        """
        Wake all waiting calls each time that the robot changes automatically.

        This coroutine runs until it is cancelled.
        """
        while True:
            change_time = self.robot.next_change(self.now())
            await self.wait(change_time)
            if self.now() >= change_time:
                self.robot.state(self.now())
                self.notify()


T = TypeVar('T')


class LongPollValue(Generic[T]):
    """
    A value with a cursor for long polls, as in docs/GRPC.md of pf-robotics/kachaka-api.

    A client sends the cursor of its last value.  If this is the newest value, the call waits for a
    newer value.  For any other cursor, and for 0, the call returns the newest value at once.

    :param state: the robot and its clock
    :param read: returns the value; called with the time [s, steady clock]
    :param period: the update period of the value [s]; 0 to update when the value changes
    """

    def __init__(
            self, state: SimulatorState, read: Callable[[float], T], period: float = 0.0) -> None:
        self._state = state
        self._read = read
        self._period = period
        self._start = state.now()
        self._index = 0
        self._refresh_at(state.now())

    async def get(self, cursor: int) -> tuple[int, T]:
        """
        Wait until the value is newer than the client's value.

        :param cursor: the cursor of the client's value; 0 if the client has none
        :returns: the cursor of the newest value, and the value
        """
        while True:
            self._refresh()
            if cursor != self._cursor:
                return self._cursor, self._value
            await self._state.wait(self._next_refresh)

    @property
    def _next_refresh(self) -> float:
        return self._start + (self._index + 1) * self._period if self._period else math.inf

    def _refresh(self) -> None:
        now = self._state.now()
        if self._period:
            if now >= self._next_refresh:
                # Add at least 1: if rounding makes the quotient too small, the same refresh would
                # be due again.
                self._index = max(self._index + 1, int((now - self._start) / self._period))
                self._refresh_at(now)
        elif self._read(now) != self._value:
            self._refresh_at(now)

    def _refresh_at(self, now: float) -> None:
        self._value = self._read(now)
        self._cursor = self._state.new_cursor()
