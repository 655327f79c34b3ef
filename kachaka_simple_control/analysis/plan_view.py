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
"""A plan with its name, robot, limits and floor, as tables and plots show it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
import math
from typing import NamedTuple

from kachaka_simple_control.analysis.paths import sample_path
from kachaka_simple_control.control.tick_scheduler import TIME_TOLERANCE
from kachaka_simple_control.motion.geometry import Footprint, outline
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, Segment

#: At how many poses of a plan the outline of the robot is looked at.
MAX_FLOOR_POSES = 20_000


class Area(NamedTuple):
    """A part of the floor: its left and lower edge, its width and its height [m]."""

    left: float
    bottom: float
    width: float
    height: float


@dataclass(frozen=True)
class PlanView:
    """
    A plan with its name, robot, limits and floor.

    :param name: the name of the motion
    :param robot: the name of the robot
    :param plan: the plan
    :param limits: the limits that it was planned with
    :param footprint: the robot's outline from above; None if it is not known
    """

    name: str
    robot: str
    plan: Plan
    limits: Limits
    footprint: Footprint | None = None

    @property
    def rate(self) -> float:
        """Return how often a velocity is sent [Hz]."""
        return 1.0 / self.plan.period

    @property
    def messages(self) -> int:
        """Return how many velocities are sent if none is late, without the stop."""
        return sum(ticks(segment, self.plan.period) for segment in self.plan.segments)

    @cached_property
    def floor(self) -> Area:
        """
        Return the floor that it needs: along x and y of the start, with the robot's outline.

        On curves and turns the corners of the outline are looked at every few degrees, which is
        off by less than a thousandth of the robot's size.
        """
        poses = sample_path(self.plan, most=MAX_FLOOR_POSES)
        points = [(pose.x, pose.y) for pose in poses] if self.footprint is None else [
            point for pose in poses for point in outline(self.footprint, pose)]
        xs, ys = zip(*points)
        return Area(min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys))

    @property
    def floor_size(self) -> str:
        """Return the width and the depth of that floor in words, rounded up to a centimetre."""
        # Not up by a rounding error.
        width, depth = (math.ceil(100.0 * size - 1e-6) / 100.0
                        for size in (self.floor.width, self.floor.height))
        return f'{width:.2f} m x {depth:.2f} m'


def ticks(segment: Segment, period: float) -> int:
    """
    Return how many velocities are sent in a segment if none is late.

    :param segment: a part of a plan with one velocity
    :param period: how often that is repeated [s]
    """
    return max(1, math.ceil((segment.end - segment.start) / period - TIME_TOLERANCE))
