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
"""What a robot cannot do is found before it moves: all of it, each with its place."""

from dataclasses import replace
import math
import time

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import find_errors, MAX_SEGMENTS, MAX_STEPS, plan
from kachaka_simple_control.motion.step_base import MAX_DURATION
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Repeat, Turn, Wait
import pytest
from strategies import KACHAKA, LIMITS, MOTIONS, RATES

SLOW_BACKWARDS = replace(KACHAKA, max_backward_velocity=0.1)


def texts(limits, *steps):
    """Return the errors of some steps, as texts."""
    return [str(error) for error in find_errors(Motion('x', steps), limits)]


@pytest.mark.parametrize('limits, step, text', [
    (KACHAKA, Turn(1.0, 2.0), 'turn.speed: 2.0 rad/s is above the limit of 1.57 rad/s'),
    (KACHAKA, Forward(1.0, 0.4), 'forward.speed: 0.4 m/s is above the limit of 0.3 m/s'),
    (KACHAKA, Forward(0.0, 1), 'forward.speed: 1.0 m/s is above the limit of 0.3 m/s'),
    (SLOW_BACKWARDS, Forward(-1.0, 0.2),
     'forward.speed: 0.2 m/s is above the limit of 0.1 m/s backwards'),
    (KACHAKA, Arc(1.0, 1.0, 0.4),
     'arc.speed: 0.4 m/s is above the limit of 0.3 m/s along a radius of 1.0 m'),
    (KACHAKA, Arc(-0.1, 1.0, 0.2),
     'arc.speed: 0.2 m/s is above the limit of 0.157 m/s along a radius of -0.1 m'),
    (KACHAKA, Move(0.4, 0.0, 1.0),
     "move.linear_x: linear_x is 0.4 m/s, outside the robot's limits of -0.3 to 0.3 m/s"),
    (SLOW_BACKWARDS, Move(-0.2, 0.0, 1.0),
     "move.linear_x: linear_x is -0.2 m/s, outside the robot's limits of -0.1 to 0.3 m/s"),
    (KACHAKA, Move(0.0, -2, 1.0),
     "move.angular_z: angular_z is -2.0 rad/s, outside the robot's limits of -1.57 to 1.57 rad/s"),
    (KACHAKA, Wait(1e5),
     'wait.duration: 100000.0 s is too long; a motion may take 86400 s at most'),
    (KACHAKA, Move(0.0, 0.0, 1e5),
     'move.duration: 100000.0 s is too long; a motion may take 86400 s at most'),
    (KACHAKA, Forward(3e5),
     'forward.distance: 300000.0 m takes 1000000 s; a motion may take 86400 s at most'),
    (KACHAKA, Turn(-1.57e6),
     'turn.angle: -1570000.0 rad takes 1000000 s; a motion may take 86400 s at most'),
    (KACHAKA, Arc(1e300, 1e300),
     'arc.angle: 1e+300 rad takes inf s; a motion may take 86400 s at most'),
    (replace(KACHAKA, max_linear_acceleration=1e-9), Forward(10.0),
     'forward.distance: 10.0 m takes 200000 s; a motion may take 86400 s at most'),
    (Limits(math.inf, 1.0), Forward(1.0),
     'forward.speed: it is not given, and the robot has no limit either; give one'),
    (Limits(1.0, math.inf), Turn(1.0),
     'turn.speed: it is not given, and the robot has no limit either; give one'),
    (Limits(math.inf, math.inf), Arc(1.0, 1.0),
     'arc.speed: it is not given, and the robot has no limit either; give one'),
])
def test_an_error_has_place_value_and_bound(limits, step, text):
    assert texts(limits, Wait(1.0), step) == [f'steps[1].{text}']


@pytest.mark.parametrize('limits, step', [
    (KACHAKA, Turn(100.0, 1.57)),
    (KACHAKA, Forward(-0.5, 0.3)),
    (SLOW_BACKWARDS, Forward(0.5, 0.3)),
    (SLOW_BACKWARDS, Arc(0.5, -1.0, 0.1)),
    (KACHAKA, Arc(0.1, 1.0, 0.157)),  # 1.57 * 0.1 rounds to a little more
    (KACHAKA, Arc(0.181, 1.0, 1.57 * 0.181)),  # and this product as well, divided again
    (KACHAKA, Arc(0.7, 1.0, 0.3)),
    (KACHAKA, Wait(MAX_DURATION)),
    (Limits(math.inf, 1.0), Forward(1.0, 100.0)),
    (Limits(math.inf, math.inf, max_linear_jerk=1.0), Forward(1.0)),
    (Limits(math.inf, math.inf, max_linear_deceleration=1.0), Forward(1.0)),
    (Limits(math.inf, 1.0), Arc(1.0, 1.0)),
])
def test_what_is_just_possible_is_allowed(limits, step):
    assert texts(limits, step) == []
    assert plan(Motion('x', (step,)), limits, 10.0).duration > 0.0


def test_all_errors_are_found_in_the_order_of_the_motion_and_planning_raises_the_first():
    motion = Motion('bad', (
        Wait(1.0),
        Move(0.4, 2.0, 1.0),
        Repeat(3, (Forward(1.0), Repeat(2, (Wait(0.0), Turn(1.0, 2.0))), Forward(1.0, 9.0))),
        Turn(1.0, 3.0)))
    errors = find_errors(motion, KACHAKA)
    assert [error.path for error in errors] == [
        'steps[1].move.linear_x',
        'steps[1].move.angular_z',
        'steps[2].repeat.steps[1].repeat.steps[1].turn.speed',
        'steps[2].repeat.steps[2].forward.speed',
        'steps[3].turn.speed']
    assert [error.message for error in errors][-1] == '3.0 rad/s is above the limit of 1.57 rad/s'
    with pytest.raises(InvalidMotionError) as caught:
        plan(motion, KACHAKA, 10.0)
    assert str(errors[0]) == str(caught.value)


def test_no_motion_has_more_steps_than_a_million():
    assert texts(KACHAKA, Repeat(MAX_STEPS, (Wait(0.0),))) == []
    assert texts(KACHAKA, Repeat(MAX_STEPS, (Wait(0.0),)), Wait(0.0)) == [
        'the motion has 1000001 steps, its repeats counted; it may have 1000000 at most']


def test_repeats_beyond_all_bounds_are_refused_at_once():
    """Their steps are counted without being planned."""
    steps = (Wait(1.0),)
    for _ in range(20):
        steps = (Repeat(1_000_000, steps),)
    begin = time.monotonic()
    assert texts(KACHAKA, *steps) == [
        'the motion has 1e+120 steps, its repeats counted; it may have 1000000 at most',
        'the motion takes 1e+120 s, its repeats counted; it may take 86400 s at most']
    steps = (Repeat(0, (Wait(1.0),)),)
    for _ in range(19):
        steps = (Repeat(1_000_000, steps),)
    assert plan(Motion('nothing', steps), KACHAKA, 10.0).segments == ()
    assert time.monotonic() - begin < 1.0


def test_a_plan_has_no_more_segments_than_memory_can_hold():
    day = Motion('day', (Forward(0.3 * 80_000),))
    assert find_errors(day, KACHAKA) == []
    with pytest.raises(InvalidMotionError, match=(
            rf'needs 80001200 velocities at 1000.0 Hz; it may have {MAX_SEGMENTS} at most: '
            'take a lower rate')):
        plan(day, KACHAKA, 1000.0)


@pytest.mark.parametrize('rate, text', [
    (0.0, 'rate is 0.0 Hz; it must be above 0 Hz'),
    (-10, 'rate is -10 Hz; it must be above 0 Hz'),
    (math.inf, 'rate is inf Hz; it must be a finite number'),
    (math.nan, 'rate is nan Hz; it must be a finite number'),
    ('fast', "rate is 'fast'; it must be a number [Hz]"),
])
def test_an_invalid_rate_is_refused(rate, text):
    with pytest.raises(InvalidMotionError) as caught:
        plan(Motion('none', ()), KACHAKA, rate)
    assert text == str(caught.value)


@given(MOTIONS, LIMITS, RATES, st.floats(0.01, 20.0))
def test_a_motion_can_be_planned_exactly_if_no_error_is_found(motion, limits, rate, speed):
    motion = replace(motion, steps=(*motion.steps, Forward(-1.0, speed), Arc(0.2, 1.0, speed)))
    errors = find_errors(motion, limits)
    if errors:
        with pytest.raises(InvalidMotionError) as caught:
            plan(motion, limits, rate)
        assert str(errors[0]) == str(caught.value)
    else:
        assert plan(motion, limits, rate).steps
