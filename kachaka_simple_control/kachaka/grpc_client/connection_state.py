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
"""Results of calls, and what they tell of the connection."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from kachaka_simple_control.control.timing import CONNECTION_TIMEOUT

SUCCESS = 0


class RpcFailure(Enum):
    """Why there is no answer."""

    #: none came in time; the robot may still do what it was asked
    LATE = 'late'
    #: there is no connection
    GONE = 'gone'
    #: the robot does not know this call, or broke down over it
    FAILED = 'failed'


@dataclass(frozen=True)
class RpcResult:
    """
    The robot's answer to one call, or why there is none.

    :param code: the robot's error code, 0 for success; None without an answer
    :param failure: why there is no answer
    :param text: the same for a person
    """

    code: int | None = None
    failure: RpcFailure | None = None
    text: str = ''

    @property
    def is_success(self) -> bool:
        """Whether the robot did as it was asked."""
        return self.code == SUCCESS

    @property
    def got_response(self) -> bool:
        """Whether the robot was there to answer."""
        return self.failure in (None, RpcFailure.FAILED)


class ConnectionEvent(Enum):
    """What became of the link."""

    FOUND = 'found'
    LOST = 'lost'
    BACK = 'back'


class ConnectionState:
    """The link to a robot; tells each change of it once."""

    def __init__(self) -> None:
        """Know of no robot."""
        self.is_up = False
        #: why it was lost last
        self.reason = ''
        #: how often it was lost
        self.losses = 0
        #: when it changed last [s, steady clock]
        self.since = float('nan')
        self._heard_last = float('-inf')
        self._failing_since: float | None = None

    def on_result(self, outcome: RpcResult, begun: float, now: float) -> ConnectionEvent | None:
        """
        Take in how a call ended.

        :param outcome: how
        :param begun: when it began [s, steady clock]
        :param now: the time [s, steady clock]
        :returns: what has changed with it
        """
        if outcome.got_response:
            self._failing_since, self._heard_last = None, now
            return None if self.is_up else self._found(now)
        if self._failing_since is None:
            self._failing_since = begun
        silence = now - max(self._failing_since, self._heard_last)
        is_lost = outcome.failure is RpcFailure.GONE or silence >= CONNECTION_TIMEOUT
        return self._lost(outcome.text, now) if is_lost and self.is_up else None

    def _found(self, now: float) -> ConnectionEvent:
        self.is_up, self.since = True, now
        return ConnectionEvent.BACK if self.losses else ConnectionEvent.FOUND

    def _lost(self, reason: str, now: float) -> ConnectionEvent:
        self.is_up, self.since, self.reason = False, now, reason
        self.losses += 1
        return ConnectionEvent.LOST
