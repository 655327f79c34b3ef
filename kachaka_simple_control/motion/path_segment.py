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
Path segments of constant curvature, and the limits along them.

Tested by test/motion/test_plan.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.velocity_profile import PathLimits


class PathSegment(NamedTuple):
    """
    A part of a path; its curvature is constant.

    The unit u of its length is m, or rad for a turn in place.  For a step that holds a velocity
    for a time, it is s: the length is the planned duration, ``linear`` and ``angular`` are
    velocities.

    :param distance: the length of the segment [u], not negative
    :param linear: metres forwards for each u [m/u], negative backwards: 1 or -1 on a line
    :param angular: radians to the left for each u [rad/u]: 1 or -1 in a turn in place
    """

    distance: float
    linear: float
    angular: float

    @property
    def is_rest(self) -> bool:
        """Return whether the robot stands still during the whole path segment."""
        return not (self.linear or self.angular)

    @property
    def length(self) -> float:
        """Return how far the robot drives in the path segment [m], negative backwards."""
        return self.linear * self.distance

    @property
    def angle(self) -> float:
        """Return the heading change in the path segment [rad], positive to the left."""
        return self.angular * self.distance

    def velocity(self, rate: float) -> Velocity:
        """Convert a velocity along the path segment to the velocity of the robot."""
        return Velocity(self.linear * rate, self.angular * rate)


def limits_along(segment: PathSegment, limits: Limits) -> PathLimits:
    """
    Return the limits along a path segment [u/s, u/s^2 and u/s^3].

    The lower one of the linear and the angular limit counts: formulas (13) and (17) of
    docs/theory.md.

    :returns: all are infinite if the robot stands still during the segment
    """
    forward = limits.backward_velocity if segment.linear < 0.0 else limits.max_linear_velocity
    return PathLimits(
        _tighter(segment, forward, limits.max_angular_velocity),
        _tighter(segment, limits.max_linear_acceleration, limits.max_angular_acceleration),
        _tighter(segment, limits.linear_deceleration, limits.angular_deceleration),
        _tighter(segment, limits.max_linear_jerk, limits.max_angular_jerk))


def _tighter(segment: PathSegment, linear: float, angular: float) -> float:
    return min(_along(linear, abs(segment.linear)), _along(angular, abs(segment.angular)))


def _along(limit: float, rate: float) -> float:
    if not rate:
        return math.inf
    along = limit / rate
    # If rounding raised a velocity above its limit, it would be refused during the motion.
    return along if along * rate <= limit else math.nextafter(along, 0.0)
