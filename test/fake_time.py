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
"""A clock that only tests advance, and a publisher that records."""

from __future__ import annotations

from collections.abc import Callable


class FakeTime:
    """A clock that advances by the duration of each sleep."""

    def __init__(self, start: float = 1000.0) -> None:
        # Not zero, where errors would not show.
        self.now = start
        self.on_sleep: Callable[[], None] = lambda: None

    def clock(self) -> float:
        """Return the time [s]."""
        return self.now

    def sleep(self, duration: float) -> None:
        """Advance the clock [s]."""
        self.now += duration
        self.on_sleep()


class FakePublisher:
    """Records what a velocity gate sends, as (time [s], velocity)."""

    def __init__(self, time: FakeTime) -> None:
        self.sent: list[tuple[float, object]] = []
        self._time = time

    def transmit(self, velocity: object) -> None:
        """Record a velocity."""
        self.sent.append((self._time.now, velocity))
