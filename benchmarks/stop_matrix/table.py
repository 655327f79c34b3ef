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
"""The stop matrix as a table, for a terminal and for a page; pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from kachaka_simple_control.report.metrics import median

from benchmarks.stop_matrix.expectation import Promise, Zero
from benchmarks.stop_matrix.trial import Trial
from benchmarks.tables import number, Table

HEAD = (
    'what happens', 'who stops it', 'times', 'to the first zero [ms], median / worst',
    'zeros, least', 'motion after', 'driven [m], worst', 'exit code', 'it says')


def matrix(promises: Sequence[Promise], trials: Mapping[str, Sequence[Trial]]) -> Table:
    """
    Put what was seen as a table.

    :param promises: the rows, in order
    :param trials: what was seen, by the name of the row; rows without any are left out
    :returns: the table
    """
    return Table('The stop matrix', HEAD, tuple(
        row(promise, trials[promise.what]) for promise in promises
        if trials.get(promise.what)))


def row(promise: Promise, trials: Sequence[Trial]) -> tuple[str, ...]:
    """
    Put a row.

    :param promise: the row
    :param trials: what was seen of it, at least once
    :returns: its cells
    """
    return (
        promise.what, promise.who, str(len(trials)), _times(promise, trials),
        str(min(trial.zeros for trial in trials)), str(sum(trial.late for trial in trials)),
        _worst([trial.metres for trial in trials], lambda metres: f'{metres:.3f}'),
        _codes(trials), trials[0].message.replace('|', '/') or '-')


def _times(promise: Promise, trials: Sequence[Trial]) -> str:
    times = [trial.zero for trial in trials if trial.zero is not None]
    if promise.zero is Zero.NONE or not times:
        return '-'
    text = f'{_ms(median(times))} / {_ms(max(times))}'
    return text + ' after its end' * (promise.zero is Zero.ON_TIME)


def _ms(seconds: float) -> str:
    # A clock read before, a stamp made after: less than a microsecond is neither.
    return number(1e3 * seconds) if seconds > 0.0 else f'{1e3 * seconds:.2g}'


def _worst(values: Sequence[float | None], text: Callable[[float], str]) -> str:
    known = [value for value in values if value is not None]
    return text(max(known)) if known else '-'


def _codes(trials: Sequence[Trial]) -> str:
    codes = sorted({-1 if trial.code is None else trial.code for trial in trials})
    return ', '.join('none' if code < 0 else str(code) for code in codes)
