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
Plan a transition: the way from a line to an arc, or from an arc to another one, without a stop.

The curvature jumps there, but an angular velocity cannot.  So the arcs are driven on slightly
smaller circles, and the transition bridges the gap: at a constant linear velocity, the angular
velocity changes along one ramp.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
import math
from typing import NamedTuple

from kachaka_simple_control.motion.chain import ARC_SHARE, Axis, ChainPath
from kachaka_simple_control.motion.geometry import sinc, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.roots import largest_part, root
from kachaka_simple_control.motion.velocity_profile import Ramp, ramp

#: A transition lasts at least this part of the longest duration of an arc of a chain, so that no
#: message is much shorter than the others.
SHORTEST = 0.5
#: The second difference of what is sent may exceed the limit of the jerk by this fraction, where a
#: message is shorter than the one before it.
UNEQUAL_JERK = 0.01
#: A transition takes at most this angle from each arc [rad].  For larger angles, the width of the
#: gap would no longer grow with the duration of the transition.
LARGEST_ANGLE = 1.4
#: With this number of arcs a chain is nearly a smooth curve.  Its length differs from the length
#: of the smooth curve by less than ``SMOOTH_SHARE``.
SMOOTH_COUNT = 64
SMOOTH_SHARE = 1e-3
#: The rounding of a position, as a part of the radii.
ROUNDING = 1e-14
#: How many different ramps are remembered.
REMEMBERED = 4096


class Circle(NamedTuple):
    """
    A line or a circle, seen from where it meets its neighbour: x in the driving direction.

    :param curvature: heading change for each driven metre [rad/m], positive to the left; 0 for a
        line
    """

    curvature: float
    x: float = 0.0
    y: float = 0.0


class Replaced(NamedTuple):
    """
    How much of the two neighbours a transition replaces; negative if one becomes longer.

    :param before: a length [m] of a line, or an angle [rad] of an arc
    """

    before: float
    after: float


@dataclass(frozen=True)
class Bend:
    """
    The form of a transition: which curves it connects, and how the angular velocity changes in it.

    :param easing: the part of the duration in which the angular acceleration rises, and in which
        it falls again, from 0 to 1/2
    """

    one: Circle
    two: Circle
    easing: float
    rate: float
    least: int = 1

    def gap(self, speed: float, duration: float, count: int) -> float:
        """Return by how much a chain bridges more than the gap [m]: (27) of docs/theory.md."""
        x, y, angle = self._chain(speed, duration, count)
        one, two = self.one, self.two
        if not one.curvature:
            return math.copysign(1.0, two.curvature) * (
                y + math.cos(angle) / two.curvature - two.y)
        if not two.curvature:
            return math.copysign(1.0, one.curvature) * (
                math.cos(angle) / one.curvature + x * math.sin(angle) - y * math.cos(angle)
                - one.y)
        between = math.hypot(*self._between_centres(x, y, angle))
        wanted = math.hypot(two.x - one.x, two.y - one.y)
        return between - wanted if one.curvature * two.curvature < 0.0 else wanted - between

    def replaced(self, speed: float, duration: float, count: int) -> Replaced:
        """Return how much of the two neighbours a chain replaces: (28) of docs/theory.md."""
        x, y, angle = self._chain(speed, duration, count)
        one, two = self.one, self.two
        if not one.curvature:
            return Replaced(x - math.sin(angle) / two.curvature - two.x, abs(angle))
        if not two.curvature:
            end = (one.x - math.sin(angle) / one.curvature
                   + x * math.cos(angle) + y * math.sin(angle))
            return Replaced(abs(angle), end)
        along, across = self._between_centres(x, y, angle)
        heading = math.remainder(
            math.atan2(two.y - one.y, two.x - one.x) - math.atan2(across, along), math.tau)
        return Replaced(-math.copysign(1.0, one.curvature) * heading,
                        math.copysign(1.0, two.curvature) * (heading + angle))

    def duration(self, speed: float, count: int | None = None) -> tuple[float, int] | None:
        """
        Return the duration with which the transition bridges the gap [s], and the number of arcs.

        :param count: None for the least number that the rate of the plan allows
        :returns: None if there is no such duration
        """
        change = abs(self.two.curvature - self.one.curvature)
        largest = 2.0 * LARGEST_ANGLE / (
            speed * max(abs(self.one.curvature), abs(self.two.curvature)))
        # The gap of a short, smooth transition grows with the square of the duration.
        missing = -self.gap(speed, 0.0, 1)
        if missing <= 0.0:
            return None
        guess = math.sqrt(24.0 * missing / change) / speed
        arcs = count or max(self.least, arc_count(guess / math.sqrt(3.0), self.rate))
        while True:
            def above(time: float, arcs: int = arcs) -> float:
                return self.gap(speed, time, arcs)
            high = guess
            while (value := above(high)) < 0.0:
                if high > 2.0 * largest:
                    return None
                high *= 1.3
            time = root(above, 0.0, high, -missing, value)
            if count or time <= arcs * ARC_SHARE / self.rate * (1.0 + 1e-9):
                return time, arcs
            arcs = max(arcs + 1, arc_count(time, self.rate))

    def angular(self, speed: float, count: int) -> list[float]:
        """Return the angular velocity in each arc of a chain [rad/s]."""
        start, end = speed * self.one.curvature, speed * self.two.curvature
        low, high = min(start, end), max(start, end)
        # Rounding must not raise a velocity above its limit.
        return [min(max(start + (end - start) * mean, low), high)
                for mean in _means(self.easing, count)]

    def _chain(self, speed: float, duration: float, count: int) -> tuple[float, float, float]:
        """Return x [m], y [m] and the heading [rad] at the end of a chain, seen from its start."""
        step = speed * duration / count
        start, slope = step * self.one.curvature, step * (self.two.curvature - self.one.curvature)
        x = y = heading = 0.0
        # Half of the time of a plan is spent here: local names, and sinc() in place, are faster.
        cos, sin = math.cos, math.sin
        for mean in _means(self.easing, count):
            angle = start + slope * mean
            half = angle / 2.0
            middle = heading + half
            chord = step * (sin(half) / half if half >= 1e-4 or half <= -1e-4 else sinc(half))
            x += chord * cos(middle)
            y += chord * sin(middle)
            heading += angle
        return x, y, heading

    def _between_centres(self, x: float, y: float, angle: float) -> tuple[float, float]:
        """Return the way from the first centre to the second one [m], seen from the chain."""
        one, two = 1.0 / self.one.curvature, 1.0 / self.two.curvature
        return x - two * math.sin(angle), y + two * math.cos(angle) - one


class Transition(NamedTuple):
    """
    A transition that the robot can drive without a stop.

    :param speed: the largest linear velocity [m/s]; each lower one is possible too
    :param before: the largest length of the first neighbour that it replaces at any speed [m]
    :param after: the same of the second neighbour [m]
    """

    bend: Bend
    speed: float
    spare: float
    length: float
    before: float
    after: float


def transition_path(
        bend: Bend, speed: float, direction: float, limits: Limits) -> tuple[ChainPath, Replaced]:
    """
    Return the path of a transition, and how much of its neighbours it replaces.

    :param speed: the linear velocity [m/s], at most that of the transition
    :param direction: 1 forwards, -1 backwards
    """
    found = bend.duration(speed)
    assert found is not None
    time, count = found
    return ChainPath(
        tuple(Velocity(direction * speed, angular) for angular in bend.angular(speed, count)),
        time / count, speed, Axis(limits.max_linear_acceleration, limits.linear_deceleration),
        Axis(limits.max_angular_acceleration, limits.angular_deceleration),
    ), bend.replaced(speed, time, count)


def turn_ramp(change: float, limits: Axis, jerk: float, rate: float) -> Ramp:
    """
    Return the fastest symmetrical ramp of the angular velocity in a transition.

    :param change: the change of the angular velocity [rad/s], not negative
    :param limits: the limits of the angular acceleration; the smaller one counts
    :param jerk: the limit of the angular jerk [rad/s^3]
    """
    quickest = ramp(change, min(limits), jerk)
    if jerk == math.inf or not change:
        return quickest
    # The messages of a transition are shorter than those of an arc beside it.  If the jerk has its
    # limit on both sides, the second difference of the messages is above the limit, by up to
    # total - 1.  The jerk in the transition is lower, so that at most UNEQUAL_JERK remains.
    count = arc_count(1.05 * quickest.duration, rate)
    tick = min(max(quickest.duration * rate / count, SHORTEST * ARC_SHARE), ARC_SHARE)
    width = (1.0 + 3.0 * tick) / 4.0
    beside = 1.0 / (3.0 * (1.0 + tick) * width)
    total = 1.0 + (1.0 - tick) / (12.0 * width)
    return ramp(change, min(limits),
                jerk * (1.0 + UNEQUAL_JERK - beside) / (total - beside))


def arc_count(duration: float, rate: float) -> int:
    """Return the number of arcs of a chain with a duration [s], at a rate [Hz]."""
    return max(1, math.ceil(duration * rate / ARC_SHARE * (1.0 - 1e-9)))


def plan_transition(
        one: Circle, two: Circle, speed: float, limits: Axis, jerk: float,
        rate: float, most: int | None = None) -> Transition | None:
    """
    Return the fastest transition between two curves.

    :param speed: the largest linear velocity that is useful [m/s]
    :param jerk: the limit of the angular jerk [rad/s^3]
    :param most: estimate the transition with at most this number of arcs; None for the exact one
    :returns: None if no gap is left between the curves
    """
    change = abs(two.curvature - one.curvature)
    sharpest = max(abs(one.curvature), abs(two.curvature))

    def form(speed: float) -> tuple[Bend, float]:
        turn = turn_ramp(speed * change, limits, jerk, rate)
        time = max(turn.duration, SHORTEST * ARC_SHARE / rate)
        easing = turn.easing / turn.duration if turn.duration else 0.0
        return Bend(one, two, easing, rate, arc_count(time, rate)), time

    def excess(part: float) -> float:
        bend, time = form(part * speed)
        angle = part * speed * time * sharpest / 2.0
        if angle > LARGEST_ANGLE:
            return angle
        return bend.gap(part * speed, time, min(bend.least, most or bend.least))

    if form(speed)[0].gap(speed, 0.0, 1) >= 0.0:
        return None
    part = largest_part(excess)
    if not part:
        return None
    chosen = part * speed
    bend, shortest = form(chosen)
    found = bend.duration(chosen, min(bend.least, most) if most else None)
    if found is None:
        return None
    if most:
        # A smooth curve is longer than the chain by this factor, for small angles.
        smooth = (found[0] * math.sqrt(1.0 + 2.0 / found[1] ** 2), found[1])
    elif (refined := bend.duration(chosen, SMOOTH_COUNT)) is not None:
        smooth = refined
    else:
        return None
    length = smooth[0] * chosen
    lost = bend.replaced(chosen, *smooth)
    margin = max(SMOOTH_SHARE * length, _rounding(one, two))
    return Transition(
        bend, chosen, found[0] / shortest, length,
        lost.before / (abs(one.curvature) or 1.0) + margin,
        lost.after / (abs(two.curvature) or 1.0) + margin)


def _rounding(one: Circle, two: Circle) -> float:
    """
    Return by how much rounding may change what a transition replaces [m].

    The nearer two centres are, the less exact is the direction from one to the other.
    """
    between = math.hypot(two.x - one.x, two.y - one.y)
    if not (one.curvature and two.curvature and between):
        return 0.0
    return ROUNDING * (1.0 / abs(one.curvature) + 1.0 / abs(two.curvature)) ** 2 / between


@lru_cache(REMEMBERED)
def _means(easing: float, count: int) -> tuple[float, ...]:
    """Return the mean of a ramp from 0 to 1 in each of several equal time parts."""
    means = Ramp(1.0, 1.0 / (1.0 - easing), easing, 1.0).means(1.0 / count, count)
    half = count // 2
    middle = (0.5,) if count % 2 else ()
    return (*means[:half], *middle, *(1.0 - mean for mean in reversed(means[:half])))
