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
"""The path of a goal, and what a robot's limits are along it."""

from __future__ import annotations

import math
from typing import NamedTuple

from kachaka_simple_control.motion.goals import Arc, Forward, Turn
from kachaka_simple_control.motion.limits import Limits

#: A step that says where to be.
Goal = Forward | Turn | Arc


class Way(NamedTuple):
    """
    A path with a constant curvature, in its own unit u: metres, or radians for a turn in place.

    :param distance: how long it is [u], not negative
    :param linear: metres forward for each u: 1, 0 or -1
    :param angular: radians to the left for each u
    """

    distance: float
    linear: float
    angular: float

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""
        return self.linear * self.distance

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""
        return self.angular * self.distance


class WayLimits(NamedTuple):
    """
    The limits along a path; each is positive or infinite.

    :param velocity: largest velocity [u/s]
    :param acceleration: largest acceleration [u/s^2]
    :param deceleration: largest deceleration [u/s^2]
    :param jerk: largest jerk [u/s^3]
    """

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float


def way_of(goal: Goal) -> Way:
    """
    Return the path of a goal.

    :param goal: the goal
    :returns: its path
    """
    if isinstance(goal, Forward):
        distance = float(goal.distance)
        return Way(abs(distance), math.copysign(1.0, distance), 0.0)
    angle = float(goal.angle)
    sign = math.copysign(1.0, angle)
    if isinstance(goal, Turn):
        return Way(abs(angle), 0.0, sign)
    radius = float(goal.radius)
    return Way(abs(radius * angle), sign, sign / radius)


def along(way: Way, limits: Limits) -> WayLimits:
    """
    Return what a robot's limits are along a path: the tighter of the linear and the angular ones.

    :param way: the path
    :param limits: what the robot can do
    :returns: the limits in the path's unit, (13) in docs/theory.md
    """
    forward = limits.backward_velocity if way.linear < 0.0 else limits.max_linear_velocity
    return WayLimits(
        _tighter(way, forward, limits.max_angular_velocity),
        _tighter(way, limits.max_linear_acceleration, limits.max_angular_acceleration),
        _tighter(way, limits.linear_deceleration, limits.angular_deceleration),
        _tighter(way, limits.max_linear_jerk, limits.max_angular_jerk))


def _tighter(way: Way, linear: float, angular: float) -> float:
    if not way.linear:
        return angular
    if not way.angular:
        return linear
    bend = abs(way.angular)
    limit = angular / bend
    # A velocity that rounding took beyond the limit would be refused in mid-motion.
    return min(linear, limit if limit * bend <= angular else math.nextafter(limit, 0.0))
