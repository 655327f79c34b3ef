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
"""The speeds at which the robot passes from leg to leg of a flow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from kachaka_simple_control.motion.trajectory import PathSegment
from kachaka_simple_control.motion.velocity_profile import bisection, PathLimits, ramp

#: How often the range of speeds is halved to find the speed for which a leg is long enough.
SPEED_BISECTIONS = 12


class Leg(NamedTuple):
    """
    A line or an arc of a flow, in its whole length.

    :param segment: the path segment [m]; the joints at its ends replace a part of it
    :param limits: the limits along the leg
    """

    segment: PathSegment
    limits: PathLimits


class Passed(NamedTuple):
    """
    How a joint is passed.

    :param speed: the linear velocity [m/s]; 0 for a stop
    :param before: how much of the leg before it is replaced at most [m]
    :param after: how much of the leg after it is replaced at most [m]
    """

    speed: float
    before: float
    after: float


class LegJoint(Protocol):
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
        """Return how the joint would be passed with at most a speed [m/s]."""

    def slow_down(self, speed: float) -> None:
        """Plan the joint again with a lower speed [m/s]."""


def length_left(leg: Leg, one: LegJoint | None, two: LegJoint | None) -> float:
    """
    Return the length of a leg between two joints [m].

    :param leg: the leg
    :param one: the joint at its start; None for a rest
    :param two: the joint at its end; None for a rest
    """
    return leg.segment.distance - (one.after if one else 0.0) - (two.before if two else 0.0)


def limit_speeds(
        legs: Sequence[Leg], joints: Sequence[LegJoint | None], first: float = 0.0,
        last: float = 0.0) -> None:
    """
    Slow joints down until each leg is long enough to change its speed.

    :param legs: the legs
    :param joints: the joint before each leg, and the one after the last leg; None for a rest
    :param first: the speed at the start of the first leg, if it has no joint there [m/s]
    :param last: the speed at the end of the last leg, if it has no joint there [m/s]
    """
    for index, leg in enumerate(legs):
        one, two = joints[index:index + 2]
        start = one.speed if one else 0.0 if index else first
        if two:
            _limit_speed(two, start, length_left(leg, one, None), leg.limits, is_end=True)
    for index in reversed(range(len(legs))):
        one, two = joints[index:index + 2]
        end = two.speed if two else 0.0 if index + 1 < len(legs) else last
        limits = legs[index].limits
        if one:
            _limit_speed(
                one, end, length_left(legs[index], None, two),
                limits._replace(acceleration=limits.deceleration), is_end=False)


def _limit_speed(
        joint: LegJoint, other: float, left: float, limits: PathLimits, is_end: bool) -> None:
    """
    Slow a joint down if the leg between it and a place with another speed is too short.

    :param joint: the joint
    :param other: the speed at the other place [m/s]
    :param left: the length of the leg with the part that the joint replaces [m]
    :param limits: the limits along the leg, seen from the other place
    :param is_end: whether the joint is at the end of the leg
    """
    def is_too_fast(speed: float) -> bool:
        passed = joint.passed(speed)
        return passed.speed > other and _distance(other, passed.speed, limits) > left - (
            passed.before if is_end else passed.after)

    if joint.speed > other and is_too_fast(joint.speed):
        joint.slow_down(bisection(other, joint.speed, is_too_fast, SPEED_BISECTIONS)[0])


def _distance(start: float, end: float, limits: PathLimits) -> float:
    """Return the distance needed to change from one speed to a higher one [m]."""
    return (start + end) / 2.0 * ramp(end - start, limits.acceleration, limits.jerk).duration
