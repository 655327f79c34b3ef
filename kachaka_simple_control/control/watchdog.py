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
"""When the guardian has to stop the robot, and when it is frozen itself; told the time."""

from __future__ import annotations

from enum import Enum

from kachaka_simple_control.control.timing import (
    CHECK_PERIOD,
    GUARDIAN_TIMEOUT,
    HEARTBEAT_TIMEOUT,
    PUBLISH_TIMEOUT,
    STOPPING_TIMEOUT,
    WATCHDOG_PERIOD,
)

#: Differences of times below this are rounding errors [s].
ROUNDING_ERROR = 1e-6


class GuardianMessage(bytes, Enum):
    """The messages from a node to its guardian; one byte each."""

    #: publish one zero and report it, so that the robot's reader is matched before a run
    PRIME = b'p'
    #: heartbeat: a run is on, and its thread is alive
    HEARTBEAT = b'b'
    #: the run is over; a zero is about to leave, and more will follow
    STOPPING = b'r'
    #: the stop was sent whole: no heartbeat is due until the next run
    STOPPED = b's'


class Watchdog:
    """
    Decides when the guardian stops the robot: once, and never after the node's own whole stop.

    From the first heartbeat of a run to the last zero of its stop, messages have to come.

    Time without a message counts only while the guardian itself is awake: a machine that stands
    still for a moment holds up both processes and must not end a healthy run.  The node checks its
    gaps by itself.  Time that the node spends in DDS counts against PUBLISH_TIMEOUT instead:
    publishing took a third of a second while a node joined the graph (measured).

    :param heartbeat_timeout: how long a run may go without a heartbeat [s]
    """

    def __init__(self, heartbeat_timeout: float = HEARTBEAT_TIMEOUT) -> None:
        self._heartbeat_timeout = heartbeat_timeout
        #: how long the node may be silent, from its newest message on [s]
        self.allowed = heartbeat_timeout
        self._silent = 0.0
        self._publishing = 0.0
        #: when the time without a message was last added up [s]; None if no message is due
        self._counted: float | None = None
        self._must_stop = False
        #: whether the process may end
        self.is_over = False

    def on_message(self, message: bytes, now: float) -> None:
        """
        Process a message of the node.

        :param message: one byte
        :param now: when it was read [s]
        """
        if message == GuardianMessage.HEARTBEAT or (
                message == GuardianMessage.STOPPING and self._must_stop):
            self._counted, self._silent, self._publishing = now, 0.0, 0.0
            is_heartbeat = message == GuardianMessage.HEARTBEAT
            self.allowed = self._heartbeat_timeout if is_heartbeat else STOPPING_TIMEOUT
            self._must_stop = True
        elif message == GuardianMessage.STOPPED:
            self._must_stop, self._counted = False, None

    def on_disconnect(self) -> bool:
        """
        Handle the end of the node, or of the guardian.

        :returns: whether the robot must be stopped now
        """
        must_stop = self._must_stop
        self._must_stop, self._counted, self.is_over = False, None, True
        return must_stop

    def has_timed_out(self, now: float, is_publishing: bool = False) -> bool:
        """
        Return whether messages have stayed away too long: True once; ask after each ``timeout()``.

        :param now: the time [s]
        :param is_publishing: whether the node is awake and in DDS
        :returns: whether the robot must be stopped now
        """
        if self._counted is None:
            return False
        awake = min(now - self._counted, WATCHDOG_PERIOD)
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
        """Return how long to wait for the next message [s]; None if none is due."""
        if self._counted is None:
            return None
        return min(WATCHDOG_PERIOD, self.allowed - self._silent)


class GuardianWatch:
    """
    Detects for the node that its guardian is frozen: it has stopped serving heartbeats.

    Only time in which the node itself was awake counts: a machine that stood still held up both.
    """

    def __init__(self) -> None:
        self._count: int | None = None
        self._checked = self._silent = 0.0

    def reset(self) -> None:
        """Expect nothing until the next check: no heartbeats are sent meanwhile."""
        self._count = None

    def is_frozen(self, now: float, count: int) -> bool:
        """
        Return whether the guardian has served no heartbeat for GUARDIAN_TIMEOUT.

        :param now: the time [s]
        :param count: how many heartbeats it has served, in any numbers that change with each
        """
        if count == self._count:
            self._silent += min(now - self._checked, 2.0 * CHECK_PERIOD)
        else:
            self._count, self._silent = count, 0.0
        self._checked = now
        return self._silent > GUARDIAN_TIMEOUT
