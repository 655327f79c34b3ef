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
Store the values of a YAML file with their line numbers, and collect the problems in the file.

A JSON Schema defines which values a file may have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
import json
import os
from pathlib import PurePath
import re
from typing import Any, TypeVar

from kachaka_simple_control.errors import ControlError, InvalidMotionError
from kachaka_simple_control.files.amounts import Amount
from kachaka_simple_control.files.expressions import compute, compute_count
from kachaka_simple_control.files.schema_check import compile_schema, Schema
from kachaka_simple_control.files.schema_messages import messages
from kachaka_simple_control.motion.units import Quantity, UnitError
from kachaka_simple_control.text import location, quoted

#: The largest number of problems that an error message shows.
MAX_LINES = 20
#: After this many problems the rest of a file is not checked.
MAX_PROBLEMS = 200
#: The longest file name that an error message shows in full [characters].
MAX_NAME = 300
#: The error message if PyYAML or jsonschema is not installed.
INSTALL = (
    'to read files, PyYAML and jsonschema are needed: pip install PyYAML jsonschema, or '
    'sudo apt install python3-yaml python3-jsonschema')
PACKAGE = 'kachaka_simple_control'
_Number = TypeVar('_Number', int, float)
#: The path of a value in a file: the keys of mappings and the indices of lists that lead to it.
KeyPath = Sequence[str | int]
_PLAIN_KEY = re.compile(r'[\w-]{1,40}')
_STEP = re.compile(r'[.]?\bsteps\[([0-9]+)\](?:[.]|$)')
_PART = re.compile(r'\[([0-9]+)\]|([^.\[\]]+)')


@dataclass(frozen=True)
class Problem:
    """
    One problem in a file, such as a wrong value, with its place in the file.

    :param line: the line number of the problem, counted from 1; None if no line is known
    :param path: the keys and list indices that lead to the wrong value, as in
        ``steps[2].turn.speed``; empty if the problem is not about a certain value
    :param source: the file, if another one includes it; None for the file that was read
    :param included_by: the places that include the file, the nearest first: file and line
    """

    text: str
    line: int | None = None
    path: str = ''
    source: str | None = None
    included_by: tuple[tuple[str, int | None], ...] = ()

    def __str__(self) -> str:
        """
        Return the path and the description of the problem, as in ``step 3: turn.speed: ...``.

        The text counts steps from 1, so ``steps[2]`` in the path becomes ``step 3``.  The text
        does not contain the line number.
        """
        place = _STEP.sub(
            lambda found: f'{": " * (found[0][0] == ".")}step {int(found[1]) + 1}: ', self.path)
        return f'{place.removesuffix(": ")}: {self.text}' if place else self.text

    def describe(self, source: str) -> str:
        """
        Return the problem with its place, as in ``square.yaml:7: step 3: turn: ...``.

        :param source: the file that was read
        """
        places = ', '.join(location(_short(file), line) for file, line in self.included_by)
        included = f' (included by {places})' if places else ''
        return f'{location(_short(self.source or source), self.line)}: {self}{included}'

    @property
    def line_read(self) -> int | None:
        """Return the line in the file that was read: that of its include, or of the problem."""
        return self.included_by[-1][1] if self.included_by else self.line

    def within(self, source: str, by: str, line: int | None) -> Problem:
        """Return the problem of a file as one of the file that includes it."""
        return replace(self, source=self.source or source,
                       included_by=(*self.included_by, (by, line)))


class UnreadableFileError(Exception):
    """
    A file or a text cannot be read; this error does not know the name of the file.

    ``FileError.naming()`` replaces this error by an error whose message contains the name.

    :ivar problems: the problems found in the file, at least one
    """

    def __init__(self, *problems: Problem) -> None:
        super().__init__(*problems)
        self.problems = problems


class FileError(ControlError):
    """
    A file cannot be read or used.

    The message has one line for each of the first MAX_LINES problems in the file.

    :ivar problems: the problems found in the file, sorted by line, without duplicates
    """

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        self.source = source
        distinct = dict.fromkeys(problems)
        self.problems = tuple(sorted(distinct, key=lambda problem: [
            line or 0 for _, line in (*reversed(problem.included_by), ('', problem.line))]))
        # Of several problems, the first may be about no line of the file.
        self.begins_with_line = len(self.problems) > 1 or any(
            problem.line is not None for problem in self.problems)
        super().__init__(format_problems(source, self.problems))

    @classmethod
    @contextmanager
    def naming(cls, source: str) -> Iterator[None]:
        """
        Return a context manager that adds a file name to an ``UnreadableFileError``.

        If the ``with`` block raises an ``UnreadableFileError``, an error of this class is raised
        instead.  Its message contains the file name.
        """
        try:
            yield
        except UnreadableFileError as error:
            raise cls(source, error.problems) from None


class MotionFileError(FileError, InvalidMotionError):
    """A motion cannot be read from a file or written to a file, or a robot cannot drive it."""


def format_problems(source: str, problems: Sequence[Problem]) -> str:
    """
    Return an error message with one line for each problem in a file.

    A line of the message is, for example, ``square.yaml:7: step 3: turn: ...``.  Only the first
    MAX_LINES problems are shown.  If there are more, a last line says how many.

    :param problems: the problems, in the order in which the message shows them
    """
    lines = [problem.describe(source) for problem in problems[:MAX_LINES]]
    more = len(problems) - len(lines)
    many = 'many' if len(problems) >= MAX_PROBLEMS else more
    return '\n'.join([*lines, *([f'{_short(source)}: and {many} more'] if more else [])])


def _short(source: str) -> str:
    is_short = source and source.isprintable() and len(source) <= MAX_NAME
    return source if is_short else quoted(source, MAX_NAME)


def is_path(name_or_path: str) -> bool:
    """
    Return whether a text is the path of a file, and not a name.

    A text with a dot or a slash is a path.  Any other text is the name of a motion or of a robot
    that comes with the package.
    """
    return bool(set(name_or_path) & {'.', '/', os.sep})


def beside(source: str, name_or_path: str) -> str:
    """
    Return a name, or a path that a file contains as it is seen by the program.

    A relative path in a file starts at the folder of the file.

    :param source: the path of the file
    """
    if not is_path(name_or_path) or PurePath(name_or_path).is_absolute():
        return name_or_path
    # Join as text: PurePath removes a leading ./, and without it the text is a name.
    return f'{PurePath(source).parent}/{PurePath(name_or_path)}'


def format_path(path: KeyPath) -> str:
    """Return a path of keys and list indices as text, as in ``steps[2].turn.speed``."""
    parts = [f'[{part}]' if isinstance(part, int) else f'.{_key(part)}' for part in path]
    return ''.join(parts).removeprefix('.')


def parse_path(path: str) -> KeyPath:
    """Convert a text such as ``steps[2].turn.speed`` to a list of keys and list indices."""
    return [key or int(index) for index, key in _PART.findall(path)]


def _key(key: str) -> str:
    return key if _PLAIN_KEY.fullmatch(key) else quoted(key)


@dataclass(eq=False)
class Node:
    """
    A value in a file, with its line number and its nested values.

    :param line: the line number of the key of the value, counted from 1; for a value without a
        key, the line in which the value begins
    :param data: the value: a dict, list, str, int, float, bool or None
    :param children: the values in a mapping, by key, or in a list, by index; empty for any other
        value
    :param is_bad: whether a problem with this value was found while the YAML text was parsed
    :param has_problem: whether any problem was found with this value or with a value nested in it
    """

    line: int
    data: Any
    children: dict[str | int, Node] = field(default_factory=dict)
    is_bad: bool = False
    has_problem: bool = False

    def along(self, path: KeyPath) -> list[Node]:
        """
        Return a list of all values on a path that leads from this value to a nested value.

        The list begins with this value.  It ends early if the rest of the path does not exist.
        """
        found = [self]
        for part in path:
            if part not in found[-1].children:
                break
            found.append(found[-1].children[part])
        return found

    def at(self, path: KeyPath) -> Node:
        """
        Return the nested value to which a path leads.

        If there is no such value, return the last value on the path that exists.
        """
        return self.along(path)[-1]


@dataclass(eq=False)
class Document:
    """
    The values of a file, and the problems found in the file.

    :param problems: the problems, in the order in which they were found
    :param size: the number of values and keys
    :ivar values: the parameters by which expressions are computed, by name, each None if it is
        invalid; None if the file cannot have expressions
    """

    root: Node
    problems: list[Problem] = field(default_factory=list)
    size: int = 0
    values: Mapping[str, Amount | None] | None = None

    def check(self, schema: Schema) -> None:
        """
        Compare the values with a JSON Schema, and record a problem for each forbidden value.

        :param schema: a JSON Schema, Draft 7
        :raises UnreadableFileError: if jsonschema is not installed, or the number of problems
            reaches MAX_PROBLEMS
        """
        try:
            from jsonschema import Draft7Validator
        except ImportError:
            raise UnreadableFileError(Problem(INSTALL)) from None
        if compile_schema(schema)(self.root.data):
            return
        for error in Draft7Validator(schema).iter_errors(self.root.data):
            for part, message in messages(error):
                self.add_problem(
                    [*error.absolute_path, *([] if part is None else [part])], message)

    def add_problem(self, path: KeyPath, text: str) -> None:
        """
        Add a problem to the list ``problems``.

        Nothing is added if the value at ``path`` already had a problem when the YAML text was
        parsed.

        :raises UnreadableFileError: if the number of problems reaches MAX_PROBLEMS
        """
        nodes = self.root.along(path)
        if len(nodes) > len(path) and nodes[-1].is_bad:
            return
        self.add_problems(path, [Problem(text, nodes[-1].line, format_path(path))])

    def add_problems(self, path: KeyPath, problems: Iterable[Problem] = ()) -> None:
        """
        Add problems because of which a value is invalid; none if they are known already.

        :raises UnreadableFileError: if the number of problems reaches MAX_PROBLEMS
        """
        self.problems += problems
        for node in self.root.along(path):
            node.has_problem = True
        if len(self.problems) >= MAX_PROBLEMS:
            raise UnreadableFileError(*self.problems)

    def add_error(self, path: KeyPath, error: InvalidMotionError) -> None:
        """
        Add a problem that describes an error, for example a value out of range.

        :param error: the error; ``error.name`` is the key of the wrong value in this mapping, or
            None if the error is about the whole mapping
        """
        self.add_problem([*path, *parse_path(error.name or '')], error.message)

    def read_quantity(self, path: KeyPath, quantity: Quantity) -> float | None:
        """
        Read a value such as ``90 deg`` from the file; return it as a number in its SI unit.

        If the value is invalid, record a problem and return None.
        """
        def read(text: str) -> float | None:
            return quantity.parse(text) if self.values is None else compute(
                text, quantity, self.values)
        return self._read(path, read, float)

    def read_count(self, path: KeyPath, largest: int) -> int | None:
        """
        Read a whole number from 0 to a largest value, or an expression that results in one.

        If the value is invalid, record a problem and return None.
        """
        def read(text: str) -> int | None:
            count = compute_count(text, self.values)
            if count is not None and not 0 <= count <= largest:
                raise UnitError(f'{quoted(text)} is {count}; it must be from 0 to {largest}')
            return count
        return self._read(path, read, int)

    def _read(
            self, path: KeyPath, read: Callable[[str], _Number | None],
            convert: Callable[[Any], _Number]) -> _Number | None:
        value = self.root.at(path).data
        try:
            number = read(value) if isinstance(value, str) else convert(value)
        except UnitError as error:
            self.add_problem(path, str(error))
            return None
        if number is None:
            self.add_problems(path)  # that of the parameter
        return number

    def read_quantities(
            self, path: KeyPath, quantities: Mapping[str, Quantity]) -> dict[str, float]:
        """
        Read values with units from a mapping; return a dict of numbers in SI units.

        The dict does not contain missing and invalid values.
        """
        node = self.root.at(path)
        numbers = {
            key: self.read_quantity([*path, key], quantity) for key, quantity in quantities.items()
            if key in node.children and not node.children[key].has_problem}
        return {key: number for key, number in numbers.items() if number is not None}


@cache
def read_schema(path: str) -> Schema:
    """
    Read a JSON Schema file of this package, and return the schema.

    :param path: the path of the file in the package, as in ``motions/motion.schema.json``
    """
    from importlib.resources import files
    schema: Schema = json.loads(files(PACKAGE).joinpath(path).read_text('utf-8'))
    return schema
