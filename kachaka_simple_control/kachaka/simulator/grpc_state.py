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
The data that the gRPC calls of the simulated robot use.

They are the robot, its clock, the transform between the map and odometry frames, and the values
that clients read, for example whether the robot is docked.  A client can wait until such a value
changes.
"""

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

    A test can use a subclass with a time that the test sets.  The test must wake the gRPC server
    after each change of the time.
    """

    def now(self) -> float:
        """Return the time of the steady clock [s], which is the time of the robot."""
        return time.monotonic()

    def stamp(self) -> int:
        """Return the time of day [ns since 1970], for time stamps of messages."""
        return time.time_ns()

    def delay(self, until: float) -> float | None:
        """
        Return how long the server must wait until the steady clock reaches a time.

        :param until: the time [s, steady clock]
        :returns: the duration of the wait [s]; 0 if the time has passed.  A subclass for tests
            returns None: the server then waits until the test wakes it
        """
        return max(until - self.now(), 0.0)


class MapToOdom:
    """
    The transform between the map frame and the odometry frame of the robot.

    At first, both frames have the same origin and the same direction.  ``correct()`` changes the
    transform.
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
        Change the transform so that it converts a given odometry pose to a given map pose.

        :param map_pose: the pose of the robot in the map frame
        :param odometry_pose: the pose of the robot in the odometry frame at the same time
        """
        self.offset = compose(map_pose, relative_to(odometry_pose, ORIGIN))


class SimulatorState:
    """
    The simulated robot, its clock, and the transform between map and odometry.

    All code that uses this object runs in one asyncio event loop, so no lock is needed.  gRPC
    calls can wait until the robot changes.  Code that changes the robot must call ``notify()`` to
    wake these calls.  ``run()`` wakes them when the robot changes without a request, for example
    when the robot has completed a motion.

    :param robot: the simulated robot; from now on, code outside of the event loop must not use it
    :param clock: the clock that gives the robot its time
    """

    def __init__(self, robot: SimulatedKachaka, clock: Clock) -> None:
        self.robot = robot
        self.clock = clock
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
        """
        Return a new cursor, a number that identifies one version of a value.

        It is larger than every cursor that was returned since the start of this machine, also by
        earlier processes.
        """
        # The cursors of the real robot are times, too.
        self._cursor = max(self._cursor + 1, int(self.now() * 1e9))
        return self._cursor

    async def wait(self, until: float = math.inf) -> None:
        """
        Wait until ``notify()`` is called, or until a time is reached.

        :param until: the time [s, steady clock]; infinity to wait only for ``notify()``
        """
        timeout = self.clock.delay(until) if math.isfinite(until) else None
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._changed.wait(), timeout)
        if timeout == 0.0:
            await asyncio.sleep(0.0)

    async def run(self) -> None:
        """
        Wake all waiting gRPC calls each time that the robot changes without a request.

        An example is the end of a command.  This coroutine runs until it is cancelled.
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
    A value of the robot for long polls, which are gRPC calls that wait until the value changes.

    Each version of the value has a cursor, a number that identifies the version; see docs/GRPC.md
    of pf-robotics/kachaka-api.  A client sends the cursor of the version that it has.  If this
    version is the newest one, the call waits for the next version.  For any other cursor, and for
    0, the call returns the newest version at once.

    :param state: the simulated robot and its clock
    :param read: a function that returns the value now; its argument is the time [s, steady clock]
    :param period: the time between two versions of the value [s]; 0 if there is a new version only
        when the value has changed
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
        Return the newest value; if the client already has this value, wait for the next one.

        :param cursor: the cursor of the client's value, a number that identifies this version of
            the value; 0 if the client has no value
        :returns: the cursor of the newest value, and this value
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
