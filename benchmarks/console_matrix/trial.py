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
"""The expected result of a row, the result of a trial, their comparison, and the table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from benchmarks.tables import number, Table, trial_table
from kachaka_simple_control.analysis.message_timing import median

#: The longest time from the last good command of the hand to the first zero [s].
HAND_LIMIT = 0.35
#: The longest time from the send() of a raw client's STOP to the first zero [s].
STOP_LIMIT = 0.1
#: The longest time from a fault to the first zero [s].  A fault may need time to take effect; for
#: example, a browser needs time to close a tab.
FAULT_LIMIT = 1.0
#: The factor for time limits on a machine that also runs other programs.
LOAD_FACTOR = 1.5
HEAD = (
    'what happens', 'what ends the motion', 'times',
    'from the last good command to the first zero [ms], median / worst',
    'from the fault [ms]', 'zeros, least', 'refused after it, most', 'motion after', 'seen')


@dataclass(frozen=True)
class Expectation:
    """
    The expected result of all trials of a row.

    :param limit: the longest time to the first zero [s]; None if nothing moves
    :param fault_limit: the longest time from the fault to the first zero [s]; None for no limit
    """

    what: str
    who: str
    limit: float | None = HAND_LIMIT
    fault_limit: float | None = FAULT_LIMIT


@dataclass(frozen=True)
class Trial:
    """
    The result of one trial; its fields are the keys of a results file.

    :param zero: the time from the last good command to the first zero at the robot [s]; None if
        there was no zero. The last good command is the last motion of the hand that was passed on
        to the console before that zero and, if the console is the one at fault, before the fault.
        For a STOP the time begins at its send().
    """

    zero: float | None = None
    since_fault: float | None = None
    zeros: int = 0
    late: int = 0
    offered: int = 0
    note: str = ''
    broken: tuple[str, ...] = ()
    not_tried: str = ''
    began: float = 0.0
    ended: float = 0.0

    @staticmethod
    def from_json(data: dict[str, Any]) -> Trial:
        """Create a trial from its fields, as converted by ``dataclasses.asdict`` and JSON."""
        return Trial(**{**data, 'broken': tuple(data['broken'])})


class Sent(Protocol):
    """A velocity, with its time [s, system clock]."""

    @property
    def time(self) -> float:
        """Return the time."""

    @property
    def moves(self) -> bool:
        """Return whether it asks for motion."""


class SpoiltError(RuntimeError):
    """The robot stopped before the fault, so the trial says nothing about it."""


def hand_trial(
        velocities: Sequence[Sent], commands: Sequence[Sent], fault: float,
        effect: float | None = None) -> Trial:
    """
    Return the result of a trial in which a hand drove.

    :param effect: after this time the console can pass nothing on [s, system clock]; None if the
        fault is on the way to the console
    :raises SpoiltError: if a zero came before the fault
    """
    zeros = [one.time for one in velocities if not one.moves]
    if zeros and zeros[0] < fault:
        raise SpoiltError('the robot stopped before the fault')
    stopped = zeros[0] if zeros else None
    end = min((at for at in (stopped, effect) if at is not None), default=fault)
    good = max((one.time for one in commands if one.moves and one.time <= end), default=None)
    return Trial(
        zero=None if stopped is None or good is None else stopped - good,
        since_fault=None if stopped is None else stopped - fault,
        began=good or 0.0, ended=stopped or 0.0, zeros=len(zeros),
        late=sum(one.moves for one in velocities if stopped is not None and one.time > stopped),
        offered=sum(one.moves for one in commands if stopped is not None and one.time > stopped))


def excess(expectation: Expectation, trial: Trial, factor: float = 1.0) -> float | None:
    """
    Return by how much a trial misses its time limits [s].

    :returns: the time; None if it keeps the limits, or if it has another violation as well
    """
    times = ((trial.zero, expectation.limit), (trial.since_fault, expectation.fault_limit))
    over = max((value - limit * factor for value, limit in times
                if value is not None and limit is not None), default=0.0)
    if trial.late or trial.broken or trial.zero is None or over <= 0.0:
        return None
    return over


def find_violations(
        expectation: Expectation, trials: Sequence[Trial], under_load: bool = False) -> list[str]:
    """Return a sentence for each kind of violation, with its count."""
    what, factor = expectation.what, LOAD_FACTOR if under_load else 1.0
    if not trials:
        return [f'{what}: it was not tried']
    found = [text for trial in trials for text in _violations(expectation, trial, factor)]
    return [f'{what}: {text} ({found.count(text)} of {len(trials)})'
            for text in dict.fromkeys(found)]


def _violations(expectation: Expectation, trial: Trial, factor: float) -> Iterator[str]:
    if trial.not_tried:
        return
    yield from trial.broken
    if trial.late:
        yield 'motion followed the first zero' if expectation.limit else 'something moved'
    if expectation.limit is None:
        return
    if trial.zero is None or trial.since_fault is None:
        yield 'no zero came'
        return
    for name, value, limit in (
            ('the last good command', trial.zero, expectation.limit),
            ('the fault', trial.since_fault, expectation.fault_limit)):
        if limit is not None and value > limit * factor:
            yield f'a zero came later than {1e3 * limit * factor:g} ms after {name}'


def matrix(
        expectations: Sequence[Expectation], trials: Mapping[str, Sequence[Trial]]) -> Table:
    """Return the console matrix as a table."""
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
