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
"""A plan with what a person must know to read it, and steps in a person's words."""

from __future__ import annotations

from dataclasses import dataclass
import math

from kachaka_simple_control.motion.geometry import Footprint
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, Segment

#: A last tick shorter than this part of a period is rounding, as it is to the player.
TIME_TOLERANCE = 1e-6


@dataclass(frozen=True)
class PlanView:
    """
    A plan to look at before anything moves.

    :param name: what people call the motion
    :param robot: what people call the robot
    :param plan: the plan
    :param limits: what it was planned with
    :param footprint: the robot's outline from above; None if nobody knows it
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
        """Return how many velocities are sent if none comes late; the stop comes on top."""
        return sum(ticks(segment, self.plan.period) for segment in self.plan.segments)


def ticks(segment: Segment, period: float) -> int:
    """
    Return how many velocities are sent in a segment if none comes late.

    :param segment: a stretch of time with one velocity
    :param period: how often it is repeated [s]
    :returns: how many
    """
    return max(1, math.ceil((segment.end - segment.start) / period - TIME_TOLERANCE))


def format_fixed(value: float, digits: int) -> str:
    """
    Return a number for a column.

    :param value: the number
    :param digits: how many digits stand behind the point
    :returns: its text; what rounds to zero has no sign
    """
    return f'{round(value, digits) + 0.0:.{digits}f}'


def pluralize(count: int, one: str, more: str | None = None) -> str:
    """
    Return how many there are of something.

    :param count: how many
    :param one: its name, if there is one
    :param more: its name, if there are more or none; None: with an s
    :returns: number and name
    """
    return f'{count} {one if count == 1 else more or one + "s"}'
