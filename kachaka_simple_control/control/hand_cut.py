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
Cut a velocity that a person wants, so that the robot still stops before what its laser sees.

Tested by test/control/test_hand_cut.py.
"""

from __future__ import annotations

from collections.abc import Sequence
import math

from kachaka_simple_control.motion.geometry import integrate, ORIGIN, Point, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.roots import bisection
from kachaka_simple_control.motion.swept_path import Outline, PointMap, SPACING, TURN_SPACING

#: How often the range of possible velocities is halved.
BISECTIONS = 12
#: A velocity that is cut to a smaller part of what is wanted is zero.
LEAST_PART = 0.05
#: Where a robot is inside its margin already, it may drive on if this brings it no nearer [m].
NEARER = 0.002


def cut(
        wanted: Velocity, points: Sequence[Point], wide: Outline, outline: Outline,
        limits: Limits, lag: float) -> Velocity:
    """
    Return the largest part of a velocity with which a robot still stops before all points.

    :param points: what a scan has seen, in the frame of the robot [m]
    :param wide: the outline of the robot with its margin
    :param outline: without
    :param lag: how long the robot drives on with the velocity before it brakes [s]
    """
    if wanted.is_zero:
        return wanted
    longest = _needed(1.0, wanted, limits, lag)
    free = _free(wanted, points, wide, outline, longest)
    if free >= longest:
        return wanted
    part = bisection(
        0.0, 1.0, lambda one: _needed(one, wanted, limits, lag) > free, BISECTIONS)[0]
    return ZERO if part < LEAST_PART else Velocity(
        part * wanted.linear_x, part * wanted.angular_z)


def _needed(part: float, wanted: Velocity, limits: Limits, lag: float) -> float:
    """
    Return the way to rest from a part of a velocity, as a time at the whole velocity [s].

    For each axis the way is v T + v^2 / 2D + v D / 2J, with lag T, deceleration D and jerk J.
    """
    brakes = [0.0]
    for value, deceleration, jerk in (
            (wanted.linear_x, limits.linear_deceleration, limits.max_linear_jerk),
            (wanted.angular_z, limits.angular_deceleration, limits.max_angular_jerk)):
        if value and math.isfinite(deceleration):
            # With little velocity the deceleration is not reached: this is too long, not short.
            brakes.append(part * (
                part * abs(value) / deceleration + deceleration / jerk) / 2.0)
    return part * lag + max(brakes)


def _free(
        wanted: Velocity, points: Sequence[Point], wide: Outline, outline: Outline,
        longest: float) -> float:
    """Return how long the robot may drive on with a velocity before its margin is touched [s]."""
    step = 1.0 / max(
        abs(wanted.linear_x) / SPACING, abs(wanted.angular_z) / TURN_SPACING, 1.0 / longest)
    reach = wide.reach + abs(wanted.linear_x) * longest
    near = [point for point in points if abs(point[0]) <= reach and abs(point[1]) <= reach]
    inside: list[Point] = []
    others: list[Point] = []
    for point in near:
        (inside if wide.contains(*point) else others).append(point)
    first = integrate(ORIGIN, wanted, step)
    if any(outline.distance(point, first) < outline.distance(point) - NEARER for point in inside):
        return 0.0
    seen, time = PointMap(others), 0.0
    while time < longest:
        following = min(time + step, longest)
        if seen.touches(wide, integrate(ORIGIN, wanted, following)):
            return time
        time = following
    return longest
