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
"""The time that a server lives in."""

from __future__ import annotations

import time


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
