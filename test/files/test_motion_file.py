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
"""Motion files: what is read, in which line it stands, and that writing loses nothing."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from fractions import Fraction
import math

from golden import answers, compare
from hypothesis import example, given, settings
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import load, loads
from kachaka_simple_control.files.motion_writer import dump
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Repeat, Turn, Wait
from kachaka_simple_control.motion.waypoints import Goto, Waypoints
from motion_texts import EVERYTHING, MOTIONS
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

KACHAKA = Limits(0.3, 1.57)


@pytest.fixture(params=['CSafeLoader', 'SafeLoader'])
def any_loader(request, monkeypatch):
    """Use PyYAML's parser in C, and then the one in Python, which some machines have alone."""
    import yaml
    if request.param == 'SafeLoader':
        monkeypatch.delattr(yaml, 'CSafeLoader', raising=False)
    elif not hasattr(yaml, 'CSafeLoader'):
        pytest.skip('PyYAML has no parser in C here')


def only_step(text: str) -> object:
    """Return the step of a motion that has one."""
    return loads(f'steps:\n  - {text}\n').motion.steps[0]


@pytest.mark.usefixtures('any_loader')
def test_every_kind_of_step_is_read():
    file = loads(EVERYTHING, 'everything.yaml')
    assert file.motion == Motion('everything', (
        Forward(0.5), Turn(math.pi / 2), Arc(0.3, math.pi, 0.15), Move(0.1, 0.0, 1.0), Wait(2.0),
        Forward(-0.2, 0.1), Turn(-1.0, math.pi / 4), Wait(0.5),
        Repeat(4, (Wait(60.0), Repeat(0, ()))),
        Goto((1.0, 0.5)), Goto((0.0, -0.5), 0.0, 0.2), Waypoints(((1.0, 0.0),)),
        Waypoints(((1.0, 1.0), (0.0, 1.0)), math.pi / 2, 0.2, 0.1),
    ), 'One of each.', 0.05)
    assert (file.robot, file.rate, file.source, file.corners) == (
        'kachaka', 20.0, 'everything.yaml', 0.05)
    assert file.limits == {'max_linear_velocity': 0.2, 'max_angular_jerk': math.pi / 2}


@pytest.mark.parametrize('text, step', [
    ('wait: 1e3', Wait(1000.0)),  # PyYAML alone takes this for text
    ('wait: "2 s"', Wait(2.0)),
    ('wait: "2"', Wait(2.0)),
    ('wait: +2.', Wait(2.0)),
    ('wait: 0', Wait(0.0)),
    ("{'turn': 90 deg}", Turn(math.pi / 2)),
    ('turn: -1 rad', Turn(-1.0)),
    ('repeat: {times: 2.0, steps: [wait: 1]}', Repeat(2, (Wait(1.0),))),
    ('repeat: {times: 1e2, steps: []}', Repeat(100, ())),
])
def test_there_is_more_than_one_way_to_write_a_step(text, step):
    assert only_step(text) == step


@pytest.mark.usefixtures('any_loader')
def test_a_file_read_is_not_changed(tmp_path):
    path = tmp_path / 'wait.yaml'
    path.write_bytes('\ufeffname: ü\r\nsteps:\r\n- wait: 1\r\n'.encode())  # as some editors save
    file = load(path)
    assert (file.motion, file.source) == (Motion('ü', (Wait(1.0),)), str(path))
    assert load(str(path)) == file
    assert hash(load(path)) == hash(file)
    with pytest.raises(FrozenInstanceError):
        file.rate = 10.0
    with pytest.raises(TypeError):
        file.limits['max_linear_velocity'] = 10.0


@pytest.mark.usefixtures('any_loader')
@pytest.mark.parametrize('path, line', [
    ('steps', 6), ('steps[0]', 7), ('steps[0].forward.distance', 7), ('steps[2].arc.speed', 9),
    ('steps[8].repeat', 15), ('steps[8].repeat.times', 16), ('steps[8].repeat.steps[0].wait', 18),
    ('steps[8].repeat.steps[1].repeat.times', 19), ('limits', 4),
    ('steps[10].goto.point', 21), ('steps[12].waypoints.points[1]', 24), ('steps[13]', 6),
    ('steps[12].waypoints.corners', 27), ('steps[12].waypoints.points[1].forward', 24)])
def test_a_path_in_a_motion_has_a_line(path, line):
    assert loads(EVERYTHING, 'a.yaml').where(path) == f'a.yaml:{line}'


TOO_FAST = """\
steps:
  - forward: {distance: 1 m, speed: 0.2 m/s}
  - repeat:
      times: 2
      steps:
        - turn:
            angle: 90 deg
            speed: 2 rad/s
  - move: {linear_x: -0.4, angular_z: 2, duration: 1}
"""


#: Motions that this robot cannot do.
TOO_MUCH = (
    TOO_FAST,
    # Their own limits hold, too,
    'limits: {max_linear_velocity: 0.1 m/s}\nsteps: [{forward: {distance: 1 m, speed: 0.2 m/s}}]',
    # are told together with wrong steps,
    'limits: {max_linear_velocity: 9 m/s}\nsteps:\n- forward: {distance: 1 m, speed: 5 m/s}',
    # and cannot allow what the robot does not.
    ('limits:\n  max_angular_velocity: 90 deg/s\n  max_linear_velocity: 31 cm/s\n'
     '  max_backward_velocity: 0.4\n  max_linear_deceleration: 2\nsteps: []'),
)


def test_what_cannot_be_planned_is_refused_with_its_lines_and_the_robots_name():
    limits = Limits(0.3, 1.57, max_linear_acceleration=1.0)

    def refusal(text: str) -> str:
        with pytest.raises(MotionFileError) as caught:
            loads(text, 'fast.yaml').check(limits, 'kachaka')
        return str(caught.value)

    compare('planning', answers(TOO_MUCH, refusal))


def test_errors_of_planning_can_be_given_their_lines():
    file = loads(TOO_FAST, 'fast.yaml')
    with pytest.raises(MotionFileError) as caught:
        file.check(KACHAKA)
    error = caught.value
    assert str(error).startswith('fast.yaml:8: step 2: repeat: step 1: turn.speed: 2.0 rad/s is '
                                 "above the robot's limit of 1.57 rad/s")
    assert isinstance(error, InvalidMotionError)
    assert [problem.line for problem in error.problems] == [8, 9, 9]


@pytest.mark.parametrize('robot, text, expected', [
    (Limits(0.3, 1.0, max_backward_velocity=0.2), 'max_linear_velocity: 0.1', 0.1),
    (Limits(0.3, 1.0, max_backward_velocity=0.2), 'max_linear_velocity: 0.25', 0.2),
    (Limits(0.3, 1.0, max_backward_velocity=0.2), 'max_angular_velocity: 0.5', 0.2),
    (Limits(0.3, 1.0, max_backward_velocity=0.2), 'max_backward_velocity: 0.15', 0.15),
    (Limits(0.3, 1.0), 'max_linear_velocity: 0.1', 0.1),
])
def test_a_lower_velocity_limit_holds_backwards_too(robot, text, expected):
    file = loads(f'limits: {{{text}}}\nsteps: []')
    assert file.check(robot).backward_velocity == expected


@given(MOTIONS)
@example(Motion('no', ()))
@example(Motion('', (Wait(0.0),), 'two\nlines: # "quoted" \\ \x00\x85\u2028\ufeff\U0001f600'))
@example(Motion('true', (Forward(1), Wait(5e-324), Turn(-1.7976931348623157e308))))
@settings(max_examples=200)
def test_what_is_written_reads_back_as_the_same_motion(motion):
    assert loads(dump(motion)).motion == motion


def test_what_is_written_is_readable():
    steps = [Repeat(4, [Forward(0.5), Turn(1.5, 0.5)]), Wait(2)]
    assert dump(Motion('square', steps, 'A square.')) == (
        'name: square\n'
        'description: A square.\n'
        'steps:\n'
        '  - repeat:\n'
        '      times: 4\n'
        '      steps:\n'
        '        - forward: 0.5 m\n'
        '        - turn: {angle: 1.5 rad, speed: 0.5 rad/s}\n'
        '  - wait: 2.0 s\n')


@pytest.mark.parametrize('motion, words', [
    (Motion('third', [Wait(Fraction(1, 3))]), 'numbers that are no floats'),
    (Motion('long', [Repeat(10**6, [Wait(1.0)])]), 'at most 1000000'),
    (Motion('large', [Wait(1.0)] * 50_000), 'more than 100000 values'),
    (Motion('half', [], '\ud83d'), 'escape|half a character'),
])
def test_what_no_file_can_hold_is_not_written(motion, words):
    with pytest.raises(MotionFileError, match=words):
        dump(motion)
