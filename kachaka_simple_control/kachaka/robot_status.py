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
Error codes of a Kachaka, results of gRPC calls, state of the connection, diagnostics.

Tested by test/kachaka/grpc_client/test_addresses_and_errors.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
import json
import math
from typing import Any

from kachaka_simple_control.control.diagnosis import Diagnosis, Level
from kachaka_simple_control.control.timing import CONNECTION_TIMEOUT
from kachaka_simple_control.text import escaped

SUCCESS = 0
#: Error codes of the real robot.  Sources in pf-robotics/kachaka-api: error_code.hpp of the bridge
#: for the first code, docs/api/ERROR_HANDLING.md for the other two.
ERROR_NO_MANUAL_CONTROL = 13151
ERROR_NO_FURNITURE = 14606
ERROR_PAUSED = 21051
#: Error codes chosen for the simulated robot.  The full list of the real robot's codes is not
#: published, but it has no codes below 0.
ERROR_NOT_A_VELOCITY = -1
ERROR_CANCELLED = -2
ERROR_STUCK = -3
ERROR_UNKNOWN_NAME = -4
ERROR_OUT_OF_RANGE = -5
ERROR_NOTHING_TO_DO = -6

#: The errors of the simulated robot.  Each entry has the code, the type as the real robot names
#: it, and a text that was written for this package.
TEXTS = (
    (ERROR_NO_MANUAL_CONTROL, 'Error', 'A velocity came while manual control is off'),
    (ERROR_NO_FURNITURE, 'Error', 'The robot carries no furniture'),
    (ERROR_PAUSED, 'Warn', 'The robot is paused; its power button ends that'),
    (ERROR_NOT_A_VELOCITY, 'Error', 'A figure is not a finite number'),
    (ERROR_CANCELLED, 'Ignore', 'The command was cancelled'),
    (ERROR_STUCK, 'Error', 'The robot did not come where it should'),
    (ERROR_UNKNOWN_NAME, 'Error', 'There is no furniture, place or shortcut of that name'),
    (ERROR_OUT_OF_RANGE, 'Error', 'A figure is out of its range'),
    (ERROR_NOTHING_TO_DO, 'Ignore', 'There is nothing to cancel or to go on with'),
)

#: The diagnostic level of the two error types that are not errors.  All other types have the
#: level ``ERROR``.
LEVELS = {'Ignore': Level.OK, 'Warn': Level.WARN}


@dataclass(frozen=True)
class ErrorText:
    """Name, explanation and severity of an error code; empty texts for an unknown one."""

    title: str
    description: str = ''
    level: Level = Level.ERROR


class ErrorTexts:
    """
    The names and explanations of the robot's error codes.

    :param text: the JSON list of GetRobotErrorCodeJson; there are none if it is invalid
    """

    def __init__(self, text: str = '') -> None:
        # Invalid JSON is no error, because a robot without these texts can still drive.
        self._texts = dict(_entries(text))

    def find(self, code: int) -> ErrorText:
        """Return the texts of an error code, which are empty if it is unknown."""
        return self._texts.get(code, ErrorText(''))

    def describe(self, code: int) -> str:
        """Return the code of an error, and its name and explanation if known, as one line."""
        known = self.find(code)
        text = '. '.join(filter(None, (known.title, known.description)))
        return f'error {code} ({text})' if text else f'error {code}'


def _entries(text: str) -> Iterator[tuple[int, ErrorText]]:
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError):
        return
    for entry in entries if isinstance(entries, list) else []:
        if isinstance(entry, dict) and isinstance(entry.get('code'), int):
            yield entry['code'], ErrorText(
                _one_line(entry, 'title'), _one_line(entry, 'description'),
                LEVELS.get(str(entry.get('error_type')), Level.ERROR))


def _one_line(entry: dict[str, Any], key: str) -> str:
    """Return a text of a JSON object as one line without full stop, English if it can."""
    value = entry.get(f'{key}_en') or entry.get(key) or ''
    return escaped(' '.join(str(value).split()).rstrip('.'))


#: A response to a velocity is slow if it takes longer than this time [s].  The time is half of the
#: command timeout.
SLOW_RESPONSE = 0.15


class RpcFailure(Enum):
    """Why a gRPC call has no usable response: too late, no connection, or not executed."""

    #: no response before the deadline; the robot may still execute the call
    LATE = 'late'
    #: no connection
    GONE = 'gone'
    #: the robot responded that it does not know the call, or could not execute it
    FAILED = 'failed'


@dataclass(frozen=True)
class RpcResult:
    """
    The result of one gRPC call: the code in the response, or why there is none.

    :param code: 0 for success, else the robot's error code; None if the call failed
    :param failure: why the call failed; None if there is a code
    :param text: the reason as text for the user; empty if there is a code
    """

    code: int | None = None
    failure: RpcFailure | None = None
    text: str = ''

    @property
    def is_success(self) -> bool:
        """Return whether the robot executed the call and reported no error."""
        return self.code == SUCCESS

    @property
    def got_response(self) -> bool:
        """Return whether the robot responded, even if it reported an error."""
        return self.failure in (None, RpcFailure.FAILED)


class ConnectionEvent(Enum):
    """A change of the connection to the robot: the first one, its loss, or one after a loss."""

    FOUND = 'found'
    LOST = 'lost'
    BACK = 'back'


class ConnectionState:
    """Detects from the results of gRPC calls whether the connection to the robot is up or lost."""

    def __init__(self) -> None:
        self.is_up = False
        #: the reason for the last loss of the connection
        self.reason = ''
        #: the number of losses of the connection
        self.losses = 0
        #: the time of the last change [s, steady clock]
        self.since = math.nan
        self._last_response = -math.inf
        self._failing_since: float | None = None

    def on_result(self, result: RpcResult, begun: float, now: float) -> ConnectionEvent | None:
        """
        Learn from a gRPC call, begun at a time, whether the connection has changed; None if not.

        Any response means that it is up.  It is lost if a call finds no connection, or if calls
        get no response for 1 s.
        """
        if result.got_response:
            self._failing_since, self._last_response = None, now
            if self.is_up:
                return None
            self.is_up, self.since = True, now
            return ConnectionEvent.BACK if self.losses else ConnectionEvent.FOUND
        if self._failing_since is None:
            self._failing_since = begun
        unanswered = now - max(self._failing_since, self._last_response)
        is_lost = result.failure is RpcFailure.GONE or unanswered >= CONNECTION_TIMEOUT
        if not (is_lost and self.is_up):
            return None
        self.is_up, self.since, self.reason = False, now, result.text
        self.losses += 1
        return ConnectionEvent.LOST


def connection_status(
        connection: ConnectionState, address: str, round_trip: float, dropped: int,
        now: float) -> Diagnosis:
    """
    Return a diagnosis of the connection: an error if it is lost, a warning if a call is slow.

    :param round_trip: the duration of the last call that sent a velocity [s]; NaN if there was
        none; slow is above 0.15 s
    """
    values = {'address': address, 'times lost': str(connection.losses),
              'velocities dropped': str(dropped)}
    if not math.isnan(round_trip):
        values['last answer to a velocity after [ms]'] = f'{1e3 * round_trip:.1f}'
    if not connection.is_up:
        since = '' if math.isnan(connection.since) else f' for {now - connection.since:.0f} s'
        return Diagnosis(Level.ERROR, f'lost{since}: {connection.reason}', values)
    if round_trip > SLOW_RESPONSE:
        text = f'slow: the robot answered after {1e3 * round_trip:.0f} ms'
        return Diagnosis(Level.WARN, text, values)
    return Diagnosis(Level.OK, 'up', values)


def robot_status(
        connection: ConnectionState, codes: Sequence[int], texts: ErrorTexts) -> Diagnosis:
    """Return a diagnosis of the errors that the robot reports; unknown without a connection."""
    if not connection.is_up:
        return Diagnosis(Level.ERROR, 'unknown: the link is lost', {})
    if not codes:
        return Diagnosis(Level.OK, 'no errors', {})
    return Diagnosis(
        max(texts.find(code).level for code in codes),
        '; '.join(texts.describe(code) for code in codes),
        {str(code): texts.find(code).title for code in codes})
