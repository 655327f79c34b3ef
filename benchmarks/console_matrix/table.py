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
"""The console matrix as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks.console_matrix.trial import Expectation, Trial
from benchmarks.tables import number, Table, trial_table
from kachaka_simple_control.analysis.message_timing import median

HEAD = (
    'what happens', 'what ends the motion', 'times',
    'from the last good command to the first zero [ms], median / worst',
    'from the fault [ms]', 'zeros, least', 'refused after it, most', 'motion after', 'seen')


def matrix(
        expectations: Sequence[Expectation], trials: Mapping[str, Sequence[Trial]]) -> Table:
    """
    Return the console matrix as a table.

    :param expectations: the rows, in order
    :param trials: the trials by the name of the row; rows without trials are left out
    """
    return trial_table('The console matrix', HEAD, expectations, trials, row)


def row(expectation: Expectation, trials: Sequence[Trial]) -> tuple[str, ...]:
    """Return the cells of a row with at least one trial."""
    tried = [trial for trial in trials if not trial.not_tried]
    if not tried:
        return (expectation.what, expectation.who, '0', '-', '-', '-', '-', '-',
                f'not tried: {trials[0].not_tried}')
    return (
        expectation.what, expectation.who, str(len(tried)),
        _times([trial.zero for trial in tried]), _times([trial.since_fault for trial in tried]),
        str(min(trial.zeros for trial in tried)), str(max(trial.offered for trial in tried)),
        str(sum(trial.late for trial in tried)), tried[0].note or '-')


def _times(times: Sequence[float | None]) -> str:
    known = [time for time in times if time is not None]
    if not known:
        return '-'
    return f'{number(1e3 * median(known))} / {number(1e3 * max(known))}'
