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
"""Parts of a page: tables and lists, with all that comes from outside escaped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
import math

from kachaka_simple_control.report.preview import fixed

#: What stands where nothing is known.
NOTHING = '-'


def text(value: object) -> str:
    """
    Return something from outside so that a page shows it as it is.

    :param value: anything
    :returns: its text, escaped
    """
    return escape(str(value))


def head(cells: Iterable[tuple[str, str]]) -> str:
    """
    Return the head of a table.

    :param cells: the name of each column, and its unit if its cells are numbers
    :returns: the element
    """
    return '<thead><tr>' + ''.join(
        f'<th scope="col" class="n">{text(name)}<small>{text(unit)}</small></th>' if unit else
        f'<th scope="col">{text(name)}</th>' for name, unit in cells) + '</tr></thead>'


def numbers(cells: Iterable[str]) -> str:
    """
    Return cells with numbers.

    :param cells: what stands in them, already escaped
    :returns: the elements
    """
    return ''.join(f'<td class="n">{cell}</td>' for cell in cells)


def named(values: Mapping[str, object], caption: str) -> str:
    """
    Return a table of names and values from outside.

    :param values: the values by name
    :param caption: what it shows
    :returns: the element
    """
    rows = ''.join(f'<tr><th scope="row">{text(name)}</th><td>{text(value)}</td></tr>'
                   for name, value in values.items())
    return f'<table class="plain"><caption>{text(caption)}</caption><tbody>{rows}</tbody></table>'


def words(meanings: Mapping[str, str]) -> str:
    """
    Return a list of what words mean.

    :param meanings: what they mean, by word
    :returns: the element
    """
    return '<dl class="words">' + ''.join(
        f'<div><dt>{text(word)}</dt><dd>{text(meaning)}</dd></div>'
        for word, meaning in meanings.items()) + '</dl>'


def both(distance: float, angle: float, digits: int = 4) -> str:
    """
    Return a distance above an angle.

    :param distance: in metres or parts of them
    :param angle: [rad]
    :param digits: behind the point of the distance
    :returns: the inside of a cell
    """
    return f'{number(distance, digits)}<small>{degrees(angle)}</small>'


def degrees(angle: float, digits: int = 2) -> str:
    """
    Return an angle for people.

    :param angle: [rad]
    :param digits: how many stand behind the point
    :returns: its text in degrees
    """
    return f'{number(math.degrees(angle), digits)}°'


def number(value: float, digits: int) -> str:
    """
    Return a number.

    :param value: the number
    :param digits: how many stand behind the point
    :returns: its text, or a dash if it is none
    """
    return fixed(value, digits) if math.isfinite(value) else NOTHING
