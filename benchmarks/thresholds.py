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
"""What this project promises of its own figures, and whether a run keeps it; pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.figures import Figure, find

BOTH = 'SIGINT or SIGTERM to first zero'
MANY = 'SIGINT to first zero, many in one process'


@dataclass(frozen=True)
class Bar:
    """
    A figure of ours and its limit.

    :param what: the figure
    :param limit: what it may be at most, in the figure's unit; or as a part of ``beside``
    :param beside: the loop whose figure the limit is a part of; None for a plain limit
    """

    what: str
    limit: float
    beside: str | None = None


BARS = (
    Bar('displacement error, median, at 10 Hz', 0.1),
    Bar('displacement error, worst, at 10 Hz', 0.5),
    Bar('CPU a command, the loop, at 100 Hz', 0.5, 'lesson'),
    Bar(f'{BOTH}, worst', 20.0),
    Bar(f'{MANY}, p99', 20.0),
    Bar('SIGKILL to first zero, worst', 50.0),
    Bar('SIGSTOP to first zero, worst', 150.0),
    Bar('later match to t = 0, worst', 1.0),
    Bar('start to t = 0, worst', 4.0),
    Bar('planning at 50 Hz, 1 h of motion', 1.0),
)


@dataclass(frozen=True)
class Verdict:
    """
    A bar and what a run has to say to it.

    :param bar: the bar
    :param value: the run's figure; None if it was not measured
    :param limit: the limit in the figure's unit; None if it was not measured
    :param unit: the unit
    """

    bar: Bar
    value: float | None
    limit: float | None
    unit: str

    @property
    def is_held(self) -> bool:
        """Return whether the bar is held; what was not measured is missed."""
        return self.value is not None and self.limit is not None and self.value <= self.limit


def judge(found: Sequence[Figure]) -> list[Verdict]:
    """
    Hold the figures of a run against the bars.

    :param found: the figures
    :returns: a verdict for each bar
    """
    return [_judge_one(found, bar) for bar in BARS]


def _judge_one(found: Sequence[Figure], bar: Bar) -> Verdict:
    units = [figure.unit for figure in found if figure.what == bar.what]
    limit: float | None = bar.limit
    if bar.beside is not None:
        other = find(found, bar.what, bar.beside)
        limit = None if other is None else bar.limit * other
    return Verdict(bar, find(found, bar.what, 'ours'), limit, units[0] if units else '')
