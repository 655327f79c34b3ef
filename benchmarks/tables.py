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
"""The tables of a run, for a terminal and for a documentation page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
import math
from typing import Any, TypeVar

from benchmarks.figures import (
    Figure,
    figures,
    find,
    judge,
    signal_groups,
    ThresholdResult,
    where,
    zeros,
)
from kachaka_simple_control.analysis.message_timing import median
from kachaka_simple_control.text import pluralize

TrialT = TypeVar('TrialT')
NAMES = {
    'ours': 'ours', 'lesson': "the lesson's loop", 'timer': 'rclpy timer', 'rate': 'rclpy Rate',
    'floor': 'the floor'}


@dataclass(frozen=True)
class Table:
    """A table with a title, the names of the columns, and rows of cells."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def text(self) -> str:
        """Return the table as text for a terminal."""
        grid = [self.head, *self.rows]
        widths = [max(len(row[column]) for row in grid) for column in range(len(self.head))]
        grid.insert(1, tuple('-' * width for width in widths))
        lines = ['  '.join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()
                 for row in grid]
        return '\n'.join([self.title, *lines, ''])

    def markdown(self) -> str:
        """Return the table in Markdown."""
        grid = [self.head, tuple('---' for _ in self.head), *self.rows]
        lines = [f'| {" | ".join(row)} |' for row in grid]
        return '\n'.join([f'**{self.title}**', '', *lines, ''])


def trial_table(
        title: str, head: tuple[str, ...], expectations: Sequence[Any],
        trials: Mapping[str, Sequence[TrialT]],
        row: Callable[[Any, Sequence[TrialT]], tuple[str, ...]]) -> Table:
    """Return the table of a matrix of trials; rows without trials are left out."""
    return Table(title, head, tuple(
        row(expectation, trials[expectation.what]) for expectation in expectations
        if trials.get(expectation.what)))


def tables(run: dict[str, Any]) -> list[Table]:
    """Return the tables of a run."""
    found = figures(run)
    return [
        threshold_table(judge(found)), *_timing(found, run['timing']),
        _memory(found, run['timing']),
        _firsts(found), _starts(found), _in_step(found, run.get('in_step', [])), _signals(run),
        _planning(run.get('planning', [])), _flows(run.get('flows', [])),
        _exactness(run.get('exactness', []))]


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with a number of significant digits; ``-`` for None, ``never`` for inf."""
    if value is None:
        return '-'
    if math.isinf(value):
        return 'never'
    if value == 0.0:
        return '0'
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f'{value:.{min(decimals, digits)}f}'


def threshold_table(results: list[ThresholdResult]) -> Table:
    """Return the table that compares figures with their thresholds."""
    head = ('figure', 'threshold', 'measured', '')
    return Table('What we promise of our own figures', head, tuple(
        (result.threshold.what, _limit(result), _with_unit(result.value, result.unit),
         'held' if result.is_met else 'MISSED')
        for result in results))


def _limit(result: ThresholdResult) -> str:
    threshold = result.threshold
    if threshold.relative_to is None:
        return f'at most {_with_unit(threshold.limit, result.unit)}'
    own = _with_unit(result.limit, result.unit)
    return f'at most {threshold.limit:g} of {NAMES[threshold.relative_to]}: {own}'


def _with_unit(value: float | None, unit: str) -> str:
    text = number(value)
    return text if text in ('-', 'never') else f'{text} {unit}'.strip()


def _timing(found: Sequence[Figure], entries: list[dict[str, Any]]) -> Iterator[Table]:
    for title, parts in (
            ('Error of the displacement on the wire, 1 s movements: median / worst [%]',
             ('displacement error, median,', 'displacement error, worst,')),
            ('Difference of an interval from the period, 99th percentile [ms]',
             ('jitter, p99,',)),
            ('Ticks that came late / that were lost [%]', ('late ticks', 'lost ticks')),
            ("CPU a command: the loop's own thread / the whole process [us]",
             ('CPU a command, the loop,', 'CPU a command, the process,')),
            ('CPU a command: helper processes [us]', ('CPU a command, its helpers,',)),
            ('Movements ended early, because the program was held up', ('movements given up',))):
        table = _by_rate(title, parts, found, entries)
        # A loop without helpers, or that ended no movement early, has only zeros.
        if rows := tuple(row for row in table.rows if set(row[1:]) != {'0'}):
            yield replace(table, rows=rows)


def _by_rate(
        title: str, parts: Sequence[str], found: Sequence[Figure],
        entries: list[dict[str, Any]]) -> Table:
    places = list(dict.fromkeys(where(entry['rate'], entry['busy']) for entry in entries))
    return Table(title, ('', *(place.removeprefix('at ') for place in places)), tuple(
        (name, *(' / '.join(number(find(found, f'{part} {place}', loop)) for part in parts)
                 for place in places))
        for loop, name in NAMES.items()))


def _memory(found: Sequence[Figure], entries: list[dict[str, Any]]) -> Table:
    place = where(entries[0]['rate'], entries[0]['busy'])
    return Table('Most memory held [MB]', ('', 'process', 'helper processes'), tuple(
        (name, number(find(found, f'memory {place}', loop)),
         number(find(found, f'memory of helpers {place}', loop)))
        for loop, name in NAMES.items()))


def _firsts(found: Sequence[Figure]) -> Table:
    def cells(loop: str, place: str) -> Iterator[str]:
        for part in ('least', 'median', 'most'):
            yield number(find(found, f'of the first 0.1 m, the robot {place}, {part}', loop))

    return Table(
        "What arrived of the lesson's first movement, 0.1 m [m]",
        ('', 'the robot is', 'least', 'median', 'most'),
        tuple((NAMES[loop], text, *cells(loop, place))
              for place, text in (('there', 'there before'), ('late', 'switched on later'))
              for loop in ('ours', 'lesson')))


def _starts(found: Sequence[Figure]) -> Table:
    return Table('Until our program moves the robot [s]', ('', 'median', 'worst'), tuple(
        (what, *(number(find(found, f'{what}, {part}', 'ours')) for part in ('median', 'worst')))
        for what in ('start to t = 0', 'later match to t = 0')))


def _in_step(found: Sequence[Figure], entries: list[dict[str, Any]]) -> Table:
    counts = Counter(pluralize(entry['robots'], 'robot') for entry in entries)
    return Table(
        'Simulated robots that one program drives in step',
        ('', 'starts', 'to t = 0, median [s]', 'first velocities apart, median [ms]', 'worst',
         'Python threads'),
        tuple((what, str(starts), *(
            number(find(found, f'{part}, {what}', 'ours')) for part in (
                'start to t = 0, median', 'first velocities apart, median',
                'first velocities apart, worst', 'threads')))
              for what, starts in counts.items()))


def _signals(run: dict[str, Any]) -> Table:
    groups = [
        (NAMES[loop], ' or '.join(names) + (', loaded' if busy else ''),
         zeros(run['starts'], loop, busy, names))
        for loop, busy, names in signal_groups(run['starts'])]
    times = [math.inf if value is None else value for value in run['signals']]
    groups += [('ours', 'SIGINT, all to one process', times)] if times else []
    return Table(
        'From a signal to the first zero [ms]',
        ('', 'signal', 'times', 'median', 'worst', 'never'),
        tuple((name, kind, str(len(times)), number(1e3 * median(times)),
               number(1e3 * max(times)), str(times.count(math.inf)))
              for name, kind, times in groups))


def _planning(entries: list[dict[str, Any]]) -> Table:
    return Table(
        'Planning, at 50 Hz', ('motion [h]', 'steps', 'velocities', 'time [s]', 'memory [MB]'),
        tuple((f'{entry["length"] / 3600.0:g}', str(entry['steps']), str(entry['segments']),
               number(entry['time']), number(entry['memory'])) for entry in entries))


def _flows(entries: list[dict[str, Any]]) -> Table:
    head = ('motion', 'with stops', 'constant speed in corners', 'ours')
    return Table(
        "Duration within 5 cm of the legs, a Kachaka's limits, 20 Hz [s]", head,
        tuple((entry['motion'], *(f'{entry[key]:.2f}' for key in ('stops', 'constant', 'flow')))
              for entry in entries))


def _exactness(entries: list[dict[str, Any]]) -> Table:
    places = list(dict.fromkeys((entry['goal'], entry['shape']) for entry in entries))
    rates = list(dict.fromkeys(entry['rate'] for entry in entries))
    ways = list(dict.fromkeys(entry['way'] for entry in entries))

    def cell(place: tuple[str, str], rate: int) -> str:
        return ' / '.join(_worst(next(
            entry for entry in entries
            if (entry['goal'], entry['shape'], entry['rate'], entry['way']) == (*place, rate, way)
            )) for way in ways)

    return Table(
        f'What is missing or too much at the goal, at worst: {" / ".join(ways)} [mm] or [mrad]',
        ('goal', 'profile', *(f'{rate} Hz' for rate in rates)),
        tuple((*place, *(cell(place, rate) for rate in rates)) for place in places))


def _worst(entry: dict[str, Any]) -> str:
    return f'{1e3 * max(abs(entry[part] - entry["asked"]) for part in ("least", "most")):.2f}'
