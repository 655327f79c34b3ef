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
Junctions: the places where the legs of a flow meet, at a corner or at the end of an arc.

Tested by test/motion/test_flow.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
import math
from typing import TypeAlias

from kachaka_simple_control.motion.corner import Corner, CornerTurn, plan_corner
from kachaka_simple_control.motion.leg_speeds import Passed
from kachaka_simple_control.motion.transition import Transition

#: How many different corners are remembered: more than a motion usually has.
REMEMBERED = 4096
#: A tangent is stretched by at most this part of it.
LARGEST_GROWTH = 1e-4

_plan_corner = lru_cache(REMEMBERED)(plan_corner)


@dataclass
class CornerJunction:
    """
    The place where two lines meet.

    :param turn: the turn; None if the second line goes straight on
    :param speed: the linear velocity at the end of the first line and at the start of the
        second [m/s]
    :param tolerance: the largest deviation [m]
    :param room: the largest tangent [m]
    """

    turn: CornerTurn | None
    speed: float
    tolerance: float
    room: float
    corner: Corner | None = field(init=False)
    stretching: float = field(init=False, default=1.0)

    def __post_init__(self) -> None:
        """Plan the corner."""
        self.slow_down(self.speed)

    @property
    def tangent(self) -> float:
        """Return how much of each line the corner replaces [m]."""
        return self.corner.tangent if self.corner else 0.0

    before = after = tangent

    def corner_at(self, speed: float) -> Corner | None:
        """Return the corner with at most a speed at both ends [m/s]; None for a stop."""
        if self.turn is None or not speed or not self.room:
            return None
        return _plan_corner(self.turn, self.tolerance, self.room, speed)

    def passed(self, speed: float) -> Passed:
        """Return how the corner is passed with at most a speed [m/s]."""
        if self.turn is None:
            return Passed(speed, 0.0, 0.0)
        corner = self.corner_at(speed)
        return Passed(corner.speed, corner.tangent, corner.tangent) if corner else Passed(
            0.0, 0.0, 0.0)

    def slow_down(self, speed: float) -> None:
        """Plan the corner again with a lower speed at both ends [m/s]."""
        self.speed, self.corner = speed, self.corner_at(speed)
        if self.turn is not None:
            self.speed = self.corner.speed if self.corner else 0.0
            self.room = min(self.room, self.tangent)

    @property
    def growth(self) -> float:
        """Return by how much ``stretch`` may lengthen the tangent, within the tolerance [m]."""
        if self.corner is None:
            return 0.0
        return self.tangent * min(
            LARGEST_GROWTH, max(0.0, self.tolerance / self.corner.deviation - 1.0))

    def stretch(self, length: float) -> None:
        """Lengthen the tangent by a little, at the same linear velocities [m]."""
        assert self.corner is not None
        self.stretching = 1.0 + length / self.tangent
        self.corner = replace(
            self.corner, tangent=self.tangent * self.stretching,
            deviation=self.corner.deviation * self.stretching)


@dataclass
class ArcJunction:
    """
    The place where an arc meets a line or another arc.

    :param transition: the transition; None if the robot stops, or goes on with the same curvature
    :param speed: the linear velocity there [m/s]; 0 for a stop
    """

    transition: Transition | None
    speed: float
    #: a transition cannot be stretched
    growth = 0.0

    @property
    def before(self) -> float:
        """Return how much of the leg before it the transition replaces at most [m]."""
        return self.transition.before if self.transition else 0.0

    @property
    def after(self) -> float:
        """Return how much of the leg after it the transition replaces at most [m]."""
        return self.transition.after if self.transition else 0.0

    def passed(self, speed: float) -> Passed:
        """Return how the junction is passed with at most a speed [m/s]."""
        return Passed(speed, self.before, self.after)

    def slow_down(self, speed: float) -> None:
        """Take a lower speed [m/s]."""
        self.speed = speed


#: Either kind of junction.
Junction: TypeAlias = CornerJunction | ArcJunction


def stretch_corners(junctions: Sequence[Junction], rests: Sequence[float]) -> None:
    """
    Stretch corners so that nothing is left of the legs between them, if their bounds allow it.

    The two corners of a leg share what is left of it, so each growth follows from the first one.

    :param rests: what is left of each leg between them [m]
    """
    lowest, highest = 0.0, math.inf
    known, sign = 0.0, 1.0
    terms = []
    for junction, rest in zip(junctions, [*rests, 0.0]):
        # The growth of this corner is known + sign * that of the first one.
        terms.append((junction, known, sign))
        bounds = -sign * known, sign * (junction.growth - known)
        lowest, highest = max(lowest, min(bounds)), min(highest, max(bounds))
        known, sign = rest - known, -sign
    for junction, known, sign in terms if lowest <= highest else ():
        growth = known + sign * lowest
        if isinstance(junction, CornerJunction) and growth > 0.0:
            junction.stretch(growth)


def corners_of(one: Junction, two: Junction) -> list[CornerJunction]:
    """Return which of two junctions are corners that are cut, the second one first."""
    return [junction for junction in (two, one)
            if isinstance(junction, CornerJunction) and junction.corner]


def corner_of(one: Junction, two: Junction) -> CornerJunction | None:
    """Return the corner that can shrink: the second junction if it is one, else the first one."""
    return next(iter(corners_of(one, two)), None)
