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
"""The robot's error codes and their texts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import json
from typing import Any

from kachaka_simple_control.telemetry.diagnosis import Level
from kachaka_simple_control.text import escaped

SUCCESS = 0
#: Codes of the real robot, from pf-robotics/kachaka-api: the first from error_code.hpp of the
#: bridge, the others from docs/api/ERROR_HANDLING.md.
ERROR_NO_MANUAL_CONTROL = 13151
ERROR_NO_FURNITURE = 14606
ERROR_PAUSED = 21051
#: Chosen for the simulated robot: the full list is not published, but has no codes below 0.
ERROR_NOT_A_VELOCITY = -1
ERROR_CANCELLED = -2
ERROR_STUCK = -3
ERROR_UNKNOWN_NAME = -4
ERROR_OUT_OF_RANGE = -5
ERROR_NOTHING_TO_DO = -6

#: The list of the simulated robot: code, type (with the robot's type names), our own text.
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

#: The level of each error type below an error; all other types are errors.
LEVELS = {'Ignore': Level.OK, 'Warn': Level.WARN}


@dataclass(frozen=True)
class ErrorText:
    """
    The text of an error code; empty if the code is unknown.

    :param title: the name of the error
    :param description: details
    :param level: the severity level
    """

    title: str
    description: str = ''
    level: Level = Level.ERROR


class ErrorTexts:
    """
    The error texts of the robot, by error code.

    :param text: the JSON of GetRobotErrorCodeJson, a list of objects; other text counts as an
        empty list, because a robot without error texts can still drive
    """

    def __init__(self, text: str = '') -> None:
        self._texts = dict(_entries(text))

    def find(self, code: int) -> ErrorText:
        """Return the text of an error code; empty if the code is unknown."""
        return self._texts.get(code, ErrorText(''))

    def describe(self, code: int) -> str:
        """Return code, title and description of an error in one line, as far as known."""
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
    """Return the English text if there is one, else the robot's language; in one line."""
    value = entry.get(f'{key}_en') or entry.get(key) or ''
    return escaped(' '.join(str(value).split()).rstrip('.'))
