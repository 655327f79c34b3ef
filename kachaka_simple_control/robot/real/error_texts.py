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
"""What the robot's error codes mean, as it tells itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
import json
from typing import Any

from kachaka_simple_control.escaping import escaped


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
