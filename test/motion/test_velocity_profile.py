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
"""The quickest profile: exact, within its limits, and as quick as they allow."""

from itertools import pairwise
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.velocity_profile import time_optimal_profile
import pytest
from strategies import or_infinite, spread

DISTANCES = spread(1e-6, 1e4)
FINITE = spread(1e-3, 1e3)
ANY = or_infinite(FINITE)
PARTS = st.floats(0.0, 1.0)
#: Velocity, acceleration, deceleration, jerk.
BOUNDS = st.tuples(FINITE, ANY, ANY, ANY)
SMOOTH = st.tuples(FINITE, FINITE, FINITE, FINITE)


def pieces(profile):
    """Return begin and end of each piece of a profile that is more than rounding."""
    rise, fall, end = profile.rise, profile.fall, profile.duration
    marks = sorted((
        0.0, rise.easing, rise.duration - rise.easing, rise.duration,
        end - fall.duration, end - fall.duration + fall.easing, end - fall.easing, end))
    return [(start, stop) for start, stop in pairwise(marks) if stop - start > 1e-6 * end]


@given(DISTANCES, BOUNDS)
def test_it_begins_at_zero_and_ends_at_the_distance_to_the_last_bit(distance, bounds):
    profile = time_optimal_profile(distance, *bounds)
    assert profile.state_at(0.0).position == 0.0
    assert profile.state_at(profile.duration).position == distance
    assert profile.state_at(-1.0).position == 0.0
    assert profile.state_at(profile.duration + 1.0).position == distance
    assert profile.state_at(profile.duration).velocity == 0.0
    assert profile.state_at(-1.0).velocity == profile.state_at(-1.0).acceleration == 0.0
    assert profile.state_at(profile.duration).acceleration == 0.0


@given(DISTANCES, BOUNDS, PARTS)
def test_it_keeps_within_its_limits_at_every_time(distance, bounds, part):
    velocity, acceleration, deceleration, _ = bounds
    profile = time_optimal_profile(distance, *bounds)
    time = part * profile.duration
    assert 0.0 < profile.duration < math.inf
    state = profile.state_at(time)
    assert -1e-12 * distance <= state.position <= distance * (1.0 + 1e-12)
    assert -1e-9 * velocity <= state.velocity <= velocity
    assert -deceleration <= state.acceleration <= acceleration


@given(DISTANCES, SMOOTH)
def test_its_acceleration_changes_no_faster_than_the_jerk(distance, bounds):
    profile = time_optimal_profile(distance, *bounds)
    for start, end in pieces(profile):
        # Inside of each piece, where rounding of a mark does not matter.
        times = [start + (end - start) * part for part in (0.1, 0.9)]
        before, after = (profile.state_at(time).acceleration for time in times)
        noise = 1e-12 * max(bounds[1:3])
        assert abs(after - before) <= bounds[3] * (times[1] - times[0]) * (1.0 + 1e-6) + noise


@given(DISTANCES, BOUNDS)
def test_positions_are_the_sum_of_velocities_and_those_of_accelerations(distance, bounds):
    """Simpson's rule is exact for the parabolas that velocities are made of."""
    profile = time_optimal_profile(distance, *bounds)
    for start, end in pieces(profile):
        half = (start + end) / 2.0
        # Velocities just within the piece: at its ends those of a rectangle jump.
        inner = [start + (end - start) * part for part in (1e-9, 1.0 - 1e-9)]
        first, middle, last = (
            profile.state_at(time).velocity for time in (inner[0], half, inner[1]))
        area = (first + 4.0 * middle + last) / 6.0 * (end - start)
        covered = profile.state_at(end).position - profile.state_at(start).position
        assert covered == pytest.approx(area, rel=1e-7, abs=1e-8 * distance)
        gained = profile.state_at(half).acceleration * (inner[1] - inner[0])
        assert last - first == pytest.approx(gained, rel=1e-7, abs=1e-8 * profile.velocity)


@given(DISTANCES, FINITE, ANY, ANY)
def test_without_a_limit_of_jerk_it_is_the_trapezoid_of_the_textbooks(
        distance, velocity, acceleration, deceleration):
    slowness = 1.0 / acceleration + 1.0 / deceleration
    ramps = velocity * velocity * slowness / 2.0
    expected = (distance / velocity + velocity * slowness / 2.0 if ramps <= distance
                else math.sqrt(2.0 * distance * slowness))
    profile = time_optimal_profile(distance, velocity, acceleration, deceleration)
    assert profile.duration == pytest.approx(expected, rel=1e-12)


@given(DISTANCES, FINITE)
def test_with_a_limit_of_jerk_alone_it_takes_the_textbooks_time(distance, jerk):
    """Four equal parts of jerk, up, down, down and up: s = 2 j (t / 4)^3."""
    profile = time_optimal_profile(distance, math.inf, jerk=jerk)
    assert profile.duration == pytest.approx(4.0 * math.pow(distance / (2.0 * jerk), 1.0 / 3.0))


@pytest.mark.parametrize('bounds, peak, duration', [
    # Ramps of a time v / a + a / j, or 2 sqrt(v / j) where a is not reached.
    ((2.0, 1.0, 1.0, 1.0), 2.0, 10.0 / 2.0 + 3.0),
    ((9.0, 1.0, 1.0, 1.0), (math.sqrt(41.0) - 1.0) / 2.0, math.sqrt(41.0) + 1.0),
    ((1.0, 9.0, 9.0, 1.0), 1.0, 10.0 / 1.0 + 2.0),
    ((2.0, 1.0, 9.0, 1.0), 2.0, 10.0 / 2.0 + (3.0 + 2.0 * math.sqrt(2.0)) / 2.0),
])
def test_some_profiles_are_those_computed_by_hand(bounds, peak, duration):
    profile = time_optimal_profile(10.0, *bounds)
    assert profile.velocity == pytest.approx(peak)
    assert profile.duration == pytest.approx(duration)


@given(DISTANCES, SMOOTH, PARTS)
def test_with_acceleration_and_deceleration_exchanged_it_is_reversed_in_time(
        distance, bounds, part):
    velocity, acceleration, deceleration, jerk = bounds
    there = time_optimal_profile(distance, velocity, acceleration, deceleration, jerk)
    back = time_optimal_profile(distance, velocity, deceleration, acceleration, jerk)
    time = part * there.duration
    assert back.duration == pytest.approx(there.duration, rel=1e-12)
    assert back.state_at(back.duration - time).position == pytest.approx(
        distance - there.state_at(time).position, abs=1e-9 * distance)


@given(DISTANCES, BOUNDS, spread(1e-3, 1e3), spread(1e-3, 1e3))
def test_the_profile_does_not_depend_on_the_units(distance, bounds, length, time):
    """Millimetres or miles, seconds or minutes: the drive is the same."""
    velocity, acceleration, deceleration, jerk = bounds
    square, cube = time * time, time * time * time
    other = time_optimal_profile(
        distance * length, velocity * length / time, acceleration * length / square,
        deceleration * length / square, jerk * length / cube)
    assert other.duration == pytest.approx(
        time_optimal_profile(distance, *bounds).duration * time, rel=1e-9)


@given(st.floats(5e-324, 1e-6), BOUNDS)
def test_the_smallest_distances_stay_within_the_limits(distance, bounds):
    profile = time_optimal_profile(distance, *bounds)
    for part in (0.0, 0.3, 0.7, 1.0):
        state = profile.state_at(part * profile.duration)
        assert 0.0 <= state.position <= distance * (1.0 + 1e-12)
        assert 0.0 <= state.velocity <= bounds[0]


def test_a_profile_without_limits_is_refused():
    with pytest.raises(InvalidMotionError, match='nothing limits the velocity'):
        time_optimal_profile(1.0, math.inf)
