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
"""A slower motion is the same motion with its time axis stretched."""

from __future__ import annotations

from dataclasses import replace
import math

from hypothesis import assume, given
from hypothesis import strategies as st
from kachaka_simple_control.control.speed_factor import MIN_SPEED_FACTOR
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion import units
from kachaka_simple_control.motion.calibration import Calibration
from kachaka_simple_control.motion.limits import LIMIT_QUANTITIES, Limits
from kachaka_simple_control.motion.plan import find_errors, plan
from kachaka_simple_control.motion.steps import (
    Arc,
    Forward,
    Motion,
    Move,
    Repeat,
    Settle,
    SETTLE_TIME,
    Turn,
    Wait,
)
from kachaka_simple_control.motion.time_scale import MIN_FACTOR, slowed
from kachaka_simple_control.motion.waypoints import Goto, Waypoints
from plans import GENTLE, LESSON, SQUARE
import pytest
from strategies import LIMITS, MOTIONS, RATES

FACTORS = st.floats(0.01, 1.0)
#: With corners that are cut, which depend on the rate.
FLOWS = [
    replace(SQUARE, corners=0.05),
    Motion('eight', [Arc(0.3, math.pi), Arc(-0.3, math.tau), Arc(0.3, math.pi)], corners=0.004),
    Motion('route', [
        Waypoints([(1.0, 0.0), (1.0, 1.0), (0.3, 1.2)], speed=0.2, corners=0.1), Wait(1.0),
        Goto((0.0, 0.0), heading=0.0, speed=0.25)]),
]


def assert_is_stretched(motion: Motion, limits: Limits, rate: float, factor: float) -> None:
    """Compare the plan of a slowed motion with the stretched plan of the motion."""
    one = plan(motion, limits, rate)
    two = plan(slowed(motion, factor), limits.slowed(factor), rate * factor)
    assert len(two.segments) == len(one.segments)
    for before, after in zip(one.segments, two.segments):
        assert after.start * factor == pytest.approx(before.start, rel=1e-9, abs=1e-9)
        assert after.end * factor == pytest.approx(before.end, rel=1e-9, abs=1e-9)
        for name in ('linear_x', 'angular_z'):
            assert getattr(after.velocity, name) / factor == pytest.approx(
                getattr(before.velocity, name), rel=1e-6, abs=1e-8)
    assert [step.path for step in two.steps] == [step.path for step in one.steps]
    for before, after in zip(one.steps, two.steps):
        assert after.duration * factor == pytest.approx(before.duration, rel=1e-9, abs=1e-9)
        assert after.length == pytest.approx(before.length, rel=1e-9, abs=1e-9)
        for name in ('x', 'y', 'theta'):
            assert getattr(after.pose, name) == pytest.approx(
                getattr(before.pose, name), rel=1e-9, abs=1e-8)


@given(MOTIONS, LIMITS, RATES, FACTORS)
def test_the_plan_is_the_same_with_its_time_axis_stretched(motion, limits, rate, factor):
    assume(not find_errors(motion, limits))
    assert_is_stretched(motion, limits, rate, factor)


@pytest.mark.parametrize('motion', FLOWS, ids=lambda motion: motion.name)
@pytest.mark.parametrize('factor', [0.01, 0.3, 0.999])
def test_corners_are_cut_on_the_same_path(motion, factor):
    assert_is_stretched(motion, GENTLE, 20.0, factor)


@given(MOTIONS, LIMITS, FACTORS)
def test_a_motion_that_can_be_driven_can_be_driven_slower(motion, limits, factor):
    assume(not find_errors(motion, limits))
    assert not find_errors(slowed(motion, factor), limits.slowed(factor))


def test_at_the_same_rate_each_step_takes_longer():
    one, two = plan(SQUARE, GENTLE, 10.0), plan(slowed(SQUARE, 0.25), GENTLE.slowed(0.25), 10.0)
    assert two.duration == pytest.approx(4.0 * one.duration, rel=1e-12)
    assert len(two.segments) > 3 * len(one.segments)


def test_at_full_speed_it_is_the_same_motion():
    assert slowed(SQUARE, 1.0) is SQUARE
    assert GENTLE.slowed(1.0) == GENTLE


def test_every_value_changes_by_the_power_of_seconds_in_its_unit():
    motion = Motion('all', [
        Move(0.1, -0.5, 1.5), Forward(-0.5, 0.2), Forward(0.5), Turn(1.0, 0.8), Arc(0.3, 2.0, 0.1),
        Wait(2.0), Settle(1.0),
        Repeat(3, [Wait(1.0), Repeat(2, [Move(0.2, 0.0, 1.0)])]),
        Goto((1.0, 0.5), 0.1, 0.2), Waypoints([(1.0, 0.0), (0.0, 0.0)], 0.1, 0.2, 0.05)],
        'of each', 0.03)
    assert slowed(motion, 0.5) == Motion('all', [
        Move(0.05, -0.25, 3.0), Forward(-0.5, 0.1), Forward(0.5), Turn(1.0, 0.4),
        Arc(0.3, 2.0, 0.05), Wait(4.0), Settle(2.0),
        Repeat(3, [Wait(2.0), Repeat(2, [Move(0.1, 0.0, 2.0)])]),
        Goto((1.0, 0.5), 0.1, 0.1), Waypoints([(1.0, 0.0), (0.0, 0.0)], 0.1, 0.1, 0.05)],
        'of each', 0.03)


@pytest.mark.parametrize('quantity, power', [
    (units.LENGTH, 0), (units.ANGLE, 0), (units.TOLERANCE, 0), (units.VEER, 0), (units.TIME, 1),
    (units.FREQUENCY, -1), (units.LINEAR_VELOCITY, -1), (units.POSITIVE_ANGULAR_VELOCITY, -1),
    (units.LINEAR_ACCELERATION, -2), (units.ANGULAR_ACCELERATION, -2), (units.LINEAR_JERK, -3),
    (units.ANGULAR_JERK, -3)], ids=lambda value: getattr(value, 'name', value))
def test_a_unit_says_the_power_of_seconds(quantity, power):
    assert quantity.time_power == power
    assert quantity.slowed(3.0, 0.5) == 3.0 * 0.5 ** -power


def test_limits_are_slowed_by_the_same_powers():
    limits = Limits(0.4, 2.0, 0.8, math.inf, 4.0, 8.0, 1.6, None, 0.2)
    assert limits.slowed(0.5) == Limits(0.2, 1.0, 0.2, math.inf, 0.5, 1.0, 0.4, None, 0.1)
    assert {quantity.time_power for quantity in LIMIT_QUANTITIES.values()} == {-1, -2, -3}


@pytest.mark.parametrize('factor', [0.0, 0.009, 1.001, -1.0, math.nan, math.inf])
def test_a_factor_out_of_range_is_refused(factor):
    with pytest.raises(InvalidMotionError, match='^speed is '):
        slowed(SQUARE, factor)


def test_the_smallest_factor_is_that_of_a_drive():
    assert MIN_FACTOR == MIN_SPEED_FACTOR


def test_a_time_that_becomes_infinite_is_refused():
    with pytest.raises(InvalidMotionError, match='duration is inf s'):
        slowed(Motion([Wait(1e307)]), 0.01)


@pytest.mark.needs('yaml', 'jsonschema')
def test_an_order_keeps_the_limits_of_the_robot_and_slows_those_of_the_plan():
    square = find('square')
    order, slow = square.order(KACHAKA, 10.0, False), square.order(KACHAKA, 10.0, False, 0.5)
    assert slow.allowed == order.allowed == KACHAKA.limits
    assert slow.limits == KACHAKA.limits.slowed(0.5)
    assert slow.plan.duration == pytest.approx(2.0 * order.plan.duration, rel=1e-12)
    assert slow.plan.max_linear_velocity <= 0.15


def test_the_settle_of_a_closed_loop_is_slowed_as_well():
    robot = replace(KACHAKA, calibration=Calibration(delay=0.2))
    slow = MotionFile(LESSON, 'lesson').order(robot, 10.0, True, 0.5)
    assert slow.motion.steps[-1] == Settle(2.0 * SETTLE_TIME)
    assert slow.plan.duration == 2.0 * (9.0 + SETTLE_TIME)
    assert slow.limits == robot.planning_limits.slowed(0.5).scaled(0.9)
