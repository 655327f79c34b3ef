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
Decide when the guardian has to stop the robot, and detect a guardian that is frozen.

The caller passes the time.
"""

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

#: Smaller time differences are rounding errors [s].
ROUNDING_ERROR = 1e-6


class GuardianMessage(bytes, Enum):
    """The messages from a node to its guardian; the robot's slot number precedes each byte."""

    #: publish one zero velocity and report it, so that the robot's reader is matched before a run
    PRIME = b'p'
    #: the first heartbeat of a run; later ones are in the shared memory
    HEARTBEAT = b'b'
    #: the run is over: a zero velocity is sent next, and more zeros will follow
    STOPPING = b'r'
    #: the complete stop was sent: no heartbeat is due until the next run
    STOPPED = b's'
    #: the node releases the robot: destroy the guardian's publisher for it
    LEAVE = b'l'


class Watchdog:
    """
    Decides when the guardian stops the robot, because the node has been silent for too long.

    The node has to send messages from the first heartbeat of a run to the last zero velocity of
    its stop.  After the node has sent its complete stop, the guardian does not stop the robot
    again.  It stops the robot at most once per run.

    Time without a message counts only while the guardian runs.  If the whole machine pauses for a
    moment, both processes are held up, and this must not end a good run.  The node itself checks
    the time between its velocities.  Time that the node spends in DDS calls is limited by
    PUBLISH_TIMEOUT instead: one publish call took a third of a second while a node joined the
    graph (measured).

    :param heartbeat_timeout: how long a run may go without a heartbeat [s]
    """

    def __init__(self, heartbeat_timeout: float = HEARTBEAT_TIMEOUT) -> None:
        self._heartbeat_timeout = heartbeat_timeout
        #: how long the node may be silent after its newest message [s]
        self.allowed = heartbeat_timeout
        self._silent = 0.0
        self._publishing = 0.0
        #: the newest heartbeat in the shared memory [s]
        self._heartbeat = 0.0
        #: when the time without a message was last updated [s]; None if no message is due
        self._counted: float | None = None
        self._must_stop = False

    def on_message(self, message: bytes, now: float) -> None:
        """
        Process a message from the node.

        :param message: one byte, a GuardianMessage
        :param now: when the message was read [s]
        """
        if message == GuardianMessage.HEARTBEAT or (
                message == GuardianMessage.STOPPING and self._must_stop):
            self._counted, self._silent, self._publishing = now, 0.0, 0.0
            is_heartbeat = message == GuardianMessage.HEARTBEAT
            self.allowed = self._heartbeat_timeout if is_heartbeat else STOPPING_TIMEOUT
            self._must_stop = True
        elif message == GuardianMessage.STOPPED:
            self._must_stop, self._counted = False, None

    def on_heartbeat(self, written: float, now: float) -> None:
        """
        Process the heartbeat in the shared memory; it has no effect unless a run is under way.

        :param written: when the node wrote it [s]
        :param now: the time [s]
        """
        is_due = self._counted is not None and self.allowed == self._heartbeat_timeout
        if self._counted is not None and is_due and written != self._heartbeat:
            self._heartbeat = written
            # A value that was read while it was written may be any number, or NaN.
            self._counted = min(max(self._counted, written), now)
            self._silent = self._publishing = 0.0

    def on_disconnect(self) -> bool:
        """
        Process the end of the connection, because the node has ended or the guardian has to end.

        :returns: whether the robot must be stopped now
        """
        must_stop = self._must_stop
        self._must_stop, self._counted = False, None
        return must_stop

    def has_timed_out(self, now: float, is_publishing: bool = False) -> bool:
        """
        Return whether the node has been silent for too long.

        Call this after each wait, which takes at most ``timeout()``.

        :param now: the time [s]
        :param is_publishing: whether the node is running and waits in a DDS call
        :returns: whether the robot must be stopped now; True only once until the next
            heartbeat message
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
        """Return how long to wait for the next message [s]; None if no message is due."""
        if self._counted is None:
            return None
        return min(WATCHDOG_PERIOD, self.allowed - self._silent)


class GuardianWatch:
    """
    Detects for a node that its guardian is frozen and no longer checks heartbeats.

    Only time in which the node runs counts, because a pause of the whole machine holds up both
    processes.
    """

    def __init__(self) -> None:
        self._count: int | None = None
        self._checked = self._silent = 0.0

    def reset(self) -> None:
        """Restart the measurement at the next check, because no heartbeats are sent until then."""
        self._count = None

    def is_frozen(self, now: float, count: int) -> bool:
        """
        Return whether the guardian has checked no heartbeat for GUARDIAN_TIMEOUT.

        :param now: the time [s]
        :param count: how often the guardian has checked heartbeats; the count may restart at 0
        """
        if count == self._count:
            self._silent += min(now - self._checked, 2.0 * CHECK_PERIOD)
        else:
            self._count, self._silent = count, 0.0
        self._checked = now
        return self._silent > GUARDIAN_TIMEOUT
