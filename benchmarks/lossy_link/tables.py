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
"""The tables of a run with packet loss, and the violations of its expected results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import math
from typing import Any

from benchmarks.tables import number, Table
from kachaka_simple_control.analysis.message_timing import median

#: In a long run at 10 Hz manual control must be renewed within this time [s].
RENEWAL_LIMIT = 0.2
#: The case of a short disconnect, which is no fault.
BRIEF = 'after 0.6 s'
#: The case in which the kernel has dropped undelivered packets, so that none may arrive.
QUIET = '5 s after the program has ended'


def tables(run: dict[str, Any]) -> list[Table]:
    """Return the tables of a run; a table without rows is left out."""
    found = [
        _stops(run['stops']), _moves(run['moves']), _answers(run['answers']),
        _cable(run['cable']), Table('Measured on', ('', ''), tuple(run['machine'].items()))]
    return [table for table in found if table.rows]


def find_violations(run: dict[str, Any]) -> list[str]:
    """Return a line for each stop or disconnect of a run with an unexpected result."""
    lines = []
    for series in run['stops']:
        at = f'at {series["percent"]} % loss'
        if any(stop['zeros'] == 0 for stop in series['stops']):
            lines.append(f'a stop without a zero {at}')
        if any(stop['motions'] for stop in series['stops']):
            lines.append(f'motion after the first zero of a stop {at}')
    return lines + [
        f'the cable back {entry["case"]}: {entry}' for entry in run['cable']
        if is_violation(entry)]


def is_violation(entry: dict[str, Any]) -> bool:
    """
    Return whether a disconnect had a forbidden result.

    Forbidden results: the program did not end with a fault, the program moved the robot after the
    reconnect, or it took manual control long after its end.
    """
    if entry['case'] == BRIEF:
        return False
    return entry['code'] != 1 or entry['motions'] > 0 or (
        entry['case'] == QUIET and entry['taken'] > 0)


def _stops(series: Iterable[dict[str, Any]]) -> Table:
    return Table('Stops in mid-motion, all from one process', (
        'loss', 'packets lost', 'stops', 'without a zero', 'zeros received: least / median',
        'to the first zero: median / worst [ms]', 'motion commands after it',
        'driven after the stop: median / worst [mm]', 'given up before'),
        tuple(_stop_row(one) for one in series))


def _stop_row(one: dict[str, Any]) -> tuple[str, ...]:
    stops = one['stops']
    firsts = [math.inf if stop['first'] is None else 1e3 * stop['first'] for stop in stops]
    zeros = [stop['zeros'] for stop in stops]
    return (
        _percent(one['percent']), _percent(100.0 * one['lost'] / (one['lost'] + one['arrived'])),
        str(len(stops)), str(zeros.count(0)), f'{min(zeros)} / {median(zeros):g}',
        _both(firsts), str(sum(stop['motions'] for stop in stops)),
        _both([1e3 * stop['driven'] for stop in stops]), str(len(one['faults'])))


def _moves(series: Iterable[dict[str, Any]]) -> Table:
    return Table('Driven by the robot in movements of 1 s, beside what was asked for [%]', (
        'loss', 'rate [Hz]', 'movements', 'median error', 'median size of the error',
        'shortest', 'longest', 'given up'),
        tuple(_move_row(one) for one in series))


def _move_row(one: dict[str, Any]) -> tuple[str, ...]:
    errors = [100.0 * (driven - 1.0) for driven in one['driven']]
    shown = (median(errors), median([abs(error) for error in errors]), min(errors), max(errors))
    return (_percent(one['percent']), str(one['rate']), str(len(errors)),
            *(f'{value:.2f}' for value in shown), str(len(one['faults'])))


def _answers(series: Iterable[dict[str, Any]]) -> Table:
    return Table('Until manual control is granted', (
        'loss', 'asked', 'times', 'median [s]', 'worst [s]', f'later than {RENEWAL_LIMIT} s',
        'not within 10 s'),
        tuple(_answer_row(one, key, text) for one in series for key, text in (
            ('once', 'once'), ('repeatedly', 'again and again'))))


def _answer_row(one: dict[str, Any], key: str, text: str) -> tuple[str, ...]:
    times = [math.inf if taken is None else taken for taken in one[key]]
    late = sum(taken > RENEWAL_LIMIT for taken in times)
    return (_percent(one['percent']), text, str(len(times)), number(median(times)),
            number(max(times)), str(late), str(times.count(math.inf)))


def _cable(entries: Sequence[dict[str, Any]]) -> Table:
    cases = dict.fromkeys(entry['case'] for entry in entries)
    return Table('The cable is pulled in a turn of 0.5 rad/s', (
        'the cable is back', 'times', 'the robot stood after: median / worst [s]',
        'turned until then: worst [rad]', 'the program ended after: worst [s]', 'exit code',
        'old motion commands that arrived', 'turned by them: worst [rad]',
        'manual control taken again'),
        tuple(_cable_row(case, [e for e in entries if e['case'] == case]) for case in cases))


def _cable_row(case: str, entries: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    goes_on = any(entry['code'] == 0 for entry in entries)
    return (
        case, str(len(entries)), _both([entry['still'] for entry in entries]),
        number(max(abs(entry['turned']) for entry in entries)),
        number(max(entry['ended'] for entry in entries)),
        ', '.join(sorted({str(entry['code']) for entry in entries})),
        'the run goes on' if goes_on else str(sum(entry['motions'] for entry in entries)),
        '-' if goes_on else number(max(abs(entry['moved']) for entry in entries)),
        f'{sum(entry["taken"] > 0 for entry in entries)} of {len(entries)}')


def _both(values: Sequence[float]) -> str:
    return f'{number(median(values))} / {number(max(values))}'


def _percent(value: float) -> str:
    return f'{value:.3g} %'
