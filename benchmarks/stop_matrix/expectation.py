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
"""What is promised for each thing that may happen to a program; pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from benchmarks.stop_matrix.trial import Trial

#: The burst at the head of every stop.
WHOLE = 10
#: An end on time is this near to its time [s].
ON_TIME = 0.05
#: A machine that does other things, too, may take this many times as long.
BUSY = 10.0


class Zero(Enum):
    """Whether a zero must come, and what its time is counted from."""

    #: it must; from the fault
    PROMISED = 'promised'
    #: nothing needs stopping; it comes at the end of the motion, and is counted from there
    ON_TIME = 'on time'
    #: it must; from the fault, or before it if the program noticed something by itself
    EARLY_TOO = 'early too'
    #: nobody is left to send one, or nothing moves
    NONE = 'none'


@dataclass(frozen=True)
class Promise:
    """
    A row of the matrix.

    :param what: what happens
    :param who: who stops the robot
    :param codes: the exit codes that are right; none where the program does not end by itself
    :param zero: whether a zero must come
    :param bar: the longest time to the first zero that is allowed [s]; None for no bar
    """

    what: str
    who: str
    codes: tuple[int, ...]
    zero: Zero = Zero.PROMISED
    bar: float | None = None


def broken(promise: Promise, trials: Sequence[Trial]) -> list[str]:
    """
    Tell what of a promise was not kept, time left aside.

    :param promise: the promise
    :param trials: what was seen
    :returns: a sentence for each breach, with how often it was seen; nothing if all was kept
    """
    breaches = [breach for trial in trials for breach in _breaches(promise, trial)]
    if not trials:
        return [f'{promise.what}: it was not tried']
    # DDS may lose some to a listener, but not in every trial.
    if promise.zero is not Zero.NONE and max(trial.zeros for trial in trials) < WHOLE:
        breaches += [f'fewer than {WHOLE} zeros came'] * len(trials)
    return [f'{promise.what}: {breach} ({breaches.count(breach)} of {len(trials)})'
            for breach in dict.fromkeys(breaches)]


def too_slow(promise: Promise, trials: Sequence[Trial], wide: bool = False) -> list[str]:
    """
    Tell whether a zero came later than the bar allows.

    :param promise: the promise
    :param trials: what was seen
    :param wide: whether bars are ten times as wide, for a machine that is busy with other things
    :returns: a sentence, or nothing
    """
    times = [trial.zero for trial in trials if trial.zero is not None]
    if promise.bar is None or not times:
        return []
    bar = promise.bar * (BUSY if wide else 1.0)
    if max(times) <= bar:
        return []
    worst = f'{1e3 * max(times):.1f} ms to the first zero'
    return [f'{promise.what}: {worst}, more than the {1e3 * bar:g} ms of its bar']


def _breaches(promise: Promise, trial: Trial) -> Iterator[str]:
    if trial.late:
        yield 'a velocity followed the first zero'
    if promise.codes and trial.code not in promise.codes:
        said = 'it did not end' if trial.code is None else f'exit code {trial.code}'
        yield f'{said}, not {" or ".join(map(str, promise.codes))}'
    if 'Traceback' in trial.message:
        yield 'a traceback'
    yield from trial.broken
    if promise.zero is not Zero.NONE:
        yield from _zero_breaches(promise, trial)


def _zero_breaches(promise: Promise, trial: Trial) -> Iterator[str]:
    if trial.zero is None:
        yield 'no zero came'
        return
    if promise.zero is Zero.PROMISED and trial.zero < 0.0:
        yield 'it stopped before anything had happened'
    if promise.zero is Zero.ON_TIME and trial.zero < -ON_TIME:
        yield 'it stopped although nothing was wrong'
