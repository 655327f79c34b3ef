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
The lease of the hand: which page may drive, and when nobody needs the robot any more.

The caller tells the time.
"""

from __future__ import annotations

from typing import Generic, TypeVar

from kachaka_simple_control.files.protocol import StateName

#: The lease ends after so long without input [s].
IDLE_TIME = 60.0
#: In these states the robot is held, and no motion is driven.
HELD_STATES = ('ready', 'driving by hand')
#: In these states the robot is released when nobody has driven it for a while.
IDLE_STATES = (*HELD_STATES, 'paused')
#: In these states the lease does not end by itself.
BUSY_STATES = ('taking', 'driving', 'paused', 'stopping')
HolderT = TypeVar('HolderT')


class HandLease(Generic[HolderT]):
    """
    The right to drive, which at most one holder has; the first who asks gets it.

    ``state`` is that of the drive process.

    :ivar holder: who has the lease; None if nobody has it
    :ivar free_since: since when nobody has it, on the caller's clock [s]
    """

    def __init__(self) -> None:
        self.holder: HolderT | None = None
        self.free_since = 0.0
        self._has_finished = False
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

    def give_up(self, holder: HolderT, now: float, has_finished: bool = False) -> bool:
        """
        Give up the lease, and return whether the holder had it.

        :param holder: who gives it up
        :param has_finished: whether the holder does not need the robot any more
        """
        if self.holder is not holder:
            return False
        self.holder, self.free_since, self._has_finished = None, now, has_finished
        return True

    def is_idle(self, now: float, state: StateName) -> bool:
        """Return whether the holder has had no input for too long."""
        return (self.holder is not None and now - self._last_input >= IDLE_TIME
                and state not in BUSY_STATES)

    def is_robot_free(self, now: float, state: StateName) -> bool:
        """Return whether nobody needs the robot, so that it is to be released."""
        # A motion that is paused ends with the release: another page may still go on with it.
        return self.holder is None and (
            (now - self.free_since >= IDLE_TIME and state in IDLE_STATES)
            or (self._has_finished and state in HELD_STATES))
