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
Find and read YAML files of limited size, and return their values with line numbers.

Tested by test/files/test_hostile_files.py.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from importlib.resources import files
import math
import os
from pathlib import Path
import re
import stat
from typing import Any

from kachaka_simple_control.files.document import (
    Document,
    format_path,
    INSTALL,
    is_path,
    MAX_PROBLEMS,
    Node,
    PACKAGE,
    Problem,
    UnreadableFileError,
)
from kachaka_simple_control.files.schema_check import Schema
from kachaka_simple_control.files.wording import nearest, wide_lines
from kachaka_simple_control.motion.units import DIGITS, point_advice
from kachaka_simple_control.text import quoted

SUFFIX = '.yaml'
#: The largest file that is read [bytes].
MAX_BYTES = 1_000_000
#: The characters that YAML forbids, and the line breaks that editors do not count as lines.
_UNPRINTABLE = re.compile(
    '[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]')
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


#: For each class of errors, the message for a file that cannot be read.  The first class that the
#: error belongs to counts.
_REASONS: dict[type[Exception], str] = {
    FileNotFoundError: 'there is no such file',
    IsADirectoryError: 'this is a folder; name a file in it',
    PermissionError: 'you are not allowed to read this file',
    ValueError: 'no file can have this name',
    OSError: 'it cannot be read: {0.strerror}'}


def names_in(folder: str) -> list[str]:
    """Return the sorted names of the YAML files in a folder of the package, without ``.yaml``."""
    found = (entry.name for entry in files(PACKAGE).joinpath(folder).iterdir())
    return sorted(name.removesuffix(SUFFIX) for name in found if name.endswith(SUFFIX))


def look_up(
        name_or_path: str | os.PathLike[str], folder: str, known: list[str]) -> tuple[str, str]:
    """
    Read a file of this package by its name, or any file by its path.

    :param name_or_path: a text without dots and slashes is a name; any other value is a path
    :param known: all names that the error message lists if there is no file of the given name
    :raises UnreadableFileError: if there is no such file, or it cannot be read
    """
    name = os.fspath(name_or_path)
    if not isinstance(name_or_path, str) or is_path(name):
        return name, read_text(name)
    if name not in names_in(folder):
        is_here = Path(name + SUFFIX).is_file()
        near = f'./{name}{SUFFIX}' if is_here else nearest(name, known)
        raise UnreadableFileError(Problem(
            f'there is no {folder.removesuffix("s")} of this name'
            f'{f"; did you mean {near!r}?  Known are" if near else "; known are"} '
            f'{", ".join(known)}; a file of your own is named by its path, as in ./mine{SUFFIX}'))
    entry = files(PACKAGE) / folder / (name + SUFFIX)
    return str(entry), decode(entry.read_bytes())


def read_text(path: str | os.PathLike[str]) -> str:
    """
    Read a file in UTF-8, and return its text.

    :raises UnreadableFileError: if the file cannot be read, is larger than 1 MB, or is not in
        UTF-8
    """
    return decode(read_bytes(path, MAX_BYTES))


def decode(data: bytes) -> str:
    """
    Decode the bytes of a file as UTF-8, and return the text.

    :raises UnreadableFileError: if the bytes are not UTF-8, or are more than 1 MB
    """
    if len(data) > MAX_BYTES:
        raise UnreadableFileError(_too_large(MAX_BYTES))
    if data.startswith(_UTF_16):
        raise UnreadableFileError(Problem('this is text in UTF-16; save it as UTF-8'))
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise UnreadableFileError(Problem(
            f'byte {data[error.start]:#04x} is not UTF-8; is this a text, saved as UTF-8?',
            line=data.count(b'\n', 0, error.start) + 1)) from None


def require_text(text: str) -> str:
    """
    Check the length and the characters of a text, and return the text unchanged.

    :param text: the text of a file; a byte order mark is allowed, because some editors write it
    :raises UnreadableFileError: if the text is longer than 1 MB, or contains control characters or
        other characters that are not allowed
    """
    # Check the number of characters first, so that a very long text is not encoded.
    if len(text) > MAX_BYTES or len(text.encode(errors='surrogatepass')) > MAX_BYTES:
        raise UnreadableFileError(_too_large(MAX_BYTES))
    found = _UNPRINTABLE.search(text)
    if found:
        raise UnreadableFileError(Problem(
            f'U+{ord(found[0]):04X} cannot be in a text; is this one, saved as UTF-8?',
            line=text.count('\n', 0, found.start()) + 1))
    return text


def read_bytes(path: str | os.PathLike[str], limit: int) -> bytes:
    """
    Read a file of a limited size [bytes].

    :raises UnreadableFileError: if it cannot be read, or is larger
    """
    # Open without blocking: a pipe waits for its other end, and a device may never end.
    try:
        with open(path, 'rb',
                  opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise UnreadableFileError(Problem('this is a device or a pipe, not a file'))
            data = file.read(limit + 1)
    except (OSError, ValueError) as error:
        text = next(text for kind, text in _REASONS.items() if isinstance(error, kind))
        raise UnreadableFileError(Problem(text.format(error))) from None
    if len(data) > limit:
        raise UnreadableFileError(_too_large(limit))
    return data


def _too_large(limit: int) -> Problem:
    return Problem(f'this is more than {limit} bytes, the most that is read')


def read_document(text: str, schema: Schema) -> Document:
    """
    Read a YAML text, and check its values against a JSON Schema.

    :param schema: a JSON Schema, Draft 7
    :raises UnreadableFileError: if the text is empty, too long or not YAML, if PyYAML or
        jsonschema is not installed, or if there are too many problems
    """
    try:
        document = parse_yaml(require_text(text))
        document.check(schema)
    except UnreadableFileError as error:
        raise UnreadableFileError(*_wide(text) or error.problems) from None
    if document.problems and (wide := _wide(text)):
        raise UnreadableFileError(*wide)
    return document


def _wide(text: str) -> list[Problem]:
    """Return problems with full-width lines; what else is wrong follows from them."""
    return [Problem(f'full-width: write `{line}`', number) for number, line in wide_lines(text)]


#: The largest allowed number of characters of a number; the longest float needs 24.
MAX_NUMBER = 100
_WORDS: dict[str, bool | None] = {
    **dict.fromkeys(('', '~', 'null', 'Null', 'NULL')),
    'true': True, 'True': True, 'TRUE': True, 'false': False, 'False': False, 'FALSE': False}
_NUMBER = re.compile(f'[-+]?{DIGITS}')
_INTEGER = re.compile('[-+]?[0-9]{1,15}')
_LEADING_ZERO = re.compile('[-+]?0[0-9]+')
_NOT_FINITE = re.compile(r'[-+]?[.]?(inf(inity)?|nan)', re.IGNORECASE)


class ScalarError(ValueError):
    """A number in a YAML text is not allowed; the message says why."""


def resolve(word: str) -> bool | int | float | str | None:
    """
    Convert an unquoted YAML word to its value: None, a bool, a finite number or text.

    The rules are those of YAML 1.2: ``1e3`` is a number; ``yes``, ``on`` and ``1:30`` are text.

    :param word: the word as written in the file
    :raises ScalarError: if the word is a number that is not finite, has more than MAX_NUMBER
        characters, or has a leading zero (some YAML parsers read 010 as the octal number 8)
    """
    if word in _WORDS:
        return _WORDS[word]
    if _NOT_FINITE.fullmatch(word):
        raise ScalarError(f'{word} is not a finite number')
    if not _NUMBER.fullmatch(word):
        return word
    if len(word) > MAX_NUMBER:
        raise ScalarError(f'this number has {len(word)} characters; {MAX_NUMBER} are enough')
    if _LEADING_ZERO.fullmatch(word):
        raise ScalarError(
            f'{quoted(word)} has a leading zero, which makes it octal for some readers; '
            'leave the zero out')
    number = int(word) if _INTEGER.fullmatch(word) else float(word)
    if not math.isfinite(number):
        raise ScalarError(f'{quoted(word)} is too large a number')
    return number


#: The largest number of values and keys in a file.
MAX_VALUES = 100_000
#: The largest nesting depth of values; a step within 20 nested repeats has depth 64.
MAX_DEPTH = 70


def parse_yaml(text: str) -> Document:
    """
    Parse a YAML text, and return its values with their line numbers.

    :returns: the values, and the problems found in single values
    :raises UnreadableFileError: if the text is empty, is not YAML, or has too many values, or if
        PyYAML is not installed
    """
    try:
        import yaml
    except ImportError:
        raise UnreadableFileError(Problem(INSTALL)) from None
    # The loader in C is 15 times faster; some builds of PyYAML do not have it.
    loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
    reader = _YamlReader(yaml.parse(text, Loader=loader))
    try:
        # Only a text of comments has characters, but no values.
        return reader.document(is_empty=not text.strip('\ufeff \t\r\n'))
    except yaml.YAMLError as error:
        raise UnreadableFileError(*reader.problems, _not_yaml(error, text)) from None


#: Advice for common YAML errors.  The keys are patterns for the messages of PyYAML and of its C
#: library.
_YAML_ADVICE = {
    "expected key|expected '-'|expected <block end>|indentation":
        'this line does not belong to those above; indent it as they are, and close all quotes',
    'mapping values are not allowed':
        "no ':' can be here; indent this line as those above, or put the text in quotes",
    "expected ':'": "a key is followed by ': '",
}


def _not_yaml(error: Any, text: str) -> Problem:
    mark: Any = (
        getattr(error, 'problem_mark', None) or getattr(error, 'context_mark', None))
    reason = getattr(error, 'problem', None) or getattr(error, 'context', None) or 'no reason'
    for pattern, advice in _YAML_ADVICE.items():
        if re.search(pattern, reason):
            reason = advice
    if 'end of stream' in reason and 'quoted' in (getattr(error, 'context', None) or ''):
        # The end of the file says less than the quote that is open there.
        mark, reason = error.context_mark, 'close the quote that begins here'
    lines = re.split('\r\n|\r|\n', text)[mark.line:mark.line + 1] if mark else []
    found = ''.join(lines)[mark.column:mark.column + 1] if mark else ''
    if found == '\t' and not ''.join(lines)[:mark.column].strip():
        reason = 'a tab indents this line; indent with spaces'
    elif 'cannot start any token' in reason and found:
        advice = 'indent with spaces' if found == '\t' else 'put the text in quotes'
        reason = f'nothing can begin with {quoted(found)} here; {advice}'
    return Problem(
        f'this is not YAML: {" ".join(reason.split())}', line=mark.line + 1 if mark else None)


def _resolve(event: Any) -> tuple[Any, str | None]:
    """
    Return the value of a scalar, and the error message if the scalar is invalid.

    :returns: two objects: the value, and None.  If the scalar is invalid, they are None and the
        error message
    """
    try:
        event.value.encode()
        return (event.value if event.style else resolve(event.value)), None
    except ScalarError as error:
        return None, str(error)
    except UnicodeEncodeError:
        return None, 'half a character, as in \\ud83d, cannot be in a text'


def _decoration(event: Any) -> str | None:
    """
    Return an error message if a value is an alias, or has an anchor or a tag; otherwise None.

    These features of YAML are not allowed in the files of this package.
    """
    anchor: str | None = getattr(event, 'anchor', None)
    tag: str | None = getattr(event, 'tag', None)
    if _kind(event) == 'Alias':
        return f'aliases such as {quoted(f"*{anchor}")} are not read; write it out'
    if anchor is not None:
        return f'anchors such as {quoted(f"&{anchor}")} are not read; leave it out'
    return None if tag is None else f'tags such as {quoted(tag)} are not read; leave it out'


class _YamlReader:
    """Builds the values of a YAML document, with line numbers, from PyYAML's events."""

    def __init__(self, events: Iterator[Any]) -> None:
        self.problems: list[Problem] = []
        self._events = events
        #: the mappings and lists that contain the next value, and the path of that value
        self._open: list[Node] = []
        self._path: list[str | int] = []
        self._count = 0
        #: the last value that has a key: its mapping, its key and its event
        self._last: tuple[Node, str, Any] | None = None

    def document(self, is_empty: bool) -> Document:
        root: Node | None = None
        for event in self._events:
            if root is not None and _kind(event) == 'DocumentStart':
                raise self._given_up('a second document begins here; a file has one', _line(event))
            if _kind(event) in ('Scalar', 'Alias', 'MappingStart', 'SequenceStart'):
                root = self._value(event)
        if root is None and not is_empty:
            root = Node(1, {})
        if root is None or (root.data is None and not self.problems):
            raise UnreadableFileError(Problem('the file is empty'))
        return Document(root, self.problems, self._count)

    def _value(self, event: Any) -> Node:
        """Read a value and all values nested in it, and return the value."""
        kind, line = _kind(event), _line(event)
        self._count_one(line)
        node = Node(line, {'MappingStart': {}, 'SequenceStart': []}.get(kind))
        objection = _decoration(event)
        if kind == 'Scalar' and not objection:
            node.data, objection = _resolve(event)
        if objection:
            node.is_bad = node.has_problem = True
            self._object(line, objection)
        if kind in ('MappingStart', 'SequenceStart'):
            self._open.append(node)
            if len(self._open) > MAX_DEPTH:
                raise self._given_up(f'lists and keys are nested more than {MAX_DEPTH} deep', line)
            self._read_within(node)
            self._open.pop()
        return node

    def _read_within(self, parent: Node) -> None:
        """Read all values in a mapping or a list, and store them in it."""
        for event in self._events:
            if _kind(event) in ('MappingEnd', 'SequenceEnd'):
                return
            is_decimals = _kind(event) == 'Scalar' and self._takes_decimals(event)
            if isinstance(parent.data, dict):
                self._read_entry(parent, event, is_decimals)
            elif not is_decimals:
                self._path.append(len(parent.data))
                node = parent.children[len(parent.data)] = self._value(event)
                self._path.pop()
                parent.data.append(node.data)

    def _read_entry(self, mapping: Node, event: Any, is_decimals: bool) -> None:
        """
        Read a key and its value, and store them in a mapping.

        Nothing is stored if the mapping already has the key, or if ``is_decimals`` is true.
        """
        line = _line(event)
        if _kind(event) != 'Scalar':
            raise self._given_up('a key must be a word', line)
        key = event.value
        is_twice = key in mapping.data
        self._path.append(key)
        if not is_decimals:
            self._count_one(line)
            if is_twice:
                first = mapping.children[key].line
                self._object(line, f'this key is here twice, first in line {first}')
            elif objection := _decoration(event):
                self._object(line, objection)
        event = next(self._events)
        node = self._value(event)
        self._path.pop()
        if not is_twice and not is_decimals:
            node.line = line
            mapping.children[key], mapping.data[key] = node, node.data
            self._last = mapping, key, event

    def _takes_decimals(self, event: Any) -> bool:
        """
        Detect a number with a decimal comma, as in ``{forward: 0,5 m}``, and record a problem.

        For YAML a comma ends a value, so the part ``5 m`` is a separate scalar.

        :returns: whether the scalar is the part after a decimal comma
        """
        if self._last is None or event.style:
            return False
        mapping, key, number = self._last
        value, end, start = mapping.children[key], number.end_mark, event.start_mark
        is_next = (end.line, end.index + 1) == (start.line, start.index)
        if not is_next or not isinstance(value.data, int) or value.is_bad:
            return False
        text = f'{number.value},{event.value}'
        advice = point_advice(text)
        if advice is None:
            return False
        self._count_one(_line(event))
        value.is_bad = value.has_problem = mapping.has_problem = True
        parent = self._open[-1]
        # In ``[forward: 0,5 m]`` the mapping has ended; it is the last item of the list.
        place = [key] if parent is mapping else [len(parent.data) - 1, key]
        self._object(_line(event), f'{quoted(text)}; {advice}', *place)
        return True

    def _object(self, line: int, text: str, *within: str | int) -> None:
        for parent in self._open:
            parent.has_problem = True
        self.problems.append(Problem(text, line, format_path([*self._path, *within])))
        if len(self.problems) >= MAX_PROBLEMS:
            raise UnreadableFileError(*self.problems)

    def _count_one(self, line: int) -> None:
        self._count += 1
        if self._count > MAX_VALUES:
            raise self._given_up(f'there are more than {MAX_VALUES} values and keys', line)

    def _given_up(self, text: str, line: int) -> UnreadableFileError:
        return UnreadableFileError(*self.problems, Problem(text, line))


def _kind(event: Any) -> str:
    return type(event).__name__.removesuffix('Event')


def _line(event: Any) -> int:
    return int(event.start_mark.line) + 1
