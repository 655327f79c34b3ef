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
"""The speed factors and pauses of driven motions over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from kachaka_simple_control.analysis.drive_log import DriveLog, MotionLog
from kachaka_simple_control.control.events import SpeedFactorChanged
from kachaka_simple_control.control.speed_factor import product
from kachaka_simple_control.motion.plan import PlannedStep


@dataclass(frozen=True)
class SpeedInterval:
    """
    A part of a motion with a constant speed factor.

    :param motion: the motion
    :param factors: the factors below 1, by the name of their source; empty at full speed
    :param begin: the start time [s on the steady clock]
    :param end: the end time [s on the steady clock]
    :param plan_begin: the plan time at the start [s of the plan]
    :param plan_end: the plan time at the end [s of the plan]
    """

    motion: MotionLog
    factors: Mapping[str, float]
    begin: float
    end: float
    plan_begin: float
    plan_end: float

    @property
    def factor(self) -> float:
        """Return the speed factor, from 0 to 1."""
        return product(self.factors)

    @property
    def is_pause(self) -> bool:
        """Return whether the motion was paused."""
        return self.factor == 0.0

    @property
    def step(self) -> PlannedStep:
        """Return the step at the start of the interval; for a pause, the step at its end."""
        plan = self.motion.plan
        return plan.steps[plan.step_index(self.plan_end if self.is_pause else self.plan_begin)]


def speed_intervals(log: DriveLog) -> list[SpeedInterval]:
    """
    Return the intervals of constant speed factor of a drive, in order.

    :param log: the drive
    :returns: all intervals of each motion that had a speed factor below 1 at some time
    """
    return [interval for motion in log.motions if motion.own_messages and motion.plan.steps
            for interval in _intervals(motion, log.speed_changes)]


def _intervals(
        motion: MotionLog, changes: Sequence[SpeedFactorChanged]) -> list[SpeedInterval]:
    end = motion.own_messages[-1].time
    before: Mapping[str, float] = {}
    starts: list[tuple[float, Mapping[str, float]]] = []
    for change in changes:
        if change.time <= motion.began:
            before = change.factors
        elif change.time < end and change.factors != (starts[-1][1] if starts else before):
            starts.append((change.time, change.factors))
    starts.insert(0, (motion.began, before))
    if not any(factors for _, factors in starts):
        return []
    timeline, duration = motion.timeline, motion.plan.duration
    ends = [*(begin for begin, _ in starts[1:]), end]
    marks = [min(max(0.0, timeline.plan_time(time)), duration) for time in (motion.began, *ends)]
    return [SpeedInterval(motion, factors, begin, until, *plan_times)
            for (begin, factors), until, plan_times in zip(starts, ends, pairwise(marks))]
