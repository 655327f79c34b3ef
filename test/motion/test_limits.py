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
"""The limits of a robot, and the velocities that they allow."""

from dataclasses import replace
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import LIMIT_QUANTITIES, Limits
import pytest

KACHAKA = Limits(0.3, 1.57)


@pytest.mark.parametrize('velocity, text', [
    (Velocity(0.31, 0.0), "linear_x is 0.31 m/s, outside the robot's limits of -0.3 to 0.3 m/s"),
    (Velocity(-0.31, 0.0), "linear_x is -0.31 m/s, outside the robot's limits of -0.3 to 0.3 m/s"),
    (Velocity(0.0, -1.6),
     "angular_z is -1.6 rad/s, outside the robot's limits of -1.57 to 1.57 rad/s"),
    (Velocity(math.nan, 0.0),
     "linear_x is nan m/s, outside the robot's limits of -0.3 to 0.3 m/s"),
    (Velocity(0.0, math.inf),
     "angular_z is inf rad/s, outside the robot's limits of -1.57 to 1.57 rad/s"),
])
def test_a_velocity_beyond_the_limits_is_refused(velocity, text):
    with pytest.raises(InvalidMotionError) as caught:
        KACHAKA.check(velocity)
    assert text == str(caught.value)


def test_backwards_may_have_a_limit_of_its_own():
    limits = replace(KACHAKA, max_backward_velocity=0.1)
    limits.check(Velocity(-0.1, 0.0))
    limits.check(Velocity(0.3, 0.0))
    with pytest.raises(InvalidMotionError, match=r'linear_x is -0.11 m/s, .* -0.1 to 0.3 m/s'):
        limits.check(Velocity(-0.11, 0.0))


@pytest.mark.parametrize('value', [math.inf, -math.inf, math.nan])
def test_without_limits_a_velocity_must_still_be_finite(value):
    limits = Limits(math.inf, math.inf)
    limits.check(Velocity(1e9, -1e9))
    with pytest.raises(InvalidMotionError, match='linear_x is'):
        limits.check(Velocity(value, 0.0))
    with pytest.raises(InvalidMotionError, match='angular_z is'):
        limits.check(Velocity(0.0, value))


def test_a_limit_that_is_not_given_equals_its_counterpart():
    limits = Limits(0.3, 1.57, 0.4, 2.0)
    assert limits.backward_velocity == 0.3
    assert limits.linear_deceleration == 0.4
    assert limits.angular_deceleration == 2.0
    other = replace(limits, max_linear_deceleration=0.8, max_angular_deceleration=math.inf)
    assert (other.linear_deceleration, other.angular_deceleration) == (0.8, math.inf)


@pytest.mark.parametrize('name', LIMIT_QUANTITIES)
@pytest.mark.parametrize('value', [0.0, -0.1, math.nan, -math.inf])
def test_limits_that_are_not_positive_are_refused(name, value):
    with pytest.raises(InvalidMotionError) as caught:
        Limits(**{'max_linear_velocity': 0.3, 'max_angular_velocity': 1.0, name: value})
    unit = LIMIT_QUANTITIES[name].unit
    assert f'{name} is {value} {unit}; it must be above 0 {unit}' == str(caught.value)


@given(st.floats(), st.floats(0.001, 10.0), st.floats(0.001, 10.0))
def test_check_compares_with_both_limits(value, forward, backward):
    limits = Limits(forward, 1.0, max_backward_velocity=backward)
    try:
        limits.check(Velocity(value, 0.0))
    except InvalidMotionError:
        assert not -backward <= value <= forward
    else:
        assert -backward <= value <= forward
