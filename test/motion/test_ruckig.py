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
"""The velocity profile compared with that of ruckig, which solves the same problem."""

import math

from hypothesis import assume, given
from hypothesis import strategies as st
from kachaka_simple_control.motion.velocity_profile import time_optimal_profile
from optional_libraries import optional_imports
import pytest
from strategies import or_infinite, spread

with optional_imports():
    import ruckig

pytestmark = pytest.mark.needs('ruckig')

DISTANCES = spread(1e-6, 1e4)
FINITE = spread(1e-3, 1e3)
ANY = or_infinite(FINITE)


def answered(distance, velocity, acceleration, deceleration, jerk):
    """Return the trajectory that ruckig finds from rest to rest."""
    asked = ruckig.InputParameter(1)
    asked.target_position = [distance]
    asked.max_velocity = [velocity]
    asked.max_acceleration = [acceleration]
    asked.min_acceleration = [-deceleration]
    asked.max_jerk = [jerk]
    trajectory = ruckig.Trajectory(1)
    assert ruckig.Ruckig(1).calculate(asked, trajectory) == ruckig.Result.Working
    return trajectory


@given(DISTANCES, FINITE, ANY, ANY, ANY, st.floats(0.0, 1.0))
def test_ruckig_finds_the_same_profile(
        distance, velocity, acceleration, deceleration, jerk, part):
    # With infinite jerk and acceleration ruckig leaves the deceleration out of account.
    assume(math.isfinite(jerk) or math.isfinite(max(acceleration, deceleration)))
    bounds = (velocity, acceleration, deceleration, jerk)
    ours, theirs = time_optimal_profile(distance, *bounds), answered(distance, *bounds)
    assert ours.duration == pytest.approx(theirs.duration, rel=1e-6)
    time = part * ours.duration
    position, speed, _ = theirs.at_time(time)
    assert ours.state_at(time).position == pytest.approx(position[0], abs=1e-6 * distance)
    if math.isfinite(max(acceleration, deceleration)):
        assert ours.state_at(time).velocity == pytest.approx(speed[0], abs=1e-6 * ours.velocity)
