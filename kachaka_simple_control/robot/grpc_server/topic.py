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
"""Something that clients read, and wait for to change."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Generic, TypeVar

from kachaka_simple_control.robot.grpc_server.station import Station

T = TypeVar('T')


class Topic(Generic[T]):
    """
    A value and its cursor, as the maker describes them (docs/GRPC.md in pf-robotics/kachaka-api).

    A client sends the cursor of the value it has.  If it is that of the newest value, the answer
    waits for a newer one; with any other, and with 0, the newest value is the answer.
    """

    def __init__(
            self, station: Station, read: Callable[[float], T], period: float = 0.0) -> None:
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


def constant(station: Station) -> Topic[None]:
    """
    Return the topic of all that never changes, which has one cursor for good.

    :param station: where it does not change
    :returns: the topic
    """
    return Topic(station, lambda _: None)
