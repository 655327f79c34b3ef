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

A JSON Schema defines which values a file may have.  For each value that the schema forbids, this
module writes an error message.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
import json
import os
import re
from typing import Any

from kachaka_simple_control.errors import ControlError, InvalidMotionError
from kachaka_simple_control.files.wording import step_advice
from kachaka_simple_control.motion.units import QUANTITIES, Quantity, UnitError
from kachaka_simple_control.text import location, quoted

#: The largest number of problems that an error message shows.
MAX_LINES = 20
#: After this many problems the rest of a file is not checked.
MAX_PROBLEMS = 10_000
#: The longest file name that an error message shows in full [characters].
MAX_NAME = 300
#: The error message if PyYAML or jsonschema is not installed.
INSTALL = (
    'to read files, PyYAML and jsonschema are needed: pip install PyYAML jsonschema, or '
    'sudo apt install python3-yaml python3-jsonschema')
PACKAGE = 'kachaka_simple_control'
Schema = dict[str, Any]
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
    """

    text: str
    line: int | None = None
    path: str = ''

    def __str__(self) -> str:
        """
        Return the path and the description of the problem, as in ``step 3: turn.speed: ...``.

        The text counts steps from 1, so ``steps[2]`` in the path becomes ``step 3``.  The text
        does not contain the line number.
        """
        place = _STEP.sub(
            lambda found: f'{": " * (found[0][0] == ".")}step {int(found[1]) + 1}: ', self.path)
        return f'{place.removesuffix(": ")}: {self.text}' if place else self.text


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
        self.problems = tuple(sorted(distinct, key=lambda problem: problem.line or 0))
        self.begins_with_line = bool(self.problems) and self.problems[0].line is not None
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
    is_short = source and source.isprintable() and len(source) <= MAX_NAME
    name = source if is_short else quoted(source, MAX_NAME)
    lines = [f'{location(name, problem.line)}: {problem}' for problem in problems[:MAX_LINES]]
    more = len(problems) - len(lines)
    many = 'many' if len(problems) >= MAX_PROBLEMS else more
    return '\n'.join([*lines, *([f'{name}: and {many} more'] if more else [])])


def is_path(name_or_path: str) -> bool:
    """
    Return whether a text is the path of a file, and not a name.

    A text with a dot or a slash is a path.  Any other text is the name of a motion or of a robot
    that comes with the package.
    """
    return bool(set(name_or_path) & {'.', '/', os.sep})


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
    """

    root: Node
    problems: list[Problem] = field(default_factory=list)

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
        for error in Draft7Validator(schema).iter_errors(self.root.data):
            for part, message in _MESSAGES[error.validator](error):
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
        self.problems.append(Problem(text, nodes[-1].line, format_path(path)))
        for node in nodes:
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
        value = self.root.at(path).data
        try:
            return quantity.parse(value) if isinstance(value, str) else float(value)
        except UnitError as error:
            self.add_problem(path, str(error))
            return None

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


def nearest(word: str, known: Mapping[str, Any] | list[str]) -> str | None:
    """Return the known word that is most similar to a given word; None if none is similar."""
    import difflib
    close = difflib.get_close_matches(word.lower(), list(known), n=1)
    return close[0] if close else None


def did_you_mean(word: str, known: Mapping[str, Any] | list[str]) -> str:
    """
    Return advice for a user who wrote an unknown word, as in ``did you mean 'turn'?``.

    If no known word is similar, the advice lists all known words.

    :param word: the unknown word
    :param known: a list of the known words, or a mapping from each known word to its JSON Schema.
        If the schema of a known word lists the unknown word under ``synonyms``, this known word
        is suggested
    """
    parts = known if isinstance(known, Mapping) else {}
    near = next((name for name, part in parts.items()
                 if word.lower() in part.get('synonyms', [])), nearest(word, known))
    return f'did you mean {near!r}?' if near else f'known are {", ".join(known)}'


#: Pairs of a key and a message about its value; the key is None if the message is about the whole
#: value that was checked.
_Messages = Iterator[tuple[str | None, str]]


def _wrong(error: Any) -> _Messages:
    quantity, value = QUANTITIES.get(error.schema.get('quantity')), error.instance
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    text = f'{_shown(value)}; it must be {_expected(error.schema)}'
    if quantity and quantity.needs_unit and is_number:
        text = quantity.without_unit(value)
    elif quantity and isinstance(value, str):
        try:
            quantity.parse(value)
        except UnitError as reason:
            text = str(reason)
    yield None, text


def _enum(error: Any) -> _Messages:
    choices = [str(choice) for choice in error.validator_value]
    yield None, f'{_shown(error.instance)}; it must be {" or ".join(choices)}'


def _unknown(error: Any) -> _Messages:
    known = error.schema['properties']
    if len(error.instance) > error.schema.get('maxProperties', len(error.instance)):
        return  # maxProperties has its own message
    for key in error.instance:
        if key not in known:
            entry = error.schema.get('entry', 'key')
            steps = error.schema.get('definitions', {}).get('step', {}).get('properties', ())
            advice = step_advice(key, error.instance[key]) if entry == 'step' else (
                'it is a step: put it below `steps:`, after `- `' if key in steps else None)
            yield key, advice or f'there is no such {entry}; {did_you_mean(key, known)}'


def _missing(error: Any) -> _Messages:
    for key in error.validator_value:
        if key not in error.instance:
            yield None, missing(key, error.schema)


def missing(key: str, schema: Mapping[str, Any]) -> str:
    """
    Return an error message about a missing key; it says which value the key must have.

    :param schema: the JSON Schema of the mapping that must have the key
    """
    return f'{key!r} is missing: {_expected(schema["properties"][key])}'


def _too_few(error: Any) -> _Messages:
    yield None, f'nothing; it must be {_expected(error.schema)}'


def _number_of_items(error: Any) -> _Messages:
    found = f'a list of {len(error.instance)}' if error.instance else 'an empty list'
    yield None, f'{found}; it must be {_expected(error.schema)}'


def _too_many(error: Any) -> _Messages:
    keys = ' and '.join(quoted(key) for key in list(error.instance)[:3])
    yield None, (f"{keys} in one step; begin each step with '- ', and indent what belongs to it "
                 'by two more')


def _beyond(error: Any) -> _Messages:
    quantity = QUANTITIES.get(error.schema.get('quantity'))
    if quantity and quantity.needs_unit:
        return  # a number without a unit has its own message
    unit = f' {quantity.unit}' if quantity else ''
    bound = f'{_BOUNDS[error.validator]} {error.validator_value}{unit}'
    yield None, f'{error.instance}{unit}; it must be {bound}'


_BOUNDS = {'exclusiveMinimum': 'above', 'maximum': 'at most', 'minimum': 'at least'}
#: For each keyword of JSON Schema, the function that writes the messages about its violation.
_MESSAGES: dict[str, Callable[[Any], _Messages]] = {
    'additionalProperties': _unknown,
    'enum': _enum,
    'maxProperties': _too_many,
    'minProperties': _too_few,
    'required': _missing,
    **dict.fromkeys(('minItems', 'maxItems'), _number_of_items),
    **dict.fromkeys(('pattern', 'type'), _wrong),
    **dict.fromkeys(_BOUNDS, _beyond)}


def _expected(schema: Mapping[str, Any]) -> str:
    quantity = QUANTITIES.get(schema.get('quantity', ''))
    return quantity.wanted if quantity else str(schema['expected'])


def _shown(value: Any) -> str:
    if value is None:
        return 'nothing'
    if isinstance(value, (dict, list)):
        return 'a list' if isinstance(value, list) else 'keys with values'
    return str(value).lower() if isinstance(value, bool) else quoted(value) if isinstance(
        value, str) else repr(value)
