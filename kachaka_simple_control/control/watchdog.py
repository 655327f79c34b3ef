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
"""Decide when the guardian has to stop the robot, and detect a guardian that is frozen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum
from typing import Protocol

from kachaka_simple_control.control.guardian_memory import GuardianMemory, RobotSlot
from kachaka_simple_control.control.timing import (
    CHECK_PERIOD,
    FIRST_CHECK_DELAY,
    GUARDIAN_TIMEOUT,
    HEARTBEAT_TIMEOUT,
    PUBLISH_TIMEOUT,
    STOPPING_TIMEOUT,
    WATCHDOG_PERIOD,
)

#: Smaller time differences are rounding errors [s].
ROUNDING_ERROR = 1e-6


class GuardianMessage(bytes, Enum):
    """The messages that a node sends to its guardian: one byte, after that of the robot's slot."""

    #: publish one zero velocity and report it, so that the robot's reader is matched before
    #: a drive
    PRIME = b'p'
    #: the first heartbeat of a drive; later ones are in the shared memory
    HEARTBEAT = b'b'
    #: the drive is over: a zero velocity is sent next, and more zeros will follow
    STOPPING = b'r'
    #: the complete stop was sent: no heartbeat is due until the next drive
    STOPPED = b's'
    #: the node releases the robot: destroy the guardian's publisher for it
    LEAVE = b'l'


class Watchdog:
    """
    Decides when the guardian must stop the robot, because the node was silent for too long.

    The node sends heartbeats from the start of a drive to the last zero velocity of its stop.  The
    robot is stopped at most once in each drive.

    Two times are no silence: that in which the guardian itself could not run, because a short
    pause of the whole machine must not end a drive; and that in which the node waits in a DDS
    call, which has a limit of its own, PUBLISH_TIMEOUT.

    :param heartbeat_timeout: the longest allowed time without a heartbeat during a drive [s]
    """

    def __init__(self, heartbeat_timeout: float = HEARTBEAT_TIMEOUT) -> None:
        self._heartbeat_timeout = heartbeat_timeout
        #: how long the node may be silent after its newest message [s]
        self.allowed = heartbeat_timeout
        # The time in which the guardian was held up is left out: the node itself checks the time
        # between its velocities.
        self._silent = 0.0
        # One publish call took a third of a second while a node joined the graph (measured).
        self._publishing = 0.0
        #: the newest heartbeat in the shared memory [s]
        self._heartbeat = 0.0
        #: when the time without a message was last updated [s]; None if no message is due
        self._counted: float | None = None
        self._must_stop = False

    def on_message(self, message: bytes, now: float) -> None:
        """Process a message that the node has sent to the guardian."""
        if message == GuardianMessage.HEARTBEAT or (
                message == GuardianMessage.STOPPING and self._must_stop):
            self._counted, self._silent, self._publishing = now, 0.0, 0.0
            is_heartbeat = message == GuardianMessage.HEARTBEAT
            self.allowed = self._heartbeat_timeout if is_heartbeat else STOPPING_TIMEOUT
            self._must_stop = True
        elif message == GuardianMessage.STOPPED:
            self._must_stop, self._counted = False, None

    @property
    def expects_heartbeat(self) -> bool:
        """Whether the robot is driven now, so that its thread has to write heartbeats."""
        return self._counted is not None and self.allowed == self._heartbeat_timeout

    def on_heartbeat(self, written: float, now: float) -> None:
        """Process a heartbeat, the time when the node wrote it [s]; no effect outside a drive."""
        if (self._counted is not None and self.expects_heartbeat
                and written != self._heartbeat):
            self._heartbeat = written
            # A value that was read while it was written may be any number, or NaN.
            self._counted = min(max(self._counted, written), now)
            self._silent = self._publishing = 0.0

    def on_disconnect(self) -> bool:
        """
        End the watch of the robot: it was released, or the node or the guardian ends.

        :returns: whether the guardian has to stop the robot now, because no end of a stop was
            reported
        """
        must_stop = self._must_stop
        self._must_stop, self._counted = False, None
        return must_stop

    def has_timed_out(self, now: float, is_publishing: bool = False) -> bool:
        """
        Return whether the node was silent for too long; call this after each wait.

        :param is_publishing: whether the node, not frozen, waits in a DDS call, which may take
            longer
        """
        if self._counted is None:
            return False
        awake = min(now - self._counted, self._longest_wait())
        self._counted = now
        if is_publishing:
            self._publishing += awake
        else:
            self._silent += awake
        if (self._silent < self.allowed - ROUNDING_ERROR
                and self._publishing < PUBLISH_TIMEOUT - ROUNDING_ERROR):
            return False
        self._must_stop, self._counted = False, None
        return True

    def timeout(self) -> float | None:
        """Return how long to wait for the next message of the node [s]; None if none is due."""
        if self._counted is None:
            return None
        return min(self._longest_wait(), self.allowed - self._silent)

    def _longest_wait(self) -> float:
        return max(FIRST_CHECK_DELAY - self._silent - self._publishing, WATCHDOG_PERIOD)


class GuardedSlot(Protocol):
    """A robot that the guardian stops."""

    slot: RobotSlot
    watchdog: Watchdog


def silent_robots(
        robots: Mapping[int, GuardedSlot], memory: GuardianMemory, now: float,
        is_node_frozen: Callable[[], bool]) -> list[int]:
    """
    Return the numbers of the robots to stop because the threads that drive them are silent.

    :param is_node_frozen: whether a signal has stopped the node: then it waits for no DDS call,
        although its flag may be set
    """
    sending = {number for number, robot in robots.items() if robot.slot.sending.is_set}
    if sending and is_node_frozen():
        sending = set()
    # A thread that waits in a DDS call for one of its robots has no heartbeat for the others.
    threads = {robots[number].slot.thread for number in sending
               if robots[number].watchdog.expects_heartbeat}
    silent = []
    for number, robot in robots.items():
        watchdog, thread = robot.watchdog, robot.slot.thread
        watchdog.on_heartbeat(memory.heartbeat(thread), now)
        is_publishing = number in sending or (watchdog.expects_heartbeat and thread in threads)
        if watchdog.has_timed_out(now, is_publishing):
            silent.append(number)
    return silent


class GuardianWatch:
    """
    Detects, in a thread that drives, that the guardian is frozen and checks no heartbeats.

    The time in which the thread itself could not run does not count.
    """

    def __init__(self) -> None:
        self._count: int | None = None
        self._checked = self._silent = 0.0

    def is_frozen(self, now: float, count: int) -> bool:
        """
        Return whether the guardian process has checked no heartbeat for GUARDIAN_TIMEOUT.

        :param count: how often it has checked; this number restarts at 0 after 255
        """
        if count == self._count:
            self._silent += min(now - self._checked, 2.0 * CHECK_PERIOD)
        else:
            self._count, self._silent = count, 0.0
        self._checked = now
        return self._silent > GUARDIAN_TIMEOUT
