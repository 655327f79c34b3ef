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

The guardian is a separate process that stops the robot if the node cannot.  This module reads no
clock: the caller passes the time.
"""

from __future__ import annotations

from enum import Enum

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
    """
    The messages that a node sends to its guardian, a separate process that stops the robot.

    Each message is one byte.  A byte with the slot number of the robot precedes it.  This number
    is the index of the robot in the memory that both processes share.
    """

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
    Decides when the guardian must stop the robot, because the node was silent for too long.

    The guardian is a separate process.  The node has to send messages to it from the first
    heartbeat of a run (one drive of the robot) to the last zero velocity of the stop.  After this
    zero velocity, the guardian need not stop the robot.  It stops the robot at most once in each
    run.

    The silence of the node does not include two times.  The first is the time in which the
    guardian itself could not run, because a short pause of the whole machine must not end a drive.
    The second is the time in which the node waits in a DDS call.  This time has its own limit,
    PUBLISH_TIMEOUT.

    :param heartbeat_timeout: the longest allowed time without a heartbeat during a run [s]
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
        """
        Process a message that the node has sent to the guardian.

        :param message: the message: one byte, a value of ``GuardianMessage``
        :param now: when the guardian has read the message [s]
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
        Process the heartbeat, a time that the node writes into the shared memory during a drive.

        A new time shows that the node still works.  Outside a drive, this call has no effect.

        :param written: when the node wrote the heartbeat [s]
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
        End the watch of the robot; call this when no more messages from the node are processed.

        This is the case when the node has released the robot, and when the node or the guardian
        ends.

        :returns: whether the guardian has to stop the robot now, because the node has not reported
            the end of the stop
        """
        must_stop = self._must_stop
        self._must_stop, self._counted = False, None
        return must_stop

    def has_timed_out(self, now: float, is_publishing: bool = False) -> bool:
        """
        Return whether the node was silent for too long, so that the guardian must stop the robot.

        Call this after each wait for messages; such a wait may take at most ``timeout()``.

        :param now: the time [s]
        :param is_publishing: True if the node is not frozen and waits in a DDS call, which may
            take longer than the normal time between two heartbeats
        :returns: whether the robot must be stopped now.  After this value was True once, it is
            False until a new drive begins
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
        """
        Return how long the guardian may wait for the next message of the node [s].

        The value is None if no message is due, because the robot is not driven.
        """
        if self._counted is None:
            return None
        return min(self._longest_wait(), self.allowed - self._silent)

    def _longest_wait(self) -> float:
        return max(FIRST_CHECK_DELAY - self._silent - self._publishing, WATCHDOG_PERIOD)


class GuardianWatch:
    """
    Detects, in the node, that its guardian is frozen and no longer checks heartbeats.

    The guardian is a separate process that checks the heartbeats of the node.  The time in which
    the node itself could not run is not included, because a pause of the whole machine affects
    both processes.
    """

    def __init__(self) -> None:
        self._count: int | None = None
        self._checked = self._silent = 0.0

    def reset(self) -> None:
        """
        Forget how long the guardian was silent; the next call of ``is_frozen`` measures again.

        The guardian is a separate process that checks the heartbeats of the node.  Call this at
        the end of a drive, because no heartbeats are sent until the next drive.
        """
        self._count = None

    def is_frozen(self, now: float, count: int) -> bool:
        """
        Return whether the guardian process has checked no heartbeat for GUARDIAN_TIMEOUT.

        :param now: the time [s]
        :param count: how often the guardian has checked heartbeats; this number restarts at 0
            after 255
        """
        if count == self._count:
            self._silent += min(now - self._checked, 2.0 * CHECK_PERIOD)
        else:
            self._count, self._silent = count, 0.0
        self._checked = now
        return self._silent > GUARDIAN_TIMEOUT
