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
"""What is sent of a profile: means over ticks, exact in sum and within the limits."""

from itertools import pairwise
import math
import sys

from hypothesis import example, given
from hypothesis import strategies as st
from kachaka_simple_control.motion.velocity_profile import time_optimal_profile
import pytest
from strategies import or_infinite, spread

DISTANCES = spread(1e-6, 1e4)
FINITE = spread(1e-3, 1e3)
BOUNDS = st.tuples(FINITE, *[or_infinite(FINITE)] * 3)
COUNTS = st.one_of(st.integers(1, 10), st.integers(1, 500))
#: What rounding does to a position, in parts of the distance: a few of the last bits.
NOISE = 16.0 * sys.float_info.epsilon


def differences(values):
    """Return how much each value is above the one before."""
    return [after - before for before, after in pairwise(values)]


@given(DISTANCES, BOUNDS, COUNTS)
def test_the_ticks_add_up_to_the_distance(distance, bounds, count):
    profile = time_optimal_profile(distance, *bounds)
    means = profile.means(count)
    assert len(means) == count
    assert math.fsum(means) * (profile.duration / count) == pytest.approx(distance, rel=1e-12)


@given(DISTANCES, BOUNDS, COUNTS)
def test_each_tick_is_the_mean_of_the_profile_over_it(distance, bounds, count):
    profile = time_optimal_profile(distance, *bounds)
    part = profile.duration / count
    places = [profile.state_at(index * part).position for index in range(count + 1)]
    for mean, covered in zip(profile.means(count), differences(places)):
        assert mean * part == pytest.approx(covered, rel=1e-9, abs=NOISE * distance)


@given(DISTANCES, BOUNDS, COUNTS)
# What rounding alone would carry beyond it.
@example(4.27, (1.1, 1.1, 1.1, 5.0), 46)
@example(1.14, (1.2, 1.6, 1.6, math.inf), 68)
@example(2.36, (0.8, 0.5, 0.5, 2.0), 96)
def test_no_tick_is_beyond_the_velocity_or_backwards(distance, bounds, count):
    means = time_optimal_profile(distance, *bounds).means(count)
    assert max(means) <= bounds[0]
    assert min(means) >= 0.0


@given(DISTANCES, BOUNDS, COUNTS)
def test_from_tick_to_tick_the_limits_of_acceleration_hold(distance, bounds, count):
    """
    The difference of two means is a mean of the acceleration over both ticks.

    So it lies between the largest deceleration and the largest acceleration, whatever its sign;
    with rest before and after as well.
    """
    _, acceleration, deceleration, _ = bounds
    profile = time_optimal_profile(distance, *bounds)
    part = profile.duration / count
    noise = NOISE * distance / part
    for change in differences([0.0, *profile.means(count), 0.0]):
        assert change <= acceleration * part * (1.0 + 1e-9) + noise
        assert change >= -deceleration * part * (1.0 + 1e-9) - noise


@given(DISTANCES, BOUNDS, COUNTS)
def test_from_tick_to_tick_the_limit_of_jerk_holds(distance, bounds, count):
    """The second difference is a mean of the jerk over three ticks."""
    jerk = bounds[3]
    profile = time_optimal_profile(distance, *bounds)
    part = profile.duration / count
    noise = 4.0 * NOISE * distance / part
    means = [0.0, 0.0, *profile.means(count), 0.0, 0.0]
    for change in differences(differences(means)):
        assert abs(change) <= jerk * part * part * (1.0 + 1e-9) + noise


def test_within_the_cruise_every_tick_is_the_velocity_to_the_last_bit():
    means = time_optimal_profile(1000.0, 0.3, 0.3, 0.3, 1.5).means(100000)
    assert means.count(0.3) > 99800
