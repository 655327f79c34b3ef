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
"""The robot's error codes, their texts, and diagnostics made of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
import json
import math
from typing import Any

from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.kachaka.grpc_client.connection_state import ConnectionState

SUCCESS = 0
#: The robot's own codes, in pf-robotics/kachaka-api: error_code.hpp of the bridge for the first,
#: docs/api/ERROR_HANDLING.md for the others.
ERROR_NO_MANUAL_CONTROL = 13151
ERROR_NO_FURNITURE = 14606
ERROR_PAUSED = 21051
#: Ours, chosen: below 0 there are none of the robot's, whose full list is not published.
ERROR_NOT_A_VELOCITY = -1
ERROR_CANCELLED = -2
ERROR_STUCK = -3
ERROR_UNKNOWN_NAME = -4
ERROR_OUT_OF_RANGE = -5
ERROR_NOTHING_TO_DO = -6

#: Code, kind (one of the robot's), and what it says, in our words.
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


class Level(IntEnum):
    """How bad something is; the numbers are those of ``diagnostic_msgs``."""

    OK = 0
    WARN = 1
    ERROR = 2


#: The robot's own kinds of errors that are less than errors; every other kind is one.
LEVELS = {'Ignore': Level.OK, 'Warn': Level.WARN}


@dataclass(frozen=True)
class ErrorText:
    """
    What an error is.

    :param title: its name
    :param description: more of it
    :param level: how bad it is
    """

    title: str
    description: str = ''
    level: Level = Level.ERROR


class ErrorTexts:
    """The robot's list of errors."""

    def __init__(self, text: str = '') -> None:
        """
        Read the list.

        :param text: what GetRobotErrorCodeJson answers: JSON, a list of objects; anything else
            counts as an empty list, for a robot that cannot explain itself can drive
        """
        self._texts = dict(_entries(text))

    def __len__(self) -> int:
        """Return how many errors are known."""
        return len(self._texts)

    def find(self, code: int) -> ErrorText:
        """
        Return what is known of an error.

        :param code: its code
        :returns: its text, which may be empty
        """
        return self._texts.get(code, ErrorText(''))

    def describe(self, code: int) -> str:
        """
        Say in one line what an error is.

        :param code: its code
        :returns: code and title, with the description if there is one
        """
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
                _either(entry, 'title'), _either(entry, 'description'),
                LEVELS.get(str(entry.get('error_type')), Level.ERROR))


def _either(entry: dict[str, Any], key: str) -> str:
    """Return a text in English if the robot has it, else in its own language; in one line."""
    value = entry.get(f'{key}_en') or entry.get(key) or ''
    return escaped(' '.join(str(value).split()).rstrip('.'))


#: A robot that takes longer to answer than this [s] leaves little of its hold.
SLOW = 0.15


@dataclass(frozen=True)
class DiagnosticEntry:
    """
    One entry of diagnostics.

    :param level: how bad it is
    :param name: of what
    :param message: how it is
    :param values: more of it
    """

    level: Level
    name: str
    message: str
    values: dict[str, str] = field(default_factory=dict)


def link_status(
        link: ConnectionState, address: str, round_trip: float, dropped: int,
        now: float) -> DiagnosticEntry:
    """
    Return how the link is.

    :param link: the link
    :param address: of the robot
    :param round_trip: how long the robot took to answer a velocity last [s]; NaN for never
    :param dropped: how many velocities gave way to newer ones, or grew too old
    :param now: the time [s, steady clock]
    :returns: the entry
    """
    values = {'address': address, 'times lost': str(link.losses),
              'velocities dropped': str(dropped)}
    if not math.isnan(round_trip):
        values['last answer to a velocity after [ms]'] = f'{1e3 * round_trip:.1f}'
    if not link.is_up:
        since = '' if math.isnan(link.since) else f' for {now - link.since:.0f} s'
        return DiagnosticEntry(Level.ERROR, 'link', f'lost{since}: {link.reason}', values)
    if round_trip > SLOW:
        text = f'slow: the robot answered after {1e3 * round_trip:.0f} ms'
        return DiagnosticEntry(Level.WARN, 'link', text, values)
    return DiagnosticEntry(Level.OK, 'link', 'up', values)


def robot_status(
        link: ConnectionState, codes: Sequence[int], texts: ErrorTexts) -> DiagnosticEntry:
    """
    Return what is wrong with the robot.

    :param link: the link, without which nothing is known of it
    :param codes: the errors that it reports
    :param texts: what they mean
    :returns: the entry
    """
    if not link.is_up:
        return DiagnosticEntry(Level.ERROR, 'robot', 'unknown: the link is lost')
    if not codes:
        return DiagnosticEntry(Level.OK, 'robot', 'no errors')
    return DiagnosticEntry(
        max(texts.find(code).level for code in codes), 'robot',
        '; '.join(texts.describe(code) for code in codes),
        {str(code): texts.find(code).title for code in codes})
