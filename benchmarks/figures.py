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
"""Compute the figures (named measured values) of a run, and compare them with thresholds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math
from typing import Any

from kachaka_simple_control.analysis.message_timing import median, quantile
from kachaka_simple_control.text import pluralize

BOTH = 'SIGINT or SIGTERM to first zero'
MANY = 'SIGINT to first zero, many in one process'
#: The value of an event that never came.
NEVER = math.inf


@dataclass(frozen=True)
class Figure:
    """A measured value with its name."""

    what: str
    loop: str
    value: float
    unit: str


def figures(run: dict[str, Any]) -> list[Figure]:
    """Return all figures of a run."""
    return [
        *(figure for entry in run['timing'] for figure in _timing(entry)),
        *_firsts(run['firsts']), *_starts(run['starts']), *_zeros(run),
        *_in_step(run.get('in_step', ())), *_planning(run.get('planning', ()))]


def find(found: Sequence[Figure], what: str, loop: str) -> float | None:
    """Return the value of the figure of a loop; None if there is no such figure."""
    return next((one.value for one in found if (one.what, one.loop) == (what, loop)), None)


def where(rate: int, busy: int) -> str:
    """Return the part of a figure's name that describes rate and load."""
    return f'at {rate} Hz' + (', loaded' if busy else '')


def _timing(entry: dict[str, Any]) -> Iterator[Figure]:
    circumstances = where(entry['rate'], entry['busy'])

    def figure(what: str, value: float, unit: str) -> Figure:
        return Figure(f'{what} {circumstances}', entry['loop'], value, unit)

    errors = [abs(error) for error in entry['errors']]
    if errors:
        yield figure('displacement error, median,', 100.0 * median(errors), '%')
        yield figure('displacement error, worst,', 100.0 * max(errors), '%')
    yield figure('jitter, p99,', 1e3 * entry['jitter']['0.99'], 'ms')
    if entry['due']:
        yield figure('late ticks', 100.0 * entry['late'] / entry['due'], '%')
        yield figure('lost ticks', 100.0 * entry['lost'] / entry['due'], '%')
    if entry['sent']:
        for part, name in (
                ('thread', 'the loop'), ('process', 'the process'), ('helpers', 'its helpers')):
            yield figure(f'CPU a command, {name},', 1e6 * entry[part] / entry['sent'], 'us')
    yield figure('memory', entry['memory'], 'MB')
    yield figure('memory of helpers', entry['helper_memory'], 'MB')
    yield figure('movements given up', len(entry['faults']), '')


def _firsts(entries: list[dict[str, Any]]) -> Iterator[Figure]:
    for late in (False, True):
        for loop in dict.fromkeys(entry['loop'] for entry in entries):
            arrived = [entry['arrived'] for entry in entries
                       if (entry['loop'], entry['late']) == (loop, late)]
            what = f'of the first 0.1 m, the robot {"late" if late else "there"},'
            if arrived:
                yield Figure(f'{what} least', loop, min(arrived), 'm')
                yield Figure(f'{what} median', loop, median(arrived), 'm')
                yield Figure(f'{what} most', loop, max(arrived), 'm')


def _starts(entries: list[dict[str, Any]]) -> Iterator[Figure]:
    ours = [entry for entry in entries if entry['loop'] == 'ours' and not entry['busy']]
    for key, what in (('start', 'start to t = 0'), ('match', 'later match to t = 0')):
        times = _times(entry[key] for entry in ours)
        if times:
            yield Figure(f'{what}, median', 'ours', median(times), 's')
            yield Figure(f'{what}, worst', 'ours', max(times), 's')


def _zeros(run: dict[str, Any]) -> Iterator[Figure]:
    for loop, busy, names in signal_groups(run['starts']):
        times = zeros(run['starts'], loop, busy, names)
        what = f'{" or ".join(names)} to first zero{", loaded" if busy else ""}'
        yield Figure(f'{what}, median', loop, 1e3 * median(times), 'ms')
        yield Figure(f'{what}, worst', loop, 1e3 * max(times), 'ms')
    times = _times(run['signals'])
    if times:
        yield Figure(f'{MANY}, median', 'ours', 1e3 * median(times), 'ms')
        yield Figure(f'{MANY}, p99', 'ours', 1e3 * quantile(times, 0.99), 'ms')
        yield Figure(f'{MANY}, worst', 'ours', 1e3 * max(times), 'ms')


def _in_step(entries: Sequence[dict[str, Any]]) -> Iterator[Figure]:
    for count in dict.fromkeys(entry['robots'] for entry in entries):
        ours = [entry for entry in entries if entry['robots'] == count]
        what = pluralize(count, 'robot')
        starts, apart = (_times(entry[key] for entry in ours) for key in ('start', 'apart'))
        yield Figure(f'start to t = 0, median, {what}', 'ours', median(starts), 's')
        yield Figure(f'first velocities apart, median, {what}', 'ours', 1e3 * median(apart), 'ms')
        yield Figure(f'first velocities apart, worst, {what}', 'ours', 1e3 * max(apart), 'ms')
        yield Figure(f'threads, {what}', 'ours', max(entry['threads'] for entry in ours), '')


def _planning(entries: Sequence[dict[str, Any]]) -> Iterator[Figure]:
    for entry in entries:
        what = f'at 50 Hz, {entry["length"] / 3600.0:g} h of motion'
        yield Figure(f'planning {what}', 'ours', entry['time'], 's')
        yield Figure(f'memory of planning {what}', 'ours', entry['memory'], 'MB')


def signal_groups(entries: list[dict[str, Any]]) -> list[tuple[str, int, tuple[str, ...]]]:
    """
    Group the processes that received a signal.

    :returns: the loop, the number of busy processes and the signals of each non-empty group
    """
    kinds = (('SIGINT', 'SIGTERM'), ('SIGKILL',), ('SIGSTOP',))
    return list(dict.fromkeys(
        (entry['loop'], entry['busy'], names)
        for entry in entries for names in kinds if entry['signal'] in names))


def zeros(
        entries: list[dict[str, Any]], loop: str, busy: int,
        names: Sequence[str]) -> list[float]:
    """Return the times from signal to first zero in a group [s]; infinite if no zero came."""
    return _times(
        entry['zero'] for entry in entries
        if (entry['loop'], entry['busy']) == (loop, busy) and entry['signal'] in names)


def _times(values: Iterator[float | None] | list[float | None]) -> list[float]:
    return [NEVER if value is None else value for value in values]


@dataclass(frozen=True)
class Threshold:
    """
    The upper limit of one of this package's figures.

    :param relative_to: the loop whose figure the limit is relative to; None for an absolute limit
    """

    what: str
    limit: float
    relative_to: str | None = None


THRESHOLDS = (
    Threshold('displacement error, median, at 10 Hz', 0.1),
    Threshold('displacement error, worst, at 10 Hz', 0.5),
    # The floor alone takes 0.27 to 0.36 of the lesson's loop, by machine, and ours 1.5 times that.
    Threshold('CPU a command, the loop, at 100 Hz', 0.65, 'lesson'),
    Threshold(f'{BOTH}, worst', 20.0),
    Threshold(f'{MANY}, p99', 20.0),
    Threshold('SIGKILL to first zero, worst', 50.0),
    Threshold('SIGSTOP to first zero, worst', 150.0),
    Threshold('later match to t = 0, worst', 2.0),
    Threshold('start to t = 0, worst', 4.0),
    Threshold('start to t = 0, median, 1 robot', 1.7),
    Threshold('first velocities apart, worst, 2 robots', 3.0),
    Threshold('first velocities apart, worst, 10 robots', 5.0),
    *(Threshold(f'threads, {robots}', 12.0) for robots in ('1 robot', '10 robots')),
    Threshold('planning at 50 Hz, 1 h of motion', 1.0),
)


@dataclass(frozen=True)
class ThresholdResult:
    """
    The result of checking a run against a threshold.

    :param value: the run's figure; None if not measured
    :param limit: the limit in the figure's unit; None if not measured
    """

    threshold: Threshold
    value: float | None
    limit: float | None
    unit: str

    @property
    def is_met(self) -> bool:
        """Return whether the threshold is met; False if the figure was not measured."""
        return self.value is not None and self.limit is not None and self.value <= self.limit


def judge(
        found: Sequence[Figure],
        thresholds: Sequence[Threshold] = THRESHOLDS) -> list[ThresholdResult]:
    """Compare the figures of a run with thresholds; return a result for each."""
    return [_judge_one(found, threshold) for threshold in thresholds]


def _judge_one(found: Sequence[Figure], threshold: Threshold) -> ThresholdResult:
    units = [figure.unit for figure in found if figure.what == threshold.what]
    limit: float | None = threshold.limit
    if threshold.relative_to is not None:
        other = find(found, threshold.what, threshold.relative_to)
        limit = None if other is None else threshold.limit * other
    value = find(found, threshold.what, 'ours')
    return ThresholdResult(threshold, value, limit, units[0] if units else '')
