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
"""Goals under a robot's limits: what is sent keeps all of them, and is as quick as they allow."""

from itertools import pairwise
import math
import sys

from hypothesis import given
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Turn
import pytest
from strategies import GOALS, LIMITS, line_or_circle, RATES

#: What rounding does to a position, in parts of the distance: a few of the last bits.
NOISE = 64.0 * sys.float_info.epsilon


def speeds(goal, limits, rate):
    """Return length of a tick and the linear and angular speeds sent, with rest around them."""
    planned = plan(Motion('one', (goal,)), limits, rate)
    tick = planned.duration / max(1, len(planned.segments))
    velocities = [segment.velocity for segment in planned.segments]
    rest = [0.0, 0.0]
    return tick, *([*rest, *(abs(getattr(velocity, name)) for velocity in velocities), *rest]
                   for name in ('linear_x', 'angular_z'))


def differences(values):
    """Return how much each value is above the one before."""
    return [after - before for before, after in pairwise(values)]


@given(GOALS, LIMITS, RATES)
def test_no_limit_of_a_robot_is_broken_from_tick_to_tick(goal, limits, rate):
    """Linear and angular ones at once, with rest before and after; (12) in docs/theory.md."""
    tick, linear, angular = speeds(goal, limits, rate)
    length, _, angle = line_or_circle(goal)
    for values, distance, acceleration, deceleration, jerk in (
            (linear, length, limits.max_linear_acceleration, limits.linear_deceleration,
             limits.max_linear_jerk),
            (angular, angle, limits.max_angular_acceleration, limits.angular_deceleration,
             limits.max_angular_jerk)):
        noise = NOISE * abs(distance) / tick if tick else 0.0
        changes = differences(values)
        # The sign tells which of the two limits counts.
        assert max(changes) <= acceleration * tick * (1.0 + 1e-9) + noise or not tick
        assert -min(changes) <= deceleration * tick * (1.0 + 1e-9) + noise or not tick
        assert not tick or max(map(abs, differences(changes))) <= (
            jerk * tick * tick * (1.0 + 1e-9) + 2.0 * noise)


def cruising(length, speed, acceleration, deceleration, jerk):
    """Return the time of a path that is long enough to reach the speed and both accelerations."""
    ramps = [speed / limit + limit / jerk for limit in (acceleration, deceleration)]
    return length / speed + sum(ramps) / 2.0


@pytest.mark.parametrize('goal, expected', [
    (Forward(10.0), (10.0, 2.0, 1.0, 0.5, 4.0)),
    (Forward(-10.0), (10.0, 1.0, 1.0, 0.5, 4.0)),
    (Turn(20.0), (20.0, 3.0, 2.0, 1.5, 6.0)),
    (Arc(10.0, 1.0), (10.0, 2.0, 1.0, 0.5, 4.0)),
    (Arc(-10.0, -1.0), (10.0, 1.0, 1.0, 0.5, 4.0)),
    # On a small circle it is how quickly the robot turns that counts: radius times angular limit.
    (Arc(0.1, 100.0), (10.0, 0.3, 0.2, 0.15, 0.6)),
    # And in between the velocity of one kind, the acceleration of the other.
    (Arc(0.5, 20.0), (10.0, 1.5, 1.0, 0.5, 3.0)),
    (Forward(10.0, 0.5), (10.0, 0.5, 1.0, 0.5, 4.0)),
])
def test_a_long_path_takes_the_time_of_its_limits(goal, expected):
    limits = Limits(2.0, 3.0, 1.0, 2.0, 4.0, 6.0, 0.5, 1.5, 1.0)
    planned = plan(Motion('one', (goal,)), limits, 50.0)
    assert planned.duration == pytest.approx(cruising(*expected), rel=1e-12)
    assert math.isfinite(planned.duration)
