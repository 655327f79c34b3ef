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
The speeds at which the robot passes from leg to leg of a flow.

Tested by test/motion/test_flow.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from kachaka_simple_control.motion.path_segment import PathSegment
from kachaka_simple_control.motion.roots import bisection
from kachaka_simple_control.motion.velocity_profile import PathLimits, ramp

#: How often the range of speeds is halved to find the speed for which a leg is long enough.
SPEED_BISECTIONS = 12


class Leg(NamedTuple):
    """
    A line or an arc of a flow, in its whole length.

    :param segment: the path segment [m]; the junctions at its ends replace a part of it
    """

    segment: PathSegment
    limits: PathLimits


class Passed(NamedTuple):
    """
    How a junction is passed.

    :param speed: the linear velocity [m/s]; 0 for a stop
    :param before: how much of the leg before it is replaced at most [m]
    :param after: how much of the leg after it is replaced at most [m]
    """

    speed: float
    before: float
    after: float


class LegJunction(Protocol):
    """
    The place where the robot passes from one leg to the next one.

    :ivar speed: the linear velocity there [m/s]; 0 for a stop
    """

    speed: float

    @property
    def before(self) -> float:
        """Return how much of the leg before it is replaced at most [m]."""

    @property
    def after(self) -> float:
        """Return how much of the leg after it is replaced at most [m]."""

    def passed(self, speed: float) -> Passed:
        """Return how the junction would be passed with at most a speed [m/s]."""

    def slow_down(self, speed: float) -> None:
        """Plan the junction again with a lower speed [m/s]."""


def length_left(leg: Leg, one: LegJunction | None, two: LegJunction | None) -> float:
    """Return the length of a leg between two junctions [m]; None is a rest."""
    return leg.segment.distance - (one.after if one else 0.0) - (two.before if two else 0.0)


def limit_speeds(
        legs: Sequence[Leg], junctions: Sequence[LegJunction | None], first: float = 0.0,
        last: float = 0.0) -> None:
    """
    Slow junctions down until each leg is long enough to change its speed.

    :param junctions: the one before each leg, and the one after the last leg; None for a rest
    :param first: the speed at the start of the first leg, if it has no junction there [m/s]
    :param last: the speed at the end of the last leg, if it has no junction there [m/s]
    """
    for index, leg in enumerate(legs):
        one, two = junctions[index:index + 2]
        start = one.speed if one else 0.0 if index else first
        if two:
            _limit_speed(two, start, length_left(leg, one, None), leg.limits, is_end=True)
    for index in reversed(range(len(legs))):
        one, two = junctions[index:index + 2]
        end = two.speed if two else 0.0 if index + 1 < len(legs) else last
        if one:
            _limit_speed(
                one, end, length_left(legs[index], None, two), legs[index].limits, is_end=False)


def _limit_speed(
        junction: LegJunction, other: float, left: float, limits: PathLimits,
        is_end: bool) -> None:
    """Slow a junction down if the leg between it and a place with another speed is too short."""
    if junction.speed <= other:
        return
    acceleration = limits.acceleration if is_end else limits.deceleration

    def is_too_fast(speed: float) -> bool:
        passed = junction.passed(speed)
        return passed.speed > other and (
            (other + passed.speed) / 2.0
            * ramp(passed.speed - other, acceleration, limits.jerk).duration
            > left - (passed.before if is_end else passed.after))

    if is_too_fast(junction.speed):
        junction.slow_down(bisection(other, junction.speed, is_too_fast, SPEED_BISECTIONS)[0])
