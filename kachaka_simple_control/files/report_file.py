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
"""Read the file ``run.json`` of a report, and the motion that it keeps, to drive or compare it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
import json
import os
from typing import Any

from kachaka_simple_control.files.document import (
    MotionFileError,
    Problem,
    UnreadableFileError,
)
from kachaka_simple_control.files.included_texts import find_among
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.parameters import Given, Value
from kachaka_simple_control.files.yaml_document import read_bytes
from kachaka_simple_control.motion.drive_order import MotionText

SUFFIX = '.json'
#: Increases when a field is removed or changes its meaning; new fields may be added at any time.
FORMAT = 1
#: The largest file that is read [bytes].
MAX_BYTES = 100_000_000
OTHER_FILES = 'their files differ'


def read_json(path: str | os.PathLike[str]) -> Any:
    """
    Read a JSON file.

    :raises UnreadableFileError: if it cannot be read, is too large, or is not JSON
    """
    try:
        return json.loads(read_bytes(path, MAX_BYTES))
    except json.JSONDecodeError as error:
        problem = Problem(f'this is not JSON: {error.msg}', error.lineno)
        raise UnreadableFileError(problem) from None
    except (ValueError, RecursionError):
        raise UnreadableFileError(Problem('this is not JSON')) from None


class RecordedMotion(MotionText):
    """The file of a motion that is read again from a report."""

    def read(self, values: Mapping[str, Given] | None = None) -> MotionFile:
        """
        Read the motion from the texts alone, whatever the files are now.

        :param values: other values of its parameters
        :raises MotionFileError: if a value is wrong, or this version cannot read the motion
        """
        return loads(self.text, self.source, {**self.values, **(values or {})},
                     find_among(self.included))

    def difference(self, other: RecordedMotion) -> str | None:
        """
        Return in what another motion differs, as in ``side is 1 m and 2 m``; None if in nothing.

        Files that say the same in other words do not differ.
        """
        if replace(self, source='') == replace(other, source=''):
            return None
        try:
            first, second = self.read(), other.read()
        except MotionFileError:  # written for another version, or PyYAML is missing
            return OTHER_FILES
        if replace(first.motion, description='') == replace(second.motion, description=''):
            return None
        return ', '.join(_other_values(first, second)) or OTHER_FILES


def _other_values(one: MotionFile, other: MotionFile) -> Iterator[str]:
    """Yield each parameter that has another value, with both values."""
    for name in one.parameters:
        if name in other.parameters:
            first, second = _value(one, name), _value(other, name)
            if first.amount.value != second.amount.value:
                yield f'{name} is {first.text} and {second.text}'


def _value(file: MotionFile, name: str) -> Value:
    parameter = file.parameters[name]
    value = parameter.value(file.values[name]) if name in file.values else parameter.default
    assert value is not None
    return value


def recorded_motion(data: Mapping[str, Any]) -> RecordedMotion | None:
    """
    Return the motion file that the report of a robot keeps; None for a drive without one.

    :raises UnreadableFileError: if the report was edited
    """
    kept = data.get('motion_file')
    if kept is None:
        return None
    # Reports of earlier versions have neither values nor included texts.
    texts: dict[str, Any] = {'values': {}, 'included': {}}
    texts |= kept if isinstance(kept, dict) else {}
    for name, kind in (('source', str), ('text', str), ('values', dict), ('included', dict)):
        value = texts.get(name)
        parts = value.values() if isinstance(value, dict) else ()
        if not isinstance(value, kind) or not all(isinstance(part, str) for part in parts):
            raise UnreadableFileError(Problem('its motion_file was edited'))
    return RecordedMotion(texts['source'], texts['text'], texts['values'], texts['included'])


def motion_of_report(data: object) -> RecordedMotion:
    """
    Return the motion file that the content of a JSON file keeps.

    :raises UnreadableFileError: if this is no report of a robot that drove the motion of a file
    """
    if not isinstance(data, dict) or not {'format', 'verdict'} <= data.keys():
        raise UnreadableFileError(Problem('this is not the run.json of a report'))
    if 'fleet' in data:
        raise UnreadableFileError(Problem(
            'this is the report of a fleet; only that of one robot has one motion'))
    if data['format'] != FORMAT:
        raise UnreadableFileError(Problem('this is the report of another version'))
    motion = recorded_motion(data)
    if motion is None:
        raise UnreadableFileError(Problem(
            'this is the report of the lesson, which has no file: name `lesson`'
            if data.get('title') == 'lesson' else
            'this drive had no motion from a file, or several'))
    return motion
