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
"""What is wrong with a file: one line each, with the place for a person to go to."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import re

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.escaping import quoted

#: How many lines a person is shown.
MAX_LINES = 100
#: After so many problems the rest of a file is not looked at.
MAX_PROBLEMS = 1000
#: How much of the name of a file they are shown [characters].
MAX_NAME = 300
#: What is said to whom a library is missing.
INSTALL = (
    'to read files, PyYAML and jsonschema are needed: pip install PyYAML jsonschema, or '
    'sudo apt install python3-yaml python3-jsonschema')
#: The way to a place in a file: keys of mappings and indices of lists.
KeyPath = Sequence[str | int]
_PLAIN_KEY = re.compile(r'[\w-]{1,40}')
_PART = re.compile(r'\[([0-9]+)\]|([^.\[\]]+)')


@dataclass(frozen=True)
class Problem:
    """
    One thing that is wrong with a file.

    :param text: what it is, in one line
    :param line: where, counted from 1; None if it is the file itself
    :param path: the place within the file, as in ``steps[2].turn.speed``; empty if there is none
    """

    text: str
    line: int | None = None
    path: str = ''

    def __str__(self) -> str:
        """Return the problem without its place in the file."""
        return f'{self.path}: {self.text}' if self.path else self.text


class UnreadableFileError(Exception):
    """A file cannot be used; for the readers of motions and robots to say in their own error."""

    def __init__(self, *problems: Problem) -> None:
        """
        Keep what is wrong.

        :param problems: at least one
        """
        super().__init__(*problems)
        self.problems = problems


class MotionFileError(InvalidMotionError):
    """
    A motion could not be read from a file; the text has a line for each thing that is wrong.

    :ivar source: which file
    :ivar problems: what is wrong with it, in the order of its lines
    """

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        """
        Say what is wrong with a file.

        :param source: which file
        :param problems: what is wrong with it
        """
        self.source = source
        self.problems = sort_problems(problems)
        super().__init__(format_problems(source, self.problems))


def sort_problems(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """
    Return problems in the order of their lines, each once.

    :param problems: in any order
    :returns: in order
    """
    return tuple(sorted(dict.fromkeys(problems), key=lambda problem: problem.line or 0))


def format_problems(source: str, problems: Sequence[Problem]) -> str:
    """
    Return what a person is told.

    :param source: the file
    :param problems: what is wrong with it, in order
    :returns: a line for each, as in ``square.yaml:7: steps[2].turn: ...``
    """
    is_short = source and source.isprintable() and len(source) <= MAX_NAME
    name = source if is_short else quoted(source, MAX_NAME)
    lines = [f'{location(name, problem.line)}: {problem}' for problem in problems[:MAX_LINES]]
    more = len(problems) - len(lines)
    many = 'many' if len(problems) >= MAX_PROBLEMS else more
    return '\n'.join([*lines, *([f'{name}: and {many} more'] if more else [])])


def location(source: str, line: int | None) -> str:
    """
    Return where a line is, so that terminals and editors make a link of it.

    :param source: the file
    :param line: the line, counted from 1; None for the file itself
    :returns: the place
    """
    return source if line is None else f'{source}:{line}'


def format_path(way: KeyPath) -> str:
    """
    Return the way to a place as people write it.

    :param way: keys and indices
    :returns: as in ``steps[2].turn.speed``
    """
    parts = [f'[{part}]' if isinstance(part, int) else f'.{_key(part)}' for part in way]
    return ''.join(parts).removeprefix('.')


def parse_path(path: str) -> KeyPath:
    """
    Return the way to a place that was written by :func:`dotted`.

    :param path: as in ``steps[2].turn.speed``
    :returns: keys and indices
    """
    return [key or int(index) for index, key in _PART.findall(path)]


def _key(key: str) -> str:
    return key if _PLAIN_KEY.fullmatch(key) else quoted(key)
