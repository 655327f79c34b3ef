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
"""The stop matrix as a table, for a terminal and for a documentation page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from benchmarks.stop_matrix.expectation import Expectation, Zero
from benchmarks.stop_matrix.trial import Trial
from benchmarks.tables import number, Table, trial_table
from kachaka_simple_control.analysis.message_timing import median

HEAD = (
    'what happens', 'who stops it', 'times', 'to the first zero [ms], median / worst',
    'zeros, least', 'motion after', 'driven [m], worst', 'exit code', 'it says')


def matrix(
        expectations: Sequence[Expectation], trials: Mapping[str, Sequence[Trial]]) -> Table:
    """
    Return the stop matrix as a table.

    :param expectations: the rows, in order
    :param trials: the trials by the name of the row; rows without trials are left out
    """
    return trial_table('The stop matrix', HEAD, expectations, trials, row)


def row(expectation: Expectation, trials: Sequence[Trial]) -> tuple[str, ...]:
    """Return the cells of a row with at least one trial."""
    return (
        expectation.what, expectation.who, str(len(trials)), _times(expectation, trials),
        str(min(trial.zeros for trial in trials)), str(sum(trial.late for trial in trials)),
        _worst([trial.metres for trial in trials], lambda metres: f'{metres:.3f}'),
        _codes(trials), trials[0].message.replace('|', '/') or '-')


def _times(expectation: Expectation, trials: Sequence[Trial]) -> str:
    times = [trial.zero for trial in trials if trial.zero is not None]
    if expectation.zero is Zero.NONE or not times:
        return '-'
    text = f'{_milliseconds(median(times))} / {_milliseconds(max(times))}'
    return text + ' after its end' * (expectation.zero is Zero.AT_END)


def _milliseconds(seconds: float) -> str:
    # The clock may be read after the message was stamped, so differences below 1 us have no sign.
    return number(1e3 * seconds) if seconds > 0.0 else f'{1e3 * seconds:.2g}'


def _worst(values: Sequence[float | None], text: Callable[[float], str]) -> str:
    known = [value for value in values if value is not None]
    return text(max(known)) if known else '-'


def _codes(trials: Sequence[Trial]) -> str:
    codes = sorted({-1 if trial.code is None else trial.code for trial in trials})
    return ', '.join('none' if code < 0 else str(code) for code in codes)
