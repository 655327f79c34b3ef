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
"""
A plan with its name, robot, limits and floor area, for tables and plots.

Also what a simple loop would make of it, which publishes a velocity and then sleeps for at most
one period.  Tested by test/report/test_plan_plot.py.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
import math
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.analysis.flows import repetition_key
from kachaka_simple_control.control.tick_scheduler import TIME_TOLERANCE
from kachaka_simple_control.files.robot_profile import Laser
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import (
    Area,
    compose,
    distance_between,
    Footprint,
    integrate,
    ORIGIN,
    Pose,
)
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.paths import floor_area
from kachaka_simple_control.motion.plan import Plan, PlannedStep, Segment


@dataclass(frozen=True)
class PlanView:
    """
    A plan, together with the names, limits and outline that tables and plots show.

    :param footprint: the robot's outline from above; None if unknown
    :param laser: the laser of the obstacle watch; None without a watch
    :param obstacles: what stands on the floor, in the frame in which the robot starts; None if
        unknown
    """

    name: str
    robot: str
    plan: Plan
    limits: Limits
    footprint: Footprint | None = None
    laser: Laser | None = None
    obstacles: Floor | None = None

    @property
    def rate(self) -> float:
        """Return how often a velocity is sent in the plan [Hz]."""
        return 1.0 / self.plan.period

    @property
    def messages(self) -> int:
        """Return the number of velocities to send for the plan, without the stop at its end."""
        return sum(ticks(segment, self.plan.period) for segment in self.plan.segments)

    @cached_property
    def floor(self) -> Area:
        """Return the floor area that the robot's outline, or else its path, needs."""
        return floor_area(self.plan, self.footprint)

    @property
    def floor_size(self) -> str:
        """Return the size of the needed floor area as text, rounded up to a centimetre."""
        # A rounding error must not add a centimetre.
        width, depth = (math.ceil(100.0 * size - 1e-6) / 100.0
                        for size in (self.floor.width, self.floor.height))
        return f'{width:.2f} m x {depth:.2f} m'


def ticks(segment: Segment, period: float) -> int:
    """
    Return how many times a velocity is sent in a segment of a plan, at least 1.

    :param period: the time after which the velocity is sent again [s]
    """
    return max(1, math.ceil((segment.end - segment.start) / period - TIME_TOLERANCE))


#: An iteration of the lesson's loop takes this much longer than its period [s].  The benchmarks
#: measured it, see docs/why.md: at 10 Hz, ten iterations take about 0.8 % longer than 1 s.
LOOP_OVERHEAD = 0.0008


@dataclass(frozen=True)
class SleepLoopEstimate:
    """
    The estimated errors of a simple loop that publishes the velocities of plans.

    :param extra_time: the driven time minus the planned time [s]
    :param distance: the distance from the planned end to the robot's end [m]
    :param angle: the heading error at the end [rad], positive to the left
    """

    extra_time: float
    missing_messages: int
    distance: float
    angle: float


def estimate_sleep_loop(plans: Sequence[Plan]) -> SleepLoopEstimate:
    """
    Estimate the errors of a simple loop that publishes the velocities of plans in driving order.

    Each iteration takes 0.8 ms longer than its sleep, a period or the planned duration of the
    velocity if that is shorter; then the next step starts if the time of this one is over.
    """
    pose = goal = ORIGIN
    duration = 0.0
    iterations = 0
    for plan in plans:
        goal = compose(goal, plan.pose)
        results: dict[Hashable, _LoopStep] = {}
        index = 0
        for step in plan.steps:
            count = bisect_left(plan.segments, step.end, index, key=attrgetter('start')) - index
            # A repeated step that is driven in the same way has the same result each time.
            key = repetition_key(step)
            if key not in results:
                results[key] = _loop_step(
                    step, plan.segments[index:index + count], plan.period)
            index += count
            result = results[key]
            pose = compose(pose, result.end)
            duration, iterations = duration + result.duration, iterations + result.iterations
    distance, angle = distance_between(goal, pose)
    due = sum(ticks(segment, plan.period) for plan in plans for segment in plan.segments)
    return SleepLoopEstimate(
        duration - sum(plan.duration for plan in plans), due - iterations, distance, angle)


class _LoopStep(NamedTuple):
    """What a simple loop makes of a step; the same for repetitions that are driven alike."""

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
