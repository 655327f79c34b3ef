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
"""What a guardian makes of what it hears; pure, told the time."""

from __future__ import annotations

from enum import Enum

from kachaka_simple_control.control.timing import (
    HEARTBEAT_TIMEOUT,
    PUBLISH_TIMEOUT,
    REST_TIMEOUT,
    WATCHDOG_PERIOD,
)

TIME_TOLERANCE = 1e-6


class GuardianMessage(bytes, Enum):
    """What a node tells its guardian, a byte each."""

    #: publish one zero and say so: the robot's reader is being met
    PRIME = b'p'
    #: a run is on, and its thread is alive
    BEAT = b'b'
    #: the run is over, a zero of its end or of the stop is sent, and more will follow
    REST = b'r'
    #: the whole stop was sent: nothing to do if the node ends now
    STOPPED = b's'


class Watchdog:
    """
    Decides when the guardian stops the robot: once, and never after the node's own whole stop.

    From the first sign of a run to the last zero of its stop, the node must go on showing signs.

    Silence counts only while the guardian itself is awake.  A machine that stands still for a
    moment holds up node and guardian alike, and is no reason to end a healthy run; what the robot
    got meanwhile, the node looks at by itself.  Nor is a node silent that waits for DDS: while
    somebody joins the graph, publishing was seen to take a third of a second.

    :param silence: how long a run may show no sign of life [s]
    """

    def __init__(self, silence: float = HEARTBEAT_TIMEOUT) -> None:
        """Watch over a node that has not moved anything."""
        self._silence = self._allowed = silence
        self._silent = 0.0
        self._stalled = 0.0
        self._looked: float | None = None
        self._unstopped = False
        #: whether nothing is left to do: the process may end
        self.is_over = False

    def on_message(self, sign: bytes, now: float) -> None:
        """
        Take note of a sign.

        :param sign: one byte
        :param now: when it was heard [s]
        """
        if sign == GuardianMessage.BEAT or (sign == GuardianMessage.REST and self._unstopped):
            self._looked, self._silent, self._stalled = now, 0.0, 0.0
            self._allowed = self._silence if sign == GuardianMessage.BEAT else REST_TIMEOUT
            self._unstopped = True
        elif sign == GuardianMessage.STOPPED:
            self._unstopped, self._looked = False, None

    def on_disconnect(self) -> bool:
        """
        Take note that the node is gone, or that the guardian is to go.

        :returns: whether the robot must be stopped now
        """
        must_stop = self._unstopped
        self._unstopped, self._looked, self.is_over = False, None, True
        return must_stop

    def has_timed_out(self, now: float, sending: bool = False) -> bool:
        """
        Tell, once, that a run or its stop fell silent; asked after each patience without a sign.

        :param now: the time [s]
        :param sending: whether the node is awake, and handing a message to DDS
        :returns: whether the robot must be stopped now
        """
        if self._looked is None:
            return False
        awake = min(now - self._looked, WATCHDOG_PERIOD)
        self._looked = now
        if sending:
            self._stalled += awake
        else:
            self._silent += awake
        # A difference of floats may leave a sliver, which no wait would ever make up for.
        if (self._silent < self._allowed - TIME_TOLERANCE
                and self._stalled < PUBLISH_TIMEOUT - TIME_TOLERANCE):
            return False
        self._unstopped, self._looked = False, None
        return True

    def timeout(self) -> float | None:
        """
        Return how long to wait for the next sign.

        :returns: the time after which to ask ``has_timed_out`` [s]; None for ever
        """
        return None if self._looked is None else min(WATCHDOG_PERIOD, self._allowed - self._silent)
