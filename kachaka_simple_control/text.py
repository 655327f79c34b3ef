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
"""Format text for users: escape unsafe text, format numbers and counts, fit text to a width."""

from __future__ import annotations

import unicodedata

#: The longest printed line of an error [characters]; a path may be long.
MAX_LINE_LENGTH = 1000


def escaped(text: object, max_length: int = 200) -> str:
    r"""
    Return a text as one line that is safe to print on a terminal.

    Line breaks, escape sequences and other unprintable characters are written as in Python
    source: ``\n``, ``\x1b``.

    :param text: the text, of any length
    :param max_length: the largest length of the result [characters]; a longer text is cut and
        ends with three dots
    """
    line = ''.join(
        sign if sign.isprintable() else sign.encode('unicode_escape').decode('ascii')
        for sign in str(text)[:max_length + 1])
    return line if len(line) <= max_length else line[:max_length - 3] + '...'


def escaped_lines(error: BaseException) -> str:
    """
    Return the message of an error in a form that is safe to print on a terminal.

    Unprintable characters are escaped, but line breaks are kept.

    :param error: the error; only the message of an error about a file has several lines
    """
    return '\n'.join(escaped(line, MAX_LINE_LENGTH) for line in str(error).split('\n'))


def quoted(text: str, max_length: int = 40) -> str:
    """
    Return a text in quotes and with escape sequences, as in Python source.

    :param max_length: the largest length of the text before it is escaped [characters]; a longer
        text is cut and ends with three dots
    """
    return repr(text if len(text) <= max_length else text[:max_length - 3] + '...')


def location(source: str, line: int | None) -> str:
    """
    Return a place in a file as ``file:line``, which terminals and editors show as a link.

    :param line: the line number, counted from 1; None to return only the name of the file
    """
    return source if line is None else f'{source}:{line}'


def format_fixed(value: float, digits: int) -> str:
    """Return a number as text with a fixed number of decimal places; zero has no minus sign."""
    return f'{round(value, digits) + 0.0:.{digits}f}'


def pluralize(count: int, singular: str, plural: str | None = None) -> str:
    """
    Return a count with a noun, as in ``1 step`` or ``2 steps``.

    :param plural: the noun in the plural; None to add an s to the singular
    """
    return f'{count} {singular if count == 1 else plural or singular + "s"}'


def one_line(text: str, width: int) -> str:
    """
    Return any text as one printable line, cut to a width.

    Line breaks become spaces, and every unprintable character becomes a question mark.

    :param width: the largest width [columns of a terminal]
    """
    line = ' '.join(text.split())
    return cut(''.join(char if char.isprintable() else '?' for char in line), width)


def cut(text: str, width: int) -> str:
    """Return a text cut to a width [columns of a terminal]; a cut text ends with three dots."""
    if width_of(text) <= width:
        return text
    end = len(text)
    while end and width_of(text[:end]) > width - 3:
        end -= 1
    return text[:end] + '...'


def width_of(text: str) -> int:
    """Return how many columns a text takes up in a terminal."""
    if text.isascii():
        return len(text)
    # Chinese and Japanese characters have double width; combining marks have no width.
    return sum(
        0 if unicodedata.combining(char) else 1 + (unicodedata.east_asian_width(char) in 'WF')
        for char in text)
