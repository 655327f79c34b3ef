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
Read motions from YAML files, with their parameters and the motions that they include.

Tested by test/files/test_motion_reader.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from operator import itemgetter
import os
from pathlib import PurePath
from types import MappingProxyType
from typing import Any

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.amounts import Amount
from kachaka_simple_control.files.document import (
    beside,
    format_path,
    is_path,
    KeyPath,
    MotionFileError,
    Problem,
    UnreadableFileError,
)
from kachaka_simple_control.files.expressions import evaluate
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.motion_schema import motion_schema
from kachaka_simple_control.files.parameters import (
    assign,
    Given,
    Parameter,
    read_parameters,
    Value,
)
from kachaka_simple_control.files.step_reader import StepReader
from kachaka_simple_control.files.yaml_document import (
    look_up,
    MAX_VALUES,
    names_in,
    read_document,
    read_text,
)
from kachaka_simple_control.motion.include import Include
from kachaka_simple_control.motion.limits import LIMIT_QUANTITIES
from kachaka_simple_control.motion.plan import MAX_STEPS
from kachaka_simple_control.motion.step_base import Step
from kachaka_simple_control.motion.steps import MAX_INCLUDES, Motion
from kachaka_simple_control.motion.units import FREQUENCY, TOLERANCE, UnitError
from kachaka_simple_control.text import location, quoted

#: The largest number of files that a motion includes; with other values a file counts again.
MAX_FILES = 100
#: Returns the path and the text of a motion that a file includes.  It gets the path of the file,
#: and the name or the path that is written in it, and raises an UnreadableFileError.
Finder = Callable[[str, str], tuple[str, str]]


def find_included(source: str, name_or_path: str) -> tuple[str, str]:
    """Find a motion of the package, or a file beside the one that includes it: a ``Finder``."""
    if not is_path(name_or_path):
        return look_up(name_or_path, 'motions', names_in('motions'))
    path = os.path.normpath(beside(source, name_or_path))
    return path, read_text(path)


def load(path: str | os.PathLike[str]) -> MotionFile:
    """
    Read a motion from a file.

    :raises MotionFileError: if the file cannot be read or contains no valid motion; the message
        has a line for each problem
    """
    source = os.fspath(path)
    with MotionFileError.naming(source):
        text = read_text(source)
    return loads(text, source)


def loads(
        text: str, name: str = 'motion', values: Mapping[str, Given] | None = None,
        find: Finder = find_included) -> MotionFile:
    """
    Read a motion from the text of a YAML file.

    :param name: the path of the file, for error messages and for the files that it includes.  If
        the text does not name the motion, the file name without its suffix is also the name of
        the motion
    :param values: the values of its parameters by name, as text or in SI units
    :param find: finds the motions that it includes
    :raises MotionFileError: if the text is no valid motion; the message has a line for each
        problem
    """
    given = {} if values is None else dict(values)
    with MotionFileError.naming(name):
        reading = _Reading(_Reader(find), name, text)
        amounts, problems = assign(reading.parameters, given)
        for parameter, problem in problems.items():
            reading.add_problem_of(parameter, problem)
        file = reading.file(amounts)
    return replace(file, values=MappingProxyType({
        parameter: file.parameters[parameter].value(value).text
        for parameter, value in given.items()}))


def read_all_parameters(text: str) -> tuple[Parameter, ...]:
    """Return the parameters of the text of a motion that may be invalid; none if it is no YAML."""
    try:
        return tuple(_Reading(_Reader(find_included), '', text).parameters.values())
    except UnreadableFileError:
        return ()


@dataclass
class _Reader:
    """The state that all files of one motion share while they are read."""

    find: Finder
    #: the files that are being read, each included by the one before it
    stack: list[_Reading] = field(default_factory=list)
    #: the path, the text and the real path of each include, by the path of the file that has it
    found: dict[tuple[str, str], tuple[str, str, str]] = field(default_factory=dict)
    #: each file that was included, by its path and the values that an include gives
    readings: dict[tuple[object, ...], _Reading] = field(default_factory=dict)
    #: the motion of each, by its path and all its values; None if it is invalid
    known: dict[tuple[object, ...], MotionFile | None] = field(default_factory=dict)
    #: the number of values and keys in all files
    size: int = 0
    #: the number of steps of each block that was counted
    counts: dict[int, int] = field(default_factory=dict)

    def find_once(self, source: str, name: str) -> tuple[str, str, str]:
        """Return the path, the text and the real path of what a file includes by a name."""
        if (source, name) not in self.found:
            path, text = self.find(source, name)
            self.found[source, name] = path, text, self.identity(path)
        return self.found[source, name]

    def identity(self, path: str) -> str:
        """Return a path that is equal for all paths of a file."""
        # Texts of another place than the disk are not what links on the disk say.
        return _real_path(path) if self.find is find_included else os.path.normpath(path)

    def count(self, steps: tuple[Step, ...]) -> int:
        """
        Count steps; one in a block counts as often as it is driven, and the block counts, too.

        For example, a loop that drives two steps three times counts as 1 + 3 * 2 = 7 steps.
        """
        total = self.counts.get(id(steps))
        if total is None:
            blocks = (step.block() for step in steps)
            total = self.counts[id(steps)] = sum(
                1 if block is None else 1 + block[0] * self.count(block[1]) for block in blocks)
        return total


class _Reading:
    """
    One file that is being read.

    :raises UnreadableFileError: if the text is no YAML, or too large
    """

    def __init__(
            self, reader: _Reader, source: str, text: str, file_id: str | None = None) -> None:
        self.source = source
        self.file_id = reader.identity(source) if file_id is None else file_id
        self._reader, self._text = reader, text
        self.document = document = read_document(text, motion_schema())
        reader.size += document.size
        if reader.size > MAX_VALUES:
            raise UnreadableFileError(Problem(
                f'with this file there are more than {MAX_VALUES} values and keys'))
        self._data = document.root.data if isinstance(document.root.data, dict) else {}
        self.parameters = read_parameters(document)
        numbers = document.read_quantities([], {'rate': FREQUENCY})
        #: what all files of a motion must say alike
        self.settings: dict[str, Any] = {
            'robot': _robot(self._data.get('robot'), source), 'rate': numbers.get('rate'),
            'closed_loop': self._data.get('closed_loop'), 'watch': self._data.get('watch'),
            **{f'limits.{name}': value for name, value in document.read_quantities(
                ['limits'], LIMIT_QUANTITIES).items()}}
        self._included: dict[str, MotionFile] = {}
        #: the path of the step that includes the file that is read next
        self.place: KeyPath = ()

    def add_problem_of(self, parameter: str, text: str) -> None:
        """Record a problem with the value that a parameter was given."""
        if parameter in self.parameters:
            self.document.add_problem(['parameters', parameter], text)
        else:
            self.document.problems.append(Problem(text))

    def file(self, values: Mapping[str, Amount | None]) -> MotionFile:
        """
        Return the motion.

        :param values: the value of each parameter; None if it is invalid
        :raises UnreadableFileError: if there are problems, with all of them
        """
        document = self.document
        document.values = values
        self._reader.stack.append(self)
        try:
            steps = StepReader(document, self._include).steps(['steps'])
        finally:
            self._reader.stack.pop()
        corners = document.read_quantities([], {'corners': TOLERANCE}).get('corners')
        if not document.problems and (count := self._reader.count(steps)) > MAX_STEPS:
            document.add_problem(
                ['steps'], f'{count} steps, with all repeats; at most {MAX_STEPS} are read')
        if document.problems or document.root.has_problem:
            raise UnreadableFileError(*document.problems)
        data, settings = self._data, self.settings
        motion = Motion(
            data.get('name', PurePath(self.source).stem), steps, data.get('description', ''),
            0.0 if corners is None else corners)
        return MotionFile(
            motion, self.source, settings['robot'],
            MappingProxyType({name.removeprefix('limits.'): value
                              for name, value in settings.items() if name.startswith('limits.')}),
            settings['rate'], settings['closed_loop'], settings['watch'], corners,
            MappingProxyType(self.parameters), included=MappingProxyType(self._included),
            root=document.root, text=self._text)

    def _include(self, path: KeyPath) -> Include | None:
        """Return the step that drives another file."""
        document = self.document
        data = document.root.at(path).data
        name = data if isinstance(data, str) else data.get('motion')
        if name is None:
            document.add_problem(path, 'give `motion: `, or `steps:`')
            return None
        if extra := [key for key in ('name', 'corners') if isinstance(data, dict) and key in data]:
            document.add_problem([*path, extra[0]], 'only with `steps:`; the motion has its own')
        place = path if isinstance(data, str) else [*path, 'motion']
        self.place = path
        file = self._included_file(place, name, self._given([*path, 'with']))
        if file is None:
            document.add_problems(path)
            return None
        self._included[format_path(path)] = file
        try:
            return Include(file.motion.steps, file.motion.name, file.corners)
        except InvalidMotionError as error:
            document.add_error(path, error)
            return None

    def _given(self, path: KeyPath) -> dict[str, Value | None]:
        """Return the values that an include gives; None for one that is invalid."""
        document = self.document
        nodes = document.root.along(path)
        given: dict[str, Value | None] = {}
        if len(nodes) <= len(path):
            return given
        for name, node in nodes[-1].children.items():
            text = str(node.data)
            try:
                amount = evaluate(text, document.values)
            except UnitError as error:
                document.add_problem([*path, name], str(error))
                amount = None
            given[str(name)] = None if amount is None else Value(
                amount, f'{quoted(text)}: {amount}' if '$' in text else text)
        return given

    def _included_file(
            self, path: KeyPath, name: str,
            given: Mapping[str, Value | None]) -> MotionFile | None:
        """Return a file that this one includes; None if it is invalid, with recorded problems."""
        document, reader = self.document, self._reader
        try:
            source, text, file_id = reader.find_once(self.source, name)
        except UnreadableFileError as error:
            document.add_problem(path, f'{quoted(name, 100)}: {error.problems[0].text}')
            return None
        if self._is_cycle(file_id):
            return None
        if len(reader.stack) > MAX_INCLUDES:
            document.add_problem(path, f'it is included more than {MAX_INCLUDES} deep')
            return None
        line = document.root.at(path).line
        given_key = (file_id, *sorted(given.items(), key=itemgetter(0)))
        reading = reader.readings.get(given_key)
        if reading is None and len(reader.readings) >= MAX_FILES:
            document.add_problem(path, f'more than {MAX_FILES} files are included')
            return None
        try:
            if reading is None:
                reading = reader.readings[given_key] = _Reading(
                    reader, source, text, file_id)
            values = self._assigned(reading, given)
            key = (file_id, *sorted(values.items(), key=itemgetter(0)))
            if key not in reader.known:
                reader.known[key] = None
                reader.known[key] = reading.file(values)
        except UnreadableFileError as error:
            document.add_problems(path, [
                problem.within(source, self.source, line) for problem in error.problems])
            return None
        file = reader.known[key]
        if file is not None:
            self._require_alike(reading, line)
        return file

    def _assigned(
            self, reading: _Reading,
            given: Mapping[str, Value | None]) -> dict[str, Amount | None]:
        """Return the values of the parameters of an included file, and record what is wrong."""
        document, path = self.document, self.place
        values, problems = assign(reading.parameters, {
            name: value for name, value in given.items() if value is not None})
        for name, text in problems.items():
            if name in given and given[name] is None:
                continue
            parameter = reading.parameters.get(name)
            where = f' ({location(reading.source, parameter.line)})' if parameter else ''
            place = [*path, 'with', name] if name in given else path
            document.add_problem(place, f'{text}{where}' if name in given else (
                f'{name!r} is missing: {text}{where}'))
        return values

    def _is_cycle(self, file_id: str) -> bool:
        """Return whether a file is being read already; a problem is recorded where it begins."""
        files = [reading.file_id for reading in self._reader.stack]
        if file_id not in files:
            return False
        first, *others = self._reader.stack[files.index(file_id):]
        way = [reading.source for reading in (first, *others, first)]
        first.document.add_problem(first.place, ' includes '.join(way))
        return True

    def _require_alike(self, reading: _Reading, line: int | None) -> None:
        """Check that an included file has no settings that this file does not have."""
        for name, value in reading.settings.items():
            own = self.settings.get(name)
            if value is not None and value != own:
                says = 'does not say it' if own is None else f'says {own}'
                node = reading.document.root.at(name.split('.'))
                shown = str(node.data).lower() if isinstance(value, bool) else node.data
                problem = Problem(
                    f'{shown}; {self.source}, which includes this file, {says}: both must '
                    'say the same', node.line, name)
                self.document.add_problems(
                    self.place, [problem.within(reading.source, self.source, line)])


def _real_path(path: str) -> str:
    try:
        return os.path.realpath(path)
    except ValueError:
        return path


def _robot(name_or_path: object, source: str) -> str | None:
    """Return the name of a motion file's robot, or the path of its profile; None if none."""
    return beside(source, name_or_path) if isinstance(name_or_path, str) else None
