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
"""The layout of text tables: align columns, cut texts, and fold long tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from itertools import pairwise
import os
from typing import NamedTuple

from kachaka_simple_control.control.output import STDOUT
from kachaka_simple_control.text import cut, pluralize, width_of

#: The largest width of a table [columns]; most terminals show it without wrapping.
WIDEST = 99
#: The space between two columns.
SPACE = '  '

Row = tuple[str, ...]


def terminal_columns() -> int | None:
    """Return the width of the terminal [columns]; None if standard output is no terminal."""
    try:
        return os.get_terminal_size(STDOUT).columns or None
    except OSError:
        return None


def columns(
        head: Sequence[tuple[str, str]], rows: Sequence[Row], rule_above_last: bool = False,
        widest: int = WIDEST, spare: Sequence[int] = ()) -> list[str]:
    """
    Lay out a table, without its empty columns.

    Text is left-aligned.  Numbers, and all cells of a column with a unit, are right-aligned.  If
    the table is too wide, spare columns are left out first, then the widest columns are cut.

    :param head: the name and the unit of each column
    :param rows: the rows, with one cell per column
    :param rule_above_last: whether a line separates the last row from the others
    :param widest: the largest width of the table [columns]
    :param spare: the indices of columns that may be left out, in this order
    :returns: lines of text: names, units (if a column has one), a rule, the rows
    """
    units = tuple(unit for _, unit in head)
    cells = [tuple(name for name, _ in head), *([units] if any(units) else []), *rows]
    widths = {place: max(width_of(row[place]) for row in cells)
              for place in range(len(head)) if any(row[place] for row in cells)}
    for place in spare:
        if _total_width(widths) > widest:
            widths.pop(place, None)
    for _ in range(_total_width(widths) - widest):
        widths[max(widths, key=lambda place: widths[place])] -= 1
    lines = [SPACE.join(
        _aligned(row[place], width, bool(units[place]) or row[place].isdecimal())
        for place, width in widths.items()).rstrip() for row in cells]
    rule = SPACE.join('-' * width for width in widths.values())
    lines.insert(len(cells) - len(rows), rule)
    if rule_above_last and len(rows) > 1:
        lines.insert(-1, rule)
    return lines


def _total_width(widths: Mapping[int, int]) -> int:
    return sum(widths.values()) + len(SPACE) * (len(widths) - 1)


def _aligned(text: str, width: int, right: bool) -> str:
    text = cut(text, width)
    pad = ' ' * (width - width_of(text))
    return pad + text if right else text + pad


class Gap(NamedTuple):
    """
    Steps that a table leaves out.

    :param before: the index of the last step before the gap
    :param after: the index of the first step after the gap
    :param again: whether each left-out step repeats a step that is shown above
    """

    before: int
    after: int
    again: bool

    @property
    def size(self) -> str:
        """Return the number of steps in the gap as text, for example '3 steps'."""
        return pluralize(self.after - self.before - 1, 'step')

    def describe(self, start: str, end: str) -> str:
        """Return the number of steps in the gap, and its start and end time [s], as text."""
        return (f'{self.size}, from {start} s to {end} s'
                f'{", as above" if self.again else ""}')


def fold(keys: Sequence[Hashable], most: int) -> list[int | Gap]:
    """
    Choose the steps that a table shows.

    A table with too many steps shows only the first and the last repeat of each step.  If it is
    still too long, its middle is left out.

    :param keys: a key for each step; repeats of a step have equal keys
    :param most: the largest number of lines of the table
    :returns: the indices of the shown steps, and the gaps between them
    """
    kept = _kept(keys, most)
    entries: list[int | Gap] = []
    known: set[Hashable] = set()
    for before, index in pairwise([-1, *kept]):
        if index - before > 1:
            entries.append(Gap(before, index, known.issuperset(keys[before + 1:index])))
        entries.append(index)
        known.add(keys[index])
    return entries


def repeat_labels(keys: Sequence[Hashable]) -> list[str]:
    """Return the repeat label of each step, for example '1 of 4'; empty if it is not repeated."""
    times = Counter(keys)
    so_far: Counter[Hashable] = Counter()
    labels = []
    for key in keys:
        so_far[key] += 1
        labels.append(f'{so_far[key]} of {times[key]}' if times[key] > 1 else '')
    return labels


def _kept(keys: Sequence[Hashable], most: int) -> list[int]:
    if len(keys) <= most:
        return list(range(len(keys)))
    first: dict[Hashable, int] = {}
    last: dict[Hashable, int] = {}
    for index, key in enumerate(keys):
        first.setdefault(key, index)
        last[key] = index
    ends = sorted({*first.values(), *last.values()})
    gaps = sum(two - one > 1 for one, two in pairwise(ends))
    if len(ends) + gaps <= most:
        return ends
    half = (most - 1) // 2
    return [*range(half), *range(len(keys) - half, len(keys))]
