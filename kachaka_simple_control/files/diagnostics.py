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
"""Problems of a file, each with its line and its path in the file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import re

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.escaping import quoted

#: How many problems an error message shows.
MAX_LINES = 100
#: After so many problems the rest of a file is not checked.
MAX_PROBLEMS = 1000
#: How much of the name of a file an error message shows [characters].
MAX_NAME = 300
#: The message where a library is missing.
INSTALL = (
    'to read files, PyYAML and jsonschema are needed: pip install PyYAML jsonschema, or '
    'sudo apt install python3-yaml python3-jsonschema')
#: The path of a value in a file: keys of mappings and indices of lists.
KeyPath = Sequence[str | int]
_PLAIN_KEY = re.compile(r'[\w-]{1,40}')
_PART = re.compile(r'\[([0-9]+)\]|([^.\[\]]+)')


@dataclass(frozen=True)
class Problem:
    """
    One thing that is wrong with a file.

    :param text: what it is, in one line
    :param line: its line, counted from 1; None for the file as a whole
    :param path: its path in the file, as in ``steps[2].turn.speed``; empty if there is none
    """

    text: str
    line: int | None = None
    path: str = ''

    def __str__(self) -> str:
        """Return the problem without its line."""
        return f'{self.path}: {self.text}' if self.path else self.text


class UnreadableFileError(Exception):
    """
    A file cannot be used; the readers of motions and robots raise their own errors for it.

    :ivar problems: at least one
    """

    def __init__(self, *problems: Problem) -> None:
        super().__init__(*problems)
        self.problems = problems


class MotionFileError(InvalidMotionError):
    """
    A motion could not be read from a file; the message has a line for each problem.

    :ivar source: the file
    :ivar problems: what is wrong with it, in the order of its lines
    """

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        self.source = source
        self.problems = sort_problems(problems)
        super().__init__(format_problems(source, self.problems))


def sort_problems(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """Return problems in the order of their lines, each once."""
    return tuple(sorted(dict.fromkeys(problems), key=lambda problem: problem.line or 0))


def format_problems(source: str, problems: Sequence[Problem]) -> str:
    """
    Return an error message, with a line for each problem: ``square.yaml:7: steps[2].turn: ...``.

    :param source: the file
    :param problems: what is wrong with it, in order
    """
    is_short = source and source.isprintable() and len(source) <= MAX_NAME
    name = source if is_short else quoted(source, MAX_NAME)
    lines = [f'{location(name, problem.line)}: {problem}' for problem in problems[:MAX_LINES]]
    more = len(problems) - len(lines)
    many = 'many' if len(problems) >= MAX_PROBLEMS else more
    return '\n'.join([*lines, *([f'{name}: and {many} more'] if more else [])])


def location(source: str, line: int | None) -> str:
    """
    Return file and line in the form of which terminals and editors make a link.

    :param source: the file
    :param line: the line, counted from 1; None for the file itself
    """
    return source if line is None else f'{source}:{line}'


def format_path(path: KeyPath) -> str:
    """Return a path as text, as in ``steps[2].turn.speed``."""
    parts = [f'[{part}]' if isinstance(part, int) else f'.{_key(part)}' for part in path]
    return ''.join(parts).removeprefix('.')


def parse_path(path: str) -> KeyPath:
    """Return the path that ``format_path()`` made a text of."""
    return [key or int(index) for index, key in _PART.findall(path)]


def _key(key: str) -> str:
    return key if _PLAIN_KEY.fullmatch(key) else quoted(key)
