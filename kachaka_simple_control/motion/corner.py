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
Plan a corner between two straight legs: the heading turns while the robot goes on.

Tested by test/motion/test_flow.py.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.motion.chain import ARC_SHARE, Axis, ChainPath
from kachaka_simple_control.motion.geometry import sinc, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.path_segment import PathSegment
from kachaka_simple_control.motion.roots import largest_part
from kachaka_simple_control.motion.velocity_profile import (
    PathLimits,
    Ramp,
    ramp,
    time_optimal_profile,
    VelocityProfile,
)

#: A larger turn [rad] is a stop: the two legs nearly run back on each other.
MAX_ANGLE = math.radians(175.0)
#: If the speed at both ends is less than this part of the legs' speed, the corner is a stop: it
#: would save next to nothing.
MIN_PART = 1e-3


class Shape(NamedTuple):
    """
    The linear velocity during a corner: it falls from the speed, stays low, and rises again.

    :param speed: the velocity at both ends [m/s]
    :param low: the velocity in the middle [m/s]
    :param hold: how long the velocity stays low [s]
    """

    speed: float
    low: float
    hold: float


@dataclass(frozen=True)
class CornerTurn:
    """
    The heading during a corner, and the limits of its linear velocity.

    The turn is that of a turn in place, but symmetrical in time: formula (22) of docs/theory.md.

    :param turn: the turn as a path segment [rad], without linear velocity
    :param direction: 1 forwards, -1 backwards
    """

    turn: PathSegment
    limits: PathLimits
    leg: PathLimits
    direction: float
    rate: float

    @cached_property
    def profile(self) -> VelocityProfile:
        """Return the profile of the turn [rad]."""
        acceleration = min(self.limits.acceleration, self.limits.deceleration)
        return time_optimal_profile(
            self.turn.distance, self.limits.velocity, acceleration, acceleration,
            self.limits.jerk)

    @property
    def half(self) -> float:
        """Return half of the duration [s]."""
        return self.profile.duration / 2.0

    @cached_property
    def count(self) -> int:
        """Return the number of arcs; see formula (23) of docs/theory.md."""
        return max(1, math.ceil(2.0 * self.half * self.rate / ARC_SHARE * (1.0 - 1e-9)))

    @cached_property
    def times(self) -> list[float]:
        """Return the times since the middle [s] at which arcs of the second half end."""
        tick = 2.0 * self.half / self.count
        first = 0.5 if self.count % 2 else 0.0
        times = [(first + index) * tick for index in range(self.count // 2 + 1)]
        times[-1] = self.half
        return times if self.count % 2 == 0 else [0.0, *times]

    @cached_property
    def arcs(self) -> list[tuple[float, float, float]]:
        """Return the arcs of the second half: heading change, metres ahead and across for one."""
        headings = [self.profile.state_at(self.half + time).position - self.turn.distance / 2.0
                    for time in self.times]
        headings[0], headings[-1] = 0.0, self.turn.distance / 2.0
        arcs = []
        for one, two in pairwise(headings):
            chord, middle = sinc((two - one) / 2.0), (one + two) / 2.0
            arcs.append((two - one, chord * math.cos(middle), chord * math.sin(middle)))
        return arcs

    def rests(self, shape: Shape) -> int:
        """Return how many arcs of the second half have no length: the robot only turns."""
        if shape.low:
            return 0
        return max(0, bisect_right(self.times, shape.hold / 2.0) - 1)

    def lengths(self, shape: Shape) -> list[float]:
        """Return the length of each arc of the second half [m]."""
        rise, low, end = self.ramp(shape.speed - shape.low), shape.low, shape.hold / 2.0
        duration, position_at = rise.duration, rise.position_at
        rests = self.rests(shape)
        lengths, before = [0.0] * rests, 0.0
        for time in islice(self.times, rests + 1, None):
            way = low * time
            if time - end >= duration:
                way += rise.distance + rise.velocity * (time - end - duration)
            elif time > end:
                way += position_at(time - end)
            lengths.append(way - before)
            before = way
        return lengths

    def ramp(self, change: float) -> Ramp:
        """Return the ramp of a change of the linear velocity [m/s]."""
        return ramp(change, min(self.leg.acceleration, self.leg.deceleration), self.leg.jerk)

    def measure(self, shape: Shape) -> tuple[float, float]:
        """Return the tangent and the deviation of a corner [m]; see formula (24)."""
        along, across, rests = 0.0, 0.0, self.rests(shape)
        # In a slow turn nearly all arcs may be without length.
        for length, (_, forward, side) in zip(
                islice(self.lengths(shape), rests, None), islice(self.arcs, rests, None)):
            along += length * forward
            across += length * side
        tangent = along / math.cos(self.turn.distance / 2.0)
        return tangent, tangent * math.sin(self.turn.distance / 2.0) - across

    def lowest(self, speed: float) -> float:
        """Return the lowest velocity that the middle can have [m/s], for a speed at both ends."""
        acceleration = min(self.leg.acceleration, self.leg.deceleration)
        change = acceleration * self.half
        if self.leg.jerk < math.inf:
            easing = acceleration / self.leg.jerk
            change = acceleration * (self.half - easing) if 2.0 * easing <= self.half else (
                self.leg.jerk * self.half * self.half / 4.0)
        return max(0.0, speed - change)


@dataclass(frozen=True)
class Corner:
    """
    A planned corner.

    :param tangent: how much of each leg it replaces [m]
    :param deviation: the largest distance of the path from the legs, and of the legs from the path
        [m]
    """

    turn: CornerTurn
    shape: Shape
    tangent: float
    deviation: float

    @property
    def speed(self) -> float:
        """Return the linear velocity at both ends [m/s]."""
        return self.shape.speed


def corner_path(corner: Corner, limits: Limits, stretching: float = 1.0) -> ChainPath:
    """
    Return the path of a corner, with its timing.

    :param stretching: makes the path longer by this factor, at the same linear velocities
    """
    turn, later = corner.turn, []
    for length, (angle, _, _), (begin, end) in zip(
            turn.lengths(corner.shape), turn.arcs, pairwise(turn.times)):
        # Rounding must not raise a velocity above its limit.
        later.append(Velocity(
            turn.direction * min(length / (end - begin), corner.speed),
            turn.turn.angular * min(angle / (end - begin) / stretching, turn.profile.velocity)))
    # An arc in the middle belongs to both halves.
    sent = (*later[:0:-1], *later) if turn.count % 2 else (*later[::-1], *later)
    return ChainPath(
        sent, 2.0 * turn.half / turn.count * stretching, corner.speed,
        Axis(limits.max_linear_acceleration, limits.linear_deceleration),
        Axis(limits.max_angular_acceleration, limits.angular_deceleration))


def plan_corner(
        turn: CornerTurn, tolerance: float, room: float, speed: float) -> Corner | None:
    """
    Return the fastest corner that is near enough to the legs, and for which the legs have room.

    First the velocity in the middle falls, then the rest there grows, then the speed at both ends
    falls.

    :param tolerance: the largest deviation [m]
    :param room: the largest tangent [m]
    :param speed: the largest speed at both ends [m/s]
    :returns: None if the robot has to stop in the corner
    """
    def excess(shape: Shape) -> float:
        tangent, deviation = turn.measure(shape)
        return max(tangent / room, deviation / tolerance) - 1.0

    def slower(part: float) -> Shape:
        low = turn.lowest(part * speed)
        hold = 2.0 * (turn.half - turn.ramp(part * speed - low).duration)
        return Shape(part * speed, low, 0.0 if low else max(0.0, hold))

    low, hold = turn.lowest(speed), slower(1.0).hold
    shapes: tuple[Callable[[float], Shape], ...] = (
        lambda part: Shape(speed, low + (speed - low) * part, 0.0),
        lambda part: Shape(speed, low, hold * (1.0 - part)))
    shape_of = next((one for one in shapes if excess(one(0.0)) <= 0.0), slower)
    shape = shape_of(largest_part(lambda part: excess(shape_of(part))))
    if shape.speed < MIN_PART * turn.leg.velocity:
        return None
    tangent, deviation = turn.measure(shape)
    return Corner(turn, shape, tangent, deviation)
