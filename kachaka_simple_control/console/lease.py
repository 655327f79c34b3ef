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
"""The lease of the hand: which one of the open pages may drive.  The caller tells the time."""

from __future__ import annotations

from typing import Generic, TypeVar

#: The lease ends after so long without input [s].
IDLE_TIME = 60.0
HolderT = TypeVar('HolderT')


class HandLease(Generic[HolderT]):
    """
    The right to drive, which at most one holder has; the first who asks gets it.

    :ivar holder: who has the lease; None if nobody has it
    :ivar free_since: since when nobody has it, on the caller's clock [s]
    """

    def __init__(self) -> None:
        self.holder: HolderT | None = None
        self.free_since = 0.0
        self._last_input = 0.0

    def ask(self, holder: HolderT, now: float) -> bool:
        """
        Ask for the lease, and return whether the holder has it now.

        :param holder: who asks
        """
        if self.holder is None:
            self.holder = holder
        self.note_input(holder, now)
        return self.holder is holder

    def note_input(self, holder: HolderT, now: float) -> None:
        """Note that somebody uses the page; only the input of the holder counts."""
        if self.holder is holder:
            self._last_input = now

    def give_up(self, holder: HolderT, now: float) -> bool:
        """
        Give up the lease, and return whether the holder had it.

        :param holder: who gives it up
        """
        if self.holder is not holder:
            return False
        self.holder, self.free_since = None, now
        return True

    def is_idle(self, now: float) -> bool:
        """Return whether the holder has had no input for too long."""
        return self.holder is not None and now - self._last_input >= IDLE_TIME
