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
"""Cells of text as columns for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
import unicodedata

#: The widest table: what most terminals show without breaking lines.
WIDEST = 99
#: Between two columns.
SPACE = '  '

Row = tuple[str, ...]


def columns(
        head: Sequence[tuple[str, str]], rows: Sequence[Row],
        rule_above_last: bool = False) -> list[str]:
    """
    Lay out a table; columns that are empty throughout are left away.

    Words stand on the left of their column, and figures, whose head has a unit, on the right.  If
    the table is too wide, its longest words are cut.

    :param head: the name and the unit of each column
    :param rows: the cells, as many in each row as there are columns
    :param rule_above_last: whether a line parts the last row from the others
    :returns: lines of text: two of the head, a rule, the rows
    """
    cells = [tuple(name for name, _ in head), tuple(unit for _, unit in head), *rows]
    used = [place for place in range(len(head)) if any(row[place] for row in cells)]
    widths = [max(_width(row[place]) for row in cells) for place in used]
    for _ in range(sum(widths) + len(SPACE) * (len(widths) - 1) - WIDEST):
        widths[widths.index(max(widths))] -= 1
    lines = [SPACE.join(
        _aligned(row[place], width, bool(head[place][1]) or _is_number(row[place]))
        for place, width in zip(used, widths)).rstrip() for row in cells]
    rule = SPACE.join('-' * width for width in widths)
    lines.insert(2, rule)
    if rule_above_last and len(rows) > 1:
        lines.insert(-1, rule)
    return lines


def _is_number(text: str) -> bool:
    return text.isdecimal()


def one_line(text: str, width: int) -> str:
    """
    Return a text from a file so that it stands in one line.

    :param text: a name, of any length, with any characters
    :param width: how many columns there are for it
    :returns: the text, with an ellipsis if it is longer
    """
    line = ' '.join(text.split())
    return _cut(''.join(sign if sign.isprintable() else '?' for sign in line), width)


def _cut(text: str, width: int) -> str:
    if _width(text) <= width:
        return text
    end = len(text)
    while end and _width(text[:end]) > width - 3:
        end -= 1
    return text[:end] + '...'


def _aligned(text: str, width: int, right: bool) -> str:
    text = _cut(text, width)
    pad = ' ' * (width - _width(text))
    return pad + text if right else text + pad


def _width(text: str) -> int:
    # Chinese and Japanese letters are twice as wide as others, and marks go on top of them.
    return sum(
        0 if unicodedata.combining(sign) else 1 + (unicodedata.east_asian_width(sign) in 'WF')
        for sign in text)
