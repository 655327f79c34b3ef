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
"""The expected result of each fault of a program, and the check of trials against it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from benchmarks.stop_matrix.trial import Trial

#: The number of zeros that a stop begins with.
BURST_COUNT = 10
#: The largest time by which a motion may end too early [s].
END_TOLERANCE = 0.05
#: The factor for time limits on a machine that also runs other programs.
LOAD_FACTOR = 10.0


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

    :param what: the fault, which is also the name of the row
    :param who: the component that stops the robot
    :param codes: the correct exit codes; empty if the program does not end by itself
    :param zero: whether a zero must be sent
    :param limit: the longest time to the first zero [s]; None for no limit
    """

    what: str
    who: str
    codes: tuple[int, ...]
    zero: Zero = Zero.REQUIRED
    limit: float | None = None


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
    """
    Compare the worst time to the first zero with the limit.

    :param expectation: the expectation with the limit
    :param trials: the trials of its row
    :param under_load: whether time limits are ten times as long
    :returns: one sentence if the limit was exceeded; empty otherwise
    """
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
