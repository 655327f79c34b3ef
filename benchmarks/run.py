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
"""The scales of a run; save its results, write them into a documentation page, show progress."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timezone
import json
from pathlib import Path
import sys
from typing import Any

from benchmarks import ROOT

RESULTS = ROOT / 'benchmarks' / 'results'
BEGIN = '<!-- measured: written by make bench, changes here are lost -->'
END = '<!-- measured: end -->'


@dataclass(frozen=True)
class Scale:
    """
    The number of measurements of each kind.

    :param loaded: the number of 1 s movements of each loop on a loaded machine, by rate [Hz]
    :param together: the number of starts of a program that drives several robots, by their number
    """

    moves: dict[int, int]
    loaded: dict[int, int]
    busy: int
    turn: int
    starts: int
    killed: int
    others: int
    signals: int
    firsts: int
    late: int
    together: dict[int, int]
    plans: tuple[int, ...]


FULL = Scale(
    moves={10: 50, 20: 50, 50: 50, 100: 50, 200: 5, 500: 5, 1000: 5},
    loaded={10: 5, 100: 5}, busy=2, turn=10, starts=20, killed=20, others=6, signals=200,
    firsts=6, late=3, together={1: 20, 2: 10, 10: 10}, plans=(360, 3600, 36000))
#: The scale for a short run, and for continuous integration.
QUICK = Scale(
    moves={10: 4, 100: 4, 1000: 1},
    loaded={100: 2}, busy=2, turn=2, starts=3, killed=2, others=1, signals=10,
    firsts=1, late=1, together={1: 3, 2: 2, 10: 2}, plans=(360, 3600))


def today() -> str:
    """Return today's date in UTC, for example ``2026-01-31``."""
    return f'{datetime.now(timezone.utc):%Y-%m-%d}'


def measured_on(run: dict[str, Any]) -> str:
    """Return the sentence that says when and where a run was measured."""
    return f'Measured on {run["date"]}: ' + ', '.join(
        value if name in ('processor', 'kernel', 'packages') else
        f'{value} cores' if name == 'cores' else f'{name} {value}'
        for name, value in run['machine'].items()) + '.'


def save(run: dict[str, Any], name: str) -> Path:
    """Write a run to a new file whose name starts with ``name``; return its path."""
    file = RESULTS / f'{name}-{datetime.now(timezone.utc):%Y%m%d-%H%M%S}.json'
    file.write_text(json.dumps(run, indent=1) + '\n')
    return file


def write_measured(page: Path, measured: str, begin: str = BEGIN, end: str = END) -> None:
    """
    Replace the part of a page between two marker lines.

    :raises ValueError: if the page does not have exactly one such part
    """
    page.write_text(updated(page.read_text(), measured, begin, end))


def updated(page: str, measured: str, begin: str = BEGIN, end: str = END) -> str:
    """
    Return a page with a new part between two marker lines.

    :raises ValueError: if the page does not have exactly one such part
    """
    if page.count(begin) != 1 or page.count(end) != 1 or page.index(end) < page.index(begin):
        raise ValueError(f'the page must have one line {begin!r} and one line {end!r} after it')
    head, _, rest = page.partition(begin)
    _, _, tail = rest.partition(end)
    return f'{head}{begin}\n\n{measured.strip()}\n\n{end}{tail}'


def show(text: str, number: int, count: int) -> None:
    """Print a text with number and count, in place on a terminal; elsewhere only at the end."""
    if sys.stdout.isatty():
        print(f'\r{text}: {number} of {count}', end='' if number < count else '\n', flush=True)
    elif number == count:
        print(f'{text}: {count}', flush=True)
