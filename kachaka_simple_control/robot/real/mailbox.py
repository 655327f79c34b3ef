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
"""The newest command, and none but the newest."""

from __future__ import annotations

from kachaka_simple_control.robot.real.command import Command


class Mailbox:
    """
    Holds one motion that waits for the robot to be free, or the knowledge that a stop is owed.

    A newer command takes the place of an older one, so nothing queues up before a slow robot.  A
    stop takes the place of any motion, and is never lost to one: it stays owed until it is taken.
    """

    def __init__(self, patience: float) -> None:
        """
        Hold nothing.

        :param patience: how old a motion may be when it is taken [s]; older ones are dropped
        """
        self._patience = patience
        self._newest: Command | None = None
        self._motion: Command | None = None
        #: whether a stop has to be sent before any motion
        self.is_stop_owed = False
        #: how many motions were replaced, or dropped for their age or for a stop
        self.dropped = 0

    def put(self, command: Command) -> None:
        """
        Take a command in, in place of what waits.

        :param command: the newest command
        """
        if command.is_stop:
            self.owe_stop()
            return
        self.clear()
        self._newest = self._motion = command

    def put_back(self, command: Command) -> None:
        """
        Take in again a motion that the robot did not take, if it is still what is wanted.

        :param command: the motion, which was taken from here
        """
        if command is self._newest:
            self._motion = command

    def owe_stop(self) -> None:
        """Drop what waits; a stop is owed."""
        self.clear()
        self.is_stop_owed = True

    def clear(self) -> None:
        """Forget the motion that waits, if one does, and all before it."""
        self.dropped += self._motion is not None
        self._newest = self._motion = None

    def take_stop(self) -> bool:
        """
        Take the stop that is owed.

        :returns: whether one was
        """
        was_owed, self.is_stop_owed = self.is_stop_owed, False
        return was_owed

    def has_motion(self, now: float) -> bool:
        """
        Tell whether a motion waits that may be sent; one that has grown too old is dropped.

        :param now: the time [s, steady clock]
        :returns: whether there is one, and no stop comes before it
        """
        if self._motion is not None and now - self._motion.time > self._patience:
            self.clear()
        return self._motion is not None and not self.is_stop_owed

    def take_motion(self, now: float) -> Command | None:
        """
        Take the motion that waits, if it may be sent.

        :param now: the time [s, steady clock]
        :returns: the motion; None if there is none
        """
        if not self.has_motion(now):
            return None
        motion, self._motion = self._motion, None
        return motion
