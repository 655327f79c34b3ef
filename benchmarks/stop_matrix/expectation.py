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
"""The expected result of a fault, the result of a trial, their comparison, and the table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from benchmarks.tables import number, Table, trial_table
from kachaka_simple_control.analysis.message_timing import median

#: The number of zeros that a stop begins with.
BURST_COUNT = 10
#: The largest time by which a motion may end too early [s].
END_TOLERANCE = 0.05
#: The factor for time limits on a machine that also runs other programs.
LOAD_FACTOR = 10.0
#: The longest message in the table [characters].
MAX_SHOWN = 60
HEAD = (
    'what happens', 'who stops it', 'times', 'to the first zero [ms], median / worst',
    'zeros, least', 'motion after', 'driven [m], worst', 'exit code', 'it says')


class Zero(Enum):
    """Whether a zero is required, and the start of its time limit."""

    #: required; the time starts at the fault
    REQUIRED = 'required'
    #: no stop is needed: required at the end of the motion, where the time starts
    AT_END = 'at end'
    #: required after the fault, or before it if the program detected a fault itself
    ANY_TIME = 'any time'
    #: not required: no program can send a zero, or nothing moves
    NONE = 'none'


@dataclass(frozen=True)
class Expectation:
    """
    The expected result of all trials of a row.

    :param limit: the longest time to the first zero [s]; None for no limit
    """

    what: str
    who: str
    codes: tuple[int, ...]
    zero: Zero = Zero.REQUIRED
    limit: float | None = None


@dataclass(frozen=True)
class Trial:
    """
    The result of one trial; its fields are the keys of a results file.

    :param zero: the time from the fault to the first zero [s]; None if no zero was received
    :param metres: the distance that the simulated robot drove after the fault [m]; None if unknown
    :param code: the exit code, as a shell shows it; None if the program did not end
    """

    zero: float | None
    zeros: int
    late: int
    metres: float | None
    code: int | None
    message: str
    broken: tuple[str, ...] = ()
    began: float = 0.0
    ended: float = 0.0

    @staticmethod
    def from_json(data: dict[str, Any]) -> Trial:
        """Create a trial from its fields, as converted by ``dataclasses.asdict`` and JSON."""
        return Trial(**{'message': '', **data, 'broken': tuple(data.get('broken', ()))})


def find_violations(expectation: Expectation, trials: Sequence[Trial]) -> list[str]:
    """Return a sentence for each kind of violation with its count; time limits are not checked."""
    violations = [text for trial in trials for text in _violations(expectation, trial)]
    if not trials:
        return [f'{expectation.what}: it was not tried']
    # A best-effort subscription may lose zeros in some trials, but not in all.
    if (expectation.zero is not Zero.NONE
            and max(trial.zeros for trial in trials) < BURST_COUNT):
        violations += [f'fewer than {BURST_COUNT} zeros came'] * len(trials)
    return [f'{expectation.what}: {text} ({violations.count(text)} of {len(trials)})'
            for text in dict.fromkeys(violations)]


def find_late_stops(
        expectation: Expectation, trials: Sequence[Trial], under_load: bool = False) -> list[str]:
    """Compare the worst time to the first zero with the limit."""
    times = [trial.zero for trial in trials if trial.zero is not None]
    if expectation.limit is None or not times:
        return []
    limit = expectation.limit * (LOAD_FACTOR if under_load else 1.0)
    if max(times) <= limit:
        return []
    worst = f'{1e3 * max(times):.1f} ms to the first zero'
    return [f'{expectation.what}: {worst}, more than its limit of {1e3 * limit:g} ms']


def _violations(expectation: Expectation, trial: Trial) -> Iterator[str]:
    if trial.late:
        yield 'a velocity followed the first zero'
    if expectation.codes and trial.code not in expectation.codes:
        ended = 'it did not end' if trial.code is None else f'exit code {trial.code}'
        yield f'{ended}, not {" or ".join(map(str, expectation.codes))}'
    if 'Traceback' in trial.message:
        yield 'a traceback'
    yield from trial.broken
    if expectation.zero is Zero.NONE:
        return
    if trial.zero is None:
        yield 'no zero came'
    elif expectation.zero is Zero.REQUIRED and trial.zero < 0.0:
        yield 'it stopped before anything had happened'
    elif expectation.zero is Zero.AT_END and trial.zero < -END_TOLERANCE:
        yield 'it stopped although nothing was wrong'


def matrix(
        expectations: Sequence[Expectation], trials: Mapping[str, Sequence[Trial]]) -> Table:
    """Return the stop matrix as a table."""
    return trial_table('The stop matrix', HEAD, expectations, trials, row)


def row(expectation: Expectation, trials: Sequence[Trial]) -> tuple[str, ...]:
    """Return the cells of a row with at least one trial."""
    return (
        expectation.what, expectation.who, str(len(trials)), _times(expectation, trials),
        str(min(trial.zeros for trial in trials)), str(sum(trial.late for trial in trials)),
        _worst([trial.metres for trial in trials], lambda metres: f'{metres:.3f}'),
        _codes(trials), _shown(trials[0].message))


def _shown(message: str) -> str:
    """Return the start of a message; its whole is in the results."""
    text = message.replace('|', '/')
    if len(text) > MAX_SHOWN:
        text = text[:MAX_SHOWN].rsplit(' ', 1)[0].removesuffix(' ...') + ' ...'
    return text or '-'


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
