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
Arcs on a smaller circle: the arcs of a flow as the robot drives them.

Tested by test/motion/test_transition.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
import math
from typing import NamedTuple

from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.path_segment import limits_along, PathSegment
from kachaka_simple_control.motion.transition import Circle
from kachaka_simple_control.motion.velocity_profile import PathLimits

#: Two curvatures are equal if they differ by at most this fraction.  Between circles that differ
#: less, rounding would make a transition longer than it says: at 1e-12 by 1 %.
EQUAL = 1e-11


class RunArc(NamedTuple):
    """
    An arc of a run.

    :param segment: the path segment, as the motion has it
    :param speed: the largest velocity along it [m/s]
    :param tolerance: the largest distance allowed between it and the path [m]
    """

    segment: PathSegment
    speed: float
    tolerance: float

    @property
    def curvature(self) -> float:
        """Return the heading change for each driven metre [rad/m], positive to the left."""
        return self.segment.angular

    @property
    def angle(self) -> float:
        """Return the size of the heading change [rad]."""
        return abs(self.segment.angle)


def is_same(one: PathSegment, two: PathSegment) -> bool:
    """Return whether two path segments have the same curvature."""
    return abs(one.angular - two.angular) <= EQUAL * max(abs(one.angular), abs(two.angular))


@dataclass
class ArcGroup:
    """
    Arcs of the same curvature in succession, which are one arc on one circle.

    :param offset: by how much the radius is smaller [m]
    """

    arcs: list[RunArc]
    offset: float = 0.0

    @cached_property
    def sign(self) -> float:
        """Return 1 for an arc to the left, -1 for an arc to the right."""
        return math.copysign(1.0, self.arcs[0].curvature)

    @cached_property
    def radius(self) -> float:
        """Return the radius as the motion has it [m]."""
        return 1.0 / abs(self.arcs[0].curvature)

    @cached_property
    def angle(self) -> float:
        """Return the size of the heading change [rad]."""
        return math.fsum(arc.angle for arc in self.arcs)

    @property
    def curvature(self) -> float:
        """Return the curvature of the smaller circle [rad/m], positive to the left."""
        return self.sign / (self.radius - self.offset) if self.offset else self.arcs[0].curvature

    def segment(self, arc: RunArc) -> PathSegment:
        """Return an arc on the smaller circle."""
        if not self.offset:
            return arc.segment
        linear = arc.segment.linear
        return PathSegment(arc.angle * (self.radius - self.offset), linear, self.curvature)

    def limits(self, arc: RunArc, limits: Limits, crosses: bool) -> PathLimits:
        """
        Return the limits along an arc on the smaller circle.

        :param crosses: whether the angular velocity changes its sign in a transition of the arc
        """
        along = limits_along(self.segment(arc), limits)
        along = along._replace(velocity=min(along.velocity, arc.speed))
        if not crosses:
            return along
        least = min(limits.max_angular_acceleration, limits.angular_deceleration) / abs(
            self.curvature)
        return along._replace(acceleration=min(along.acceleration, least),
                              deceleration=min(along.deceleration, least))


def circle_of(group: ArcGroup, is_anchored: bool, side: float) -> Circle:
    """
    Return a smaller circle, seen from a transition, by formula (26) of docs/theory.md.

    :param is_anchored: whether the robot is at rest at the other end, where the circle touches the
        path; else it keeps its centre
    :param side: 1 if the circle is after the transition, -1 if it is before
    """
    if not is_anchored:
        return Circle(group.curvature, 0.0, group.sign * group.radius)
    return Circle(group.curvature, side * group.offset * math.sin(group.angle), group.sign * (
        group.radius - group.offset * math.cos(group.angle)))
