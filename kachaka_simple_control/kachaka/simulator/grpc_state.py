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
"""
What the gRPC calls of the simulated robot use: robot, clock, map, and values to wait for.

Tested by test/kachaka/simulator/test_grpc_tasks.py.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import contextlib
import math
import time
from typing import Generic, TypeVar

from kachaka_simple_control.kachaka.simulator.contact import Contact
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import compose, ORIGIN, Pose, relative_to

#: How often a robot that can touch something is looked at [s].
CONTACT_PERIOD = 0.02


class Clock:
    """
    The clocks of this machine: a steady clock, and the time of day.

    A test can set the time of a subclass, and must wake the server after each change.
    """

    def now(self) -> float:
        """Return the time of the steady clock [s], which is the time of the robot."""
        return time.monotonic()

    def stamp(self) -> int:
        """Return the time of day [ns since 1970], for time stamps of messages."""
        return time.time_ns()

    def delay(self, until: float) -> float | None:
        """
        Return how long to wait until the steady clock reaches a time [s].

        :returns: None in a subclass for tests: until the test wakes the server
        """
        return max(until - self.now(), 0.0)


class MapToOdom:
    """The transform between map and odometry frame, equal at first."""

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
        """Change the transform so that it converts a given odometry pose to a given map pose."""
        self.offset = compose(map_pose, relative_to(odometry_pose, ORIGIN))


class SimulatorState:
    """
    The simulated robot, its clock, and the transform between map and odometry.

    All its code runs in one asyncio event loop.  Code that changes the robot calls ``notify()`` to
    wake the calls that wait; ``run()`` does so when the robot changes by itself.

    :param on_contact: called once, when the robot has touched something on its floor
    """

    def __init__(
            self, robot: SimulatedKachaka, clock: Clock,
            on_contact: Callable[[Contact], None] = lambda _: None) -> None:
        self.robot = robot
        self.clock = clock
        self._on_contact = on_contact
        self._looks_for_contact = robot.floor is not None
        self.map_to_odom = MapToOdom()
        self._changed = asyncio.Event()
        self._cursor = 0

    def now(self) -> float:
        """Return the time of the steady clock [s], which is the robot's time."""
        return self.clock.now()

    def notify(self) -> None:
        """Wake all gRPC calls that wait for a change of the robot, because it has changed."""
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    def new_cursor(self) -> int:
        """Return a new cursor, larger than all since this machine started, in any process."""
        # The cursors of the real robot are times, too.
        self._cursor = max(self._cursor + 1, int(self.now() * 1e9))
        return self._cursor

    async def wait(self, until: float = math.inf) -> None:
        """Wait for ``notify()``, or until a time [s, steady clock]; infinity for no limit."""
        timeout = self.clock.delay(until) if math.isfinite(until) else None
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._changed.wait(), timeout)
        if timeout == 0.0:
            await asyncio.sleep(0.0)

    async def run(self) -> None:
        """Wake all waiting calls when the robot changes by itself, until this is cancelled."""
        while True:
            change_time = self.robot.next_change(self.now())
            await self.wait(min(change_time, self.now() + CONTACT_PERIOD)
                            if self._looks_for_contact else change_time)
            self._look_for_contact()
            if self.now() >= change_time:
                self.robot.state(self.now())
                self.notify()

    def _look_for_contact(self) -> None:
        if self._looks_for_contact and (contact := self.robot.contact(self.now())) is not None:
            self._looks_for_contact = False
            self._on_contact(contact)


T = TypeVar('T')


class LongPollValue(Generic[T]):
    """
    A value of the robot for long polls, which are gRPC calls that wait until the value changes.

    Each version has a cursor; see docs/GRPC.md of pf-robotics/kachaka-api.  A client sends the
    cursor of its version: it gets the newest one at once or, if it has that, waits for the next.

    :param read: returns the value at a time [s, steady clock]
    :param period: between two versions [s]; 0 if there is one only when the value has changed
    :param may_pause: whether the same object, returned after a period, is no new version
    """

    def __init__(
            self, state: SimulatorState, read: Callable[[float], T], period: float = 0.0,
            may_pause: bool = False) -> None:
        self._state = state
        self._read = read
        self._period = period
        self._may_pause = may_pause
        self._start = state.now()
        self._index = 0
        self._value: T
        self._refresh_at(state.now(), is_first=True)

    async def get(self, cursor: int) -> tuple[int, T]:
        """
        Return the newest value; if the client already has this value, wait for the next one.

        :param cursor: that of the client's value; 0 if it has none
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

    def _refresh_at(self, now: float, is_first: bool = False) -> None:
        value = self._read(now)
        if is_first or not (self._may_pause and value is self._value):
            self._value = value
            self._cursor = self._state.new_cursor()
