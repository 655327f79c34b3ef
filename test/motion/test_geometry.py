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
"""The unicycle: what a velocity held for a time does to a pose."""

import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.motion.geometry import integrate, ORIGIN, Pose, sinc, Velocity
import pytest

SPEEDS = st.floats(-2.0, 2.0)
TURNS = st.floats(-3.0, 3.0)
TIMES = st.floats(0.0, 10.0)


def close(one: Pose, two: Pose, tolerance: float = 1e-9) -> bool:
    """Return whether two poses are the same but for rounding."""
    return (math.hypot(one.x - two.x, one.y - two.y) <= tolerance
            and abs(one.theta - two.theta) <= tolerance)


@given(speed=SPEEDS, turn=TURNS, first=TIMES, second=TIMES)
def test_two_stretches_make_one(speed, turn, first, second):
    """Holding a velocity twice is holding it once for the sum."""
    velocity = Velocity(speed, turn)
    halfway = integrate(ORIGIN, velocity, first)
    assert close(integrate(ORIGIN, velocity, first + second),
                 integrate(halfway, velocity, second), 1e-8)


@given(speed=SPEEDS, turn=TURNS, time=TIMES)
def test_backwards_in_velocity_is_back_in_space(speed, turn, time):
    there = integrate(ORIGIN, Velocity(speed, turn), time)
    assert close(ORIGIN, integrate(there, Velocity(-speed, -turn), time), 1e-8)


@given(st.floats(-1e-3, 1e-3))
def test_sinc_is_continuous_between_series_and_quotient(angle):
    assert sinc(angle) == pytest.approx(1.0 - angle**2 / 6.0 + angle**4 / 120.0, abs=1e-15)


@given(speed=SPEEDS, time=TIMES, tiny=st.floats(1e-12, 1e-6))
def test_an_arc_that_hardly_turns_is_a_line(speed, time, tiny):
    line = integrate(ORIGIN, Velocity(speed, 0.0), time)
    arc = integrate(ORIGIN, Velocity(speed, tiny), time)
    assert close(line, arc, 3e-4)
