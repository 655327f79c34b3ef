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
"""The steps of a motion, and what is refused when they are made."""

import math

from kachaka_simple_control.errors import InvalidMotionError, LimitError
from kachaka_simple_control.motion.steps import (
    Arc,
    Forward,
    MAX_NESTING,
    Motion,
    Move,
    Repeat,
    Turn,
    Wait,
)
from kachaka_simple_control.motion.waypoints import Goto
import pytest


@pytest.mark.parametrize('make, text', [
    (lambda: Move(math.nan, 0.0, 1.0), 'linear_x is nan m/s; it must be a finite number'),
    (lambda: Move(0.0, math.inf, 1.0), 'angular_z is inf rad/s; it must be a finite number'),
    (lambda: Move(0.0, 0.0, math.nan), 'duration is nan s; it must be a finite number'),
    (lambda: Move(0.0, 0.0, -0.1), 'duration is -0.1 s; it must not be negative'),
    (lambda: Move('fast', 0.0, 1.0), "linear_x is 'fast'; it must be a number [m/s]"),
    (lambda: Move(0.0, None, 1.0), 'angular_z is None; it must be a number [rad/s]'),
    (lambda: Move(0.0, 0.0, True), 'duration is True; it must be a number [s]'),
    (lambda: Move(0.0, 0.0, 10**400), 'duration is inf s; it must be a finite number'),
    (lambda: Move(-10**400, 0.0, 1.0), 'linear_x is -inf m/s; it must be a finite number'),
    (lambda: Forward(math.inf), 'distance is inf m; it must be a finite number'),
    (lambda: Forward('1 m'), "distance is '1 m'; it must be a number [m]"),
    (lambda: Forward(1.0, 0.0), 'speed is 0.0 m/s; it must be above 0 m/s'),
    (lambda: Forward(-1.0, -0.1), 'speed is -0.1 m/s; it must be above 0 m/s'),
    (lambda: Forward(1.0, math.inf), 'speed is inf m/s; it must be a finite number'),
    (lambda: Turn(math.nan), 'angle is nan rad; it must be a finite number'),
    (lambda: Turn(1.0, False), 'speed is False; it must be a number [rad/s]'),
    (lambda: Turn(1.0, -1), 'speed is -1 rad/s; it must be above 0 rad/s'),
    (lambda: Arc(0.0, 1.0),
     'radius is 0.0 m; its size must be at least 1e-06 m; to turn in place, use a turn'),
    (lambda: Arc(-1e-7, 1.0),
     'radius is -1e-07 m; its size must be at least 1e-06 m; to turn in place, use a turn'),
    (lambda: Arc(math.inf, 1.0), 'radius is inf m; it must be a finite number'),
    (lambda: Arc(1.0, math.inf), 'angle is inf rad; it must be a finite number'),
    (lambda: Arc(1.0, 1.0, 0), 'speed is 0 m/s; it must be above 0 m/s'),
    (lambda: Wait(-1), 'duration is -1 s; it must not be negative'),
    (lambda: Wait(math.inf), 'duration is inf s; it must be a finite number'),
    (lambda: Repeat(-1, ()), 'times is -1; it must be from 0 to 1000000'),
    (lambda: Repeat(1000001, ()), 'times is 1000001; it must be from 0 to 1000000'),
    (lambda: Repeat(1.0, ()), 'times is 1.0; it must be a whole number'),
    (lambda: Repeat(True, ()), 'times is True; it must be a whole number'),
    (lambda: Repeat(1, 'abc'), "steps is 'abc'; it must be a sequence of steps"),
    (lambda: Repeat(1, Wait(1)), 'steps is Wait(duration=1); it must be a sequence of steps'),
    (lambda: Repeat(1, [Wait(1), 2]),
     ('steps[1]: it is 2; it must be one of Move, Forward, Turn, Arc, Wait, Settle, Repeat, '
      'Include, Goto, Waypoints')),
    (lambda: Motion('x', [Goto((1.0, 0.0)), None]),
     ('steps[1]: it is None; it must be one of Move, Forward, Turn, Arc, Wait, Settle, Repeat, '
      'Include, Goto, Waypoints')),
    (lambda: Motion('x', (), corners=-0.05), 'corners is -0.05 m; it must not be negative'),
    (lambda: Motion('x', (), corners=1.1), 'corners is 1.1 m; it must be at most 1 m'),
    (lambda: Motion('x', (), corners=math.nan), 'corners is nan m; it must be a finite number'),
    (lambda: Motion('x', (), corners='5 cm'), "corners is '5 cm'; it must be a number [m]"),
    (lambda: Motion(1, ()), 'name is 1; it must be text'),
    (lambda: Motion('x', (), None), 'description is None; it must be text'),
])
def test_invalid_steps_are_refused(make, text):
    with pytest.raises(InvalidMotionError) as caught:
        make()
    assert text == str(caught.value)


def test_an_error_has_its_place_and_its_message():
    error = InvalidMotionError('2 m is too far', 'steps[1].forward.distance')
    assert ('2 m is too far', 'steps[1].forward.distance') == (error.message, error.path)
    assert str(error) == 'steps[1].forward.distance: 2 m is too far'
    plain = InvalidMotionError('2 m is too far')
    assert ('2 m is too far', '2 m is too far', None) == (str(plain), plain.message, plain.path)


def test_an_error_of_a_limit_can_name_whose_it_is():
    error = LimitError(0.5, 'm/s', 0.3, -0.1, whose="the robot's", name='linear_x')
    assert str(error) == "linear_x is 0.5 m/s, outside the robot's limits of -0.1 to 0.3 m/s"
    placed = error.by("the closed loop's").at('steps[1].move.linear_x')
    assert placed.message == "0.5 m/s, outside the closed loop's limits of -0.1 to 0.3 m/s"
    assert str(placed) == f'steps[1].move.linear_x: linear_x is {placed.message}'
    assert placed.by('the').path == placed.path
    assert (placed.value, placed.unit, placed.lowest, placed.highest) == (0.5, 'm/s', -0.1, 0.3)
    speed = LimitError(2.0, 'm/s', 0.3, whose='the', note=', in a curve')
    assert str(speed.by("kachaka's")) == (
        "2.0 m/s is above kachaka's limit of 0.3 m/s, in a curve")
    other = InvalidMotionError('2 m is too far', name='distance')
    assert str(other.by("the robot's")) == 'distance is 2 m is too far'


def test_repeats_may_be_nested_up_to_a_bound():
    steps = (Wait(1.0),)
    for _ in range(MAX_NESTING):
        steps = (Repeat(1, steps),)
    with pytest.raises(InvalidMotionError, match='repeats 21 deep; at most 20'):
        Repeat(1, steps)
