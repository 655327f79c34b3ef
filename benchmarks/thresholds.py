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
"""The thresholds of this package's figures, and the check of a run against them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.figures import Figure, find

BOTH = 'SIGINT or SIGTERM to first zero'
MANY = 'SIGINT to first zero, many in one process'


@dataclass(frozen=True)
class Threshold:
    """
    The upper limit of one of this package's figures.

    :param what: the name of the figure
    :param limit: the limit in the figure's unit, or relative to the figure of another loop
    :param relative_to: the loop whose figure the limit is relative to; None for an absolute limit
    """

    what: str
    limit: float
    relative_to: str | None = None


THRESHOLDS = (
    Threshold('displacement error, median, at 10 Hz', 0.1),
    Threshold('displacement error, worst, at 10 Hz', 0.5),
    Threshold('CPU a command, the loop, at 100 Hz', 0.5, 'lesson'),
    Threshold(f'{BOTH}, worst', 20.0),
    Threshold(f'{MANY}, p99', 20.0),
    Threshold('SIGKILL to first zero, worst', 50.0),
    Threshold('SIGSTOP to first zero, worst', 150.0),
    Threshold('later match to t = 0, worst', 1.0),
    Threshold('start to t = 0, worst', 4.0),
    Threshold('planning at 50 Hz, 1 h of motion', 1.0),
)


@dataclass(frozen=True)
class ThresholdResult:
    """
    The result of checking a run against a threshold.

    :param threshold: the threshold
    :param value: the run's figure; None if not measured
    :param limit: the limit in the figure's unit; None if not measured
    :param unit: the unit
    """

    threshold: Threshold
    value: float | None
    limit: float | None
    unit: str

    @property
    def is_met(self) -> bool:
        """Return whether the threshold is met; False if the figure was not measured."""
        return self.value is not None and self.limit is not None and self.value <= self.limit


def judge(found: Sequence[Figure]) -> list[ThresholdResult]:
    """Compare the figures of a run with the thresholds; return a result for each."""
    return [_judge_one(found, threshold) for threshold in THRESHOLDS]


def _judge_one(found: Sequence[Figure], threshold: Threshold) -> ThresholdResult:
    units = [figure.unit for figure in found if figure.what == threshold.what]
    limit: float | None = threshold.limit
    if threshold.relative_to is not None:
        other = find(found, threshold.what, threshold.relative_to)
        limit = None if other is None else threshold.limit * other
    value = find(found, threshold.what, 'ours')
    return ThresholdResult(threshold, value, limit, units[0] if units else '')
