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
"""Velocities by hand that are cut before obstacles."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.hand_cut import cut
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import integrate, ORIGIN, Velocity, ZERO
from kachaka_simple_control.motion.swept_path import Outline

LIMITS = KACHAKA.limits
OUTLINE, WIDE = Outline(KACHAKA.footprint), Outline(KACHAKA.footprint, 0.05)
FRONT = KACHAKA.footprint.front
VELOCITIES = st.builds(
    Velocity, st.floats(-LIMITS.max_linear_velocity, LIMITS.max_linear_velocity),
    st.floats(-LIMITS.max_angular_velocity, LIMITS.max_angular_velocity))


def allowed(wanted, *points, lag=0.2):
    """Return what is left of a velocity."""
    return cut(wanted, points, WIDE, OUTLINE, LIMITS, lag)


def test_near_a_wall_only_little_is_left():
    wanted = Velocity(0.3)
    assert allowed(wanted) is wanted
    assert allowed(wanted, (2.0, 0.0)) is wanted
    near = allowed(wanted, (FRONT + 0.15, 0.0))
    assert 0.05 < near.linear_x < 0.25
    assert allowed(wanted, (FRONT + 0.06, 0.0)) is ZERO
    # What is beside, or behind, does not matter.
    assert allowed(wanted, (FRONT + 0.06, 0.2), (-0.5, 0.0)) is wanted


def test_curvature_is_kept():
    wanted = Velocity(0.3, 0.6)
    part = allowed(wanted, (FRONT + 0.15, 0.03))
    assert 0.0 < part.linear_x < 0.3
    assert math.isclose(part.angular_z / part.linear_x, 2.0)


def test_a_robot_within_its_margin_may_leave_but_come_no_nearer():
    wall = (FRONT + 0.03, 0.0)
    assert allowed(Velocity(0.3), wall) is ZERO
    assert allowed(Velocity(-0.3), wall) == Velocity(-0.3)
    assert allowed(Velocity(0.0, 1.0), wall) == Velocity(0.0, 1.0)
    assert allowed(Velocity(0.0, 1.0), (FRONT - 0.01, 0.14)) is ZERO


@settings(max_examples=200)
@given(VELOCITIES, st.lists(
    st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), max_size=8), st.floats(0.1, 0.7))
def test_the_robot_rests_before_its_margin_is_touched(wanted, points, lag):
    points = [point for point in points if WIDE.distance(point) > 0.0]
    velocity = allowed(wanted, *points, lag=lag)
    assert abs(velocity.linear_x) <= abs(wanted.linear_x)
    # It drives on for the lag, and brakes with its deceleration; jerk makes it longer.
    for part in range(51):
        pose = integrate(ORIGIN, velocity, lag * part / 50.0)
        assert all(WIDE.distance(point, pose) > -1e-3 for point in points)
    linear = velocity.linear_x ** 2 / LIMITS.linear_deceleration / 2.0
    angular = velocity.angular_z ** 2 / LIMITS.angular_deceleration / 2.0
    braked = max(linear / abs(velocity.linear_x) if velocity.linear_x else 0.0,
                 angular / abs(velocity.angular_z) if velocity.angular_z else 0.0)
    pose = integrate(ORIGIN, velocity, lag + braked)
    assert all(OUTLINE.distance(point, pose) > 0.0 for point in points)
