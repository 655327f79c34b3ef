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
"""How the lesson's loop, which publishes and sleeps, would have driven plans."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.analysis.plan_view import ticks
from kachaka_simple_control.motion.geometry import (
    compose,
    distance_between,
    integrate,
    ORIGIN,
    Pose,
)
from kachaka_simple_control.motion.plan import Plan, PlannedStep, Segment

#: By how much an iteration of the lesson's loop is longer than its period [s].  Measured by the
#: benchmarks, docs/why.md: at 10 Hz a second is held for about 0.8 % too long, in ten iterations.
LOOP_OVERHEAD = 0.0008


@dataclass(frozen=True)
class SleepLoopEstimate:
    """
    What a loop that publishes and sleeps would have made of some plans.

    :param extra_time: by how much it would have taken longer [s]
    :param missing_messages: how many messages fewer it would have sent
    :param distance: how far from the planned end the robot would have ended [m]
    :param angle: by how much it would have turned too far [rad], positive to the left
    """

    extra_time: float
    missing_messages: int
    distance: float
    angle: float


def estimate_sleep_loop(plans: Sequence[Plan]) -> SleepLoopEstimate:
    """
    Estimate what the lesson's loop would have made of plans, one after the other.

    Each iteration publishes what is due, sleeps for as long as that is to be held, a period at
    most, and takes a little longer than that.  A step ends with the iteration in which its time is
    up, and the next begins then.  The robot does exactly as it is told.
    """
    pose = goal = ORIGIN
    duration = 0.0
    iterations = 0
    for plan in plans:
        goal = compose(goal, plan.pose)
        results: dict[str, _LoopStep] = {}
        index = 0
        for step in plan.steps:
            count = bisect_left(plan.segments, step.end, index, key=attrgetter('start')) - index
            if step.path not in results:
                results[step.path] = _loop_step(
                    step, plan.segments[index:index + count], plan.period)
            index += count
            result = results[step.path]
            pose = compose(pose, result.end)
            duration, iterations = duration + result.duration, iterations + result.iterations
    distance, angle = distance_between(goal, pose)
    due = sum(ticks(segment, plan.period) for plan in plans for segment in plan.segments)
    return SleepLoopEstimate(
        duration - sum(plan.duration for plan in plans), due - iterations, distance, angle)


class _LoopStep(NamedTuple):
    """What the loop makes of a step: the same each time that the step is repeated."""

    end: Pose
    duration: float
    iterations: int


def _loop_step(step: PlannedStep, segments: Sequence[Segment], period: float) -> _LoopStep:
    pose, time, iterations, index = ORIGIN, step.start, 0, 0
    while segments and time < step.end:
        while index + 1 < len(segments) and segments[index].end <= time:
            index += 1
        segment = segments[index]
        interval = min(period, segment.end - segment.start) + LOOP_OVERHEAD
        if not segment.velocity.is_zero:
            pose = integrate(pose, segment.velocity, interval)
        time += interval
        iterations += 1
    return _LoopStep(pose, time - step.start, iterations)
