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
"""The layout of text tables: columns, cut texts, and the rows that a long table leaves out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from itertools import pairwise
import os
from typing import NamedTuple

from kachaka_simple_control.control.output import STDOUT
from kachaka_simple_control.text import cut, pluralize, width_of

#: The widest table: what most terminals show without breaking lines.
WIDEST = 99
#: Between two columns.
SPACE = '  '

Row = tuple[str, ...]


def terminal_columns() -> int | None:
    """Return how wide standard output is [columns]; None if it is no terminal, or does not say."""
    try:
        return os.get_terminal_size(STDOUT).columns or None
    except OSError:
        return None


def columns(
        head: Sequence[tuple[str, str]], rows: Sequence[Row], rule_above_last: bool = False,
        widest: int = WIDEST, spare: Sequence[int] = ()) -> list[str]:
    """
    Lay out a table; columns that are empty throughout are left out.

    Text is aligned to the left, and numbers, whose column has a unit, to the right.  If the table
    is too wide, its spare columns are left out, and then its longest texts are cut.

    :param head: the name and the unit of each column
    :param rows: the cells, as many in each row as there are columns
    :param rule_above_last: whether a line separates the last row from the others
    :param widest: how many columns of text the table may have
    :param spare: the places of columns that it can do without, those to go first in front
    :returns: lines of text: names, units if there are any, a rule, the rows
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

    :param before: the index of the step before them
    :param after: the index of the step after them
    :param again: whether each is a repeat of a step that is shown above
    """

    before: int
    after: int
    again: bool

    @property
    def size(self) -> str:
        """Return how many they are."""
        return pluralize(self.after - self.before - 1, 'step')

    def describe(self, start: str, end: str) -> str:
        """Return how many they are, and from when to when [s]."""
        return (f'{self.size}, from {start} s to {end} s'
                f'{", as above" if self.again else ""}')


def fold(keys: Sequence[Hashable], most: int) -> list[int | Gap]:
    """
    Return what a table of steps shows: if they are many, of repeated ones the first and the last.

    :param keys: what is equal for repeats of a step
    :param most: how many lines the table may have; if folded it has more, its middle is cut out
    :returns: the indices of steps, and gaps between them
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
    """Return for each step which repeat it is, as 1 of 4; empty if it is not repeated."""
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
