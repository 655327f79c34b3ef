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
"""How the rest of a path is planned anew: within the limits, exactly to its end, as by ruckig."""

import math

from hypothesis import assume, given
from hypothesis import strategies as st
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.path_segment import limits_along, PathSegment
from kachaka_simple_control.motion.replanning import replan_through, replan_to_rest
from kachaka_simple_control.motion.trajectory import ProfiledPath
from kachaka_simple_control.motion.velocity_profile import (
    PathLimits,
    PathState,
    time_optimal_profile,
)
from optional_libraries import optional_imports
import pytest
from strategies import or_infinite, spread

with optional_imports():
    import ruckig

FINITE = spread(1e-2, 1e2)
DISTANCES = spread(1e-4, 1e2)
FACTORS = st.just(0.0) | st.just(1.0) | st.floats(0.01, 1.0)
PARTS = st.floats(0.0, 1.0)
LIMITS = st.builds(PathLimits, FINITE, or_infinite(FINITE), or_infinite(FINITE),
                   or_infinite(FINITE))
#: The limits of a robot as in docs/theory.md: 0.3 m/s, 0.5 m/s^2, 2 m/s^3.
GENTLE = PathLimits(0.3, 0.5, 0.5, 2.0)


def profiled(distance, limits):
    """Return a path that is driven from rest to rest."""
    return ProfiledPath(
        PathSegment(distance, 1.0, 0.0), limits, time_optimal_profile(distance, *limits))


def chain(path, changes):
    """Return (state, factor, what is planned) for factors that change at parts of the time."""
    state, planned, factor = path.state_at(0.0), None, 1.0
    for part, factor in changes:
        if planned is None:
            state = path.state_at(part * path.duration)
        else:
            state = planned.state_at(part * planned.duration)
        planned = path.replanned(state, factor)
        yield state, factor, planned


@given(DISTANCES, LIMITS, st.lists(st.tuples(PARTS, FACTORS), min_size=1, max_size=6))
def test_no_limit_is_exceeded_and_nothing_goes_back(distance, limits, changes):
    path = profiled(distance, limits)
    top = path.profile.velocity
    for state, factor, planned in chain(path, changes):
        roundness = 1e-9 * top
        before = state
        for phase in planned.phases:
            after = phase.end
            assert -roundness <= after.velocity <= top + roundness
            assert after.position >= before.position - 1e-9 * distance
            assert phase.start.position == pytest.approx(before.position, abs=1e-9 * distance)
            for acceleration in (phase.start.acceleration, after.acceleration):
                assert acceleration <= limits.acceleration * (1.0 + 1e-9) + 1e-9
                assert acceleration >= -limits.deceleration * (1.0 + 1e-9) - 1e-9
            assert abs(phase.jerk) <= limits.jerk
            before = after
        assert before.position == pytest.approx(planned.end.position, abs=1e-9 * distance)
        assert planned.end.position == distance or (
            factor == 0.0 and planned.end.position < distance)


@given(DISTANCES, LIMITS, st.lists(st.tuples(PARTS, FACTORS), min_size=1, max_size=6))
def test_the_velocity_does_not_jump_where_an_acceleration_limits_it(distance, limits, changes):
    assume(math.isfinite(max(limits.acceleration, limits.deceleration)))
    path = profiled(distance, limits)
    for state, _, planned in chain(path, changes):
        velocities = [state.velocity]
        for phase in planned.phases:
            velocities += [phase.start.velocity, phase.end.velocity]
        velocities.append(planned.end.velocity)
        for one, two in zip(velocities[0::2], velocities[1::2]):
            assert one == pytest.approx(two, abs=1e-6 * path.profile.velocity)


def test_a_pause_in_cruise_takes_the_distance_and_the_time_of_the_closed_form():
    """v^2 / 2 D + v D / 2 J and v / D + D / J, as in docs/theory.md: 0.1275 m from 0.3 m/s."""
    planned = replan_to_rest(PathState(0.4, 0.3), 2.0, 0.0, GENTLE)
    assert planned.end.position - 0.4 == pytest.approx(0.1275, abs=1e-12)
    assert planned.duration == pytest.approx(0.3 / 0.5 + 0.5 / 2.0, abs=1e-12)
    assert planned.end == PathState(planned.end.position)


def test_a_pause_in_the_last_ramp_is_that_ramp():
    path = profiled(1.0, GENTLE)
    for left in (0.5, 0.2, 0.01):
        state = path.state_at(path.duration - left)
        planned = path.replanned(state, 0.0)
        assert planned.end == PathState(1.0)
        assert planned.duration == pytest.approx(left, abs=1e-6)


@given(st.floats(0.0, 1.0), FACTORS, FACTORS)
def test_a_clock_reaches_its_factor_and_passes_the_end(part, first, second):
    """A velocity for a time: 2 s, with 0.5 a second of change a second."""
    limits = PathLimits(math.inf, 0.5, 0.8, 3.0)
    begun = replan_through(PathState(0.0, first), 2.0, first or 1.0, limits)
    state = begun.state_at(part * begun.duration)
    planned = replan_through(state, 2.0, second, limits)
    for phase in planned.phases:
        assert -0.8 - 1e-9 <= phase.end.acceleration <= 0.5 + 1e-9
    if second:
        assert planned.end.position == 2.0
    else:
        assert planned.end.velocity == 0.0 or planned.end.position == 2.0


def test_the_clock_of_a_velocity_has_the_tighter_of_its_limits():
    limits = Limits(0.3, 1.0, 0.5, 1.0, 2.0, 4.0)
    along = limits_along(PathSegment(3.0, 0.2, 0.5), limits)
    assert along.acceleration == min(0.5 / 0.2, 1.0 / 0.5)
    assert along.jerk == min(2.0 / 0.2, 4.0 / 0.5)


def asked(state, limits):
    """Return a question to ruckig from a state."""
    question = ruckig.InputParameter(1)
    question.current_position = [state.position]
    question.current_velocity = [state.velocity]
    question.current_acceleration = [state.acceleration]
    question.max_acceleration = [limits.acceleration]
    question.min_acceleration = [-limits.deceleration]
    question.max_jerk = [limits.jerk]
    return question


FINITE_LIMITS = st.builds(PathLimits, FINITE, FINITE, FINITE, FINITE)


@pytest.mark.needs('ruckig')
@given(DISTANCES, FINITE_LIMITS, PARTS)
def test_ruckig_brakes_as_we_do(distance, limits, part):
    path = profiled(distance, limits)
    state = path.state_at(part * path.duration)
    planned = path.replanned(state, 0.0)
    question = asked(state, limits)
    question.control_interface = ruckig.ControlInterface.Velocity
    question.max_velocity = [limits.velocity]
    answer = ruckig.Trajectory(1)
    assert ruckig.Ruckig(1).calculate(question, answer) == ruckig.Result.Working
    assert planned.duration == pytest.approx(answer.duration, rel=1e-6, abs=1e-6)
    if planned.end.position < distance:
        reached, _, _ = answer.at_time(answer.duration)
        assert planned.end.position == pytest.approx(reached[0], abs=1e-6 * distance)


@pytest.mark.needs('ruckig')
@given(DISTANCES, FINITE_LIMITS, PARTS)
def test_ruckig_resumes_as_we_do(distance, limits, part):
    """From rest anywhere, and from any state of the plan, to the end as planned."""
    path = profiled(distance, limits)
    for state in (PathState(part * 0.999 * distance), path.state_at(part * 0.9 * path.duration)):
        planned = path.replanned(state, 1.0)
        question = asked(state, limits)
        question.target_position = [distance]
        # A little more: at the edge of the limit rounding makes ruckig brake first.
        question.max_velocity = [path.profile.velocity * (1.0 + 1e-9)]
        answer = ruckig.Trajectory(1)
        assert ruckig.Ruckig(1).calculate(question, answer) == ruckig.Result.Working
        assert planned.duration == pytest.approx(answer.duration, rel=1e-4, abs=1e-6)
