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
"""When velocities have ceased, and the robot had better stop before its hold ends."""

from __future__ import annotations

#: A robot whose velocities cease is stopped after this time without one [s].  It is below the
#: hold of 0.3 s, and above the period of the slowest publisher that keeps such a robot moving
#: (5 Hz, 0.2 s).
LIMIT = 0.25
#: A publisher that ever let this time pass between two velocities of a motion [s] is left to the
#: hold: a late message of it must not be taken for its end.  Our node gives its run up when it is
#: more than 0.1 s late, so 0.15 + 0.1 = LIMIT never cuts a run of it short.
LEISURELY = 0.15


class Silence:
    """
    Hears the commands that come, and says when to stop waiting for the next.

    Knows of a motion only what it heard in this motion: before its second velocity, nothing.
    """

    def __init__(self) -> None:
        """Wait for nothing."""
        self._last: float | None = None
        self._longest: float | None = None

    def hear(self, is_stop: bool, now: float) -> None:
        """
        Take note of a command.

        :param is_stop: whether it asks the robot to stand still; then nothing more need come
        :param now: the time [s, steady clock]
        """
        if is_stop:
            self._last = self._longest = None
            return
        if self._last is not None:
            self._longest = max(self._longest or 0.0, now - self._last)
        self._last = now

    @property
    def end(self) -> float | None:
        """Return when to stop the robot unless a command comes before [s]; None for never."""
        if self._last is None or self._longest is None or self._longest > LEISURELY:
            return None
        return self._last + LIMIT

    def is_over(self, now: float) -> bool:
        """
        Tell once whether velocities have ceased.

        :param now: the time [s, steady clock]
        :returns: whether they have; then nothing is waited for until the next
        """
        if self.end is None or now < self.end:
            return False
        self._last = self._longest = None
        return True
