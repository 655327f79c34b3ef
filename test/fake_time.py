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
"""A steady clock that only tests move."""

from __future__ import annotations

from collections.abc import Callable


class FakeTime:
    """Time that passes when somebody sleeps, and by so much only."""

    def __init__(self, start: float = 1000.0) -> None:
        """Begin anywhere but at zero, where mistakes hide."""
        self.now = start
        self.on_sleep: Callable[[], None] = lambda: None

    def clock(self) -> float:
        """Return the time [s]."""
        return self.now

    def sleep(self, duration: float) -> None:
        """Let time pass [s]."""
        self.now += duration
        self.on_sleep()


class Wire:
    """What left an edge, as (time [s], velocity)."""

    def __init__(self, time: FakeTime) -> None:
        """Note nothing yet."""
        self.sent: list[tuple[float, object]] = []
        self._time = time

    def transmit(self, velocity: object) -> None:
        """Take a velocity."""
        self.sent.append((self._time.now, velocity))
