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
"""Errors of motion files: one line for each, with file, line and step."""

from __future__ import annotations

from golden import answers, compare
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.motion.steps import MAX_NESTING
from motion_texts import refusal, step_refusal
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

#: Steps that are refused, each in one line.
STEPS = (
    # No steps.
    'trun: 90 deg',
    'Forward: 1 m',
    'WAIT: 1',
    'rotate: 90 deg',
    'Pause: 1 s',
    'move_robot: {}',
    'fly: 1',
    'stop',
    '{}',
    '',
    '[wait: 1]',
    '{turn: 1 rad, wait: 1}',
    '{forward: 1 m, speed: 0.1}',
    # Keys.
    'turn: {angle: 1 rad, sped: 1}',
    'wait: {duration: 1, "a b": 1}',
    'wait: {duration: 1, 5: 1}',
    'turn: {speed: 1}',
    'wait: {duration: 1, duration: 2}',
    # Values of the wrong kind.
    'wait: fast',
    'wait: 2 m',
    'wait: 1:30',
    'wait:',
    'wait: [1]',
    'wait: true',
    'wait: {duration: {}}',
    'forward: 1_000 m',
    'forward: 0x10',
    'forward: yes',
    # A decimal comma; in braces it would begin another key.
    'forward: 0,5 m',
    '{forward: 0,5 m}',
    '{wait: 1,5}',
    'forward: {distance: 0,5 m,speed: 0.1}',
    'move: {linear_x: 0.1, angular_z: -0,25 rad/s, duration: 1}',
    # Numbers that could be read in two ways.
    'turn: 90',
    "turn: '90'",
    'forward: 50',
    'forward: -1.5',
    'turn: {angle: 0, speed: 1}',
    'arc: 5',
    'repeat: {times: 2.5, steps: []}',
    'repeat: {times: "4", steps: []}',
    'repeat: {times: 1, steps: wait}',
    # Points.
    'goto: 1 m',
    'goto: [1 m]',
    'goto: [1 m, 2 m, 3 m]',
    'goto: [1, 2 m]',
    'goto: [1 m, 2 s]',
    'goto: [1 m, .nan]',
    'goto: [1 m, 1e999 m]',
    'goto: [[1 m, 2 m], 1 m]',
    'goto: {point: [1 m, 2 m], x: 1 m}',
    'goto: {point: [1 m, 2 m], heading: 90}',
    'goto: {point: [1 m, 2 m], heading: .nan}',
    'goto: {point: [1 m, 2 m], speed: -1 m/s}',
    'goto: {point: [1 m, 2 m], corners: 5 cm}',
    'goto: {heading: 90 deg}',
    'goto: {point: 1 m}',
    'goto:',
    'go_to: [1 m, 2 m]',
    'gotoo: [1 m, 2 m]',
    'route: [[1 m, 2 m]]',
    'waypoints: []',
    'waypoints: [1 m]',
    'waypoints: [[1 m]]',
    'waypoints: [[1 m, 2 m, 3 m]]',
    'waypoints: {points: []}',
    'waypoints: {points: [[1 m, 2 m], [1 m, 2]]}',
    'waypoints: {points: [[1 m, 2 m]], corners: -5 cm}',
    'waypoints: {points: [[1 m, 2 m]], corners: 2 m}',
    'waypoints: {points: [[1 m, 2 m]], corners: 5}',
    'waypoints: {points: [[1 m, 2 m]], corners: .nan}',
    # Numbers out of bounds.
    'wait: -2',
    'wait: -2 s',
    'forward: {distance: 1 m, speed: 0}',
    'turn: {angle: 1 rad, speed: 0 deg/s}',
    'turn: {angle: 1 rad, speed: 2 m/s}',
    'arc: {radius: 0 m, angle: 1 rad}',
    'repeat: {times: -1, steps: []}',
    'repeat: {times: 1000001, steps: []}',
    # No numbers.
    'wait: .inf',
    'wait: -.Inf',
    'wait: .nan',
    'wait: inf s',
    'wait: 1e999999',
    'wait: 1e999999 s',
    'wait: 010',
    'wait: ' + '1' * 100_000,
    # YAML that hides what is in a file.
    'wait: &a 1',
    'wait: *a',
    'wait: !!float 1',
    'wait: !time 1',
    '{<<: {wait: 1}}',
)
#: Files that are refused, each in one line.
FILES = (
    '',
    '# a comment\n',
    '~',
    'hello',
    '- wait: 1',
    'name: a\n',
    'steps:\n',
    'name: 5\nsteps: []',
    'steps: []\nrate: 0 Hz',
    'steps: []\nrate: 1001',
    'steps: []\nlimits: {max_linear_velocity: 0}',
    'steps: []\nlimits: {max_linear_jerk: 1 m/s^2}',
    'steps: []\nsteps: []',
    'steps: []\ncorners: -5 cm',
    'steps: []\ncorners: 2 m',
    'steps: []\ncorners: 5',
    'steps: []\ncorners: 0',
    'steps: []\ncorners: .nan',
    'steps: []\ncorners: inf m',
    'steps: []\ncorners: 5 deg',
    'steps: []\ncorners: 1e999 m',
    'steps: []\ncorners: [5 cm]',
    'steps: []\ncorners:',
    'steps: []\ncorner: 5 cm',
    'steps: []\n---\nsteps: []',
    'steps: []\n? [a]\n: b',
    'steps: [wait: 1,\n  forward: 0,5 m, wait: 1]',
    'steps: []\nlimits: {max_linear_velocity: 0,5}',
    'steps:\n\t- wait: 1',
    'steps: []\nname: @me',
    'steps:\n  - forward: 1 m\n - turn: 20 deg',
    'steps:\n- forward: 1 m\n   turn: 20 deg',
    'name: a\nsteps\n- forward: 1 m',
    'steps: [{repeat: {times: 1000, steps: [{repeat: {times: 1001, steps: [wait: 0]}}]}}]',
    'steps: [{repeat: {times: 1e6, steps: [{repeat: {times: 1e6, steps: []}}]}}]',
)


def test_what_is_no_motion_is_refused_in_one_line():
    compare('motion_files', answers(STEPS, step_refusal) + answers(
        FILES, lambda text: '\n'.join(refusal(text))))


def nested(depth: int) -> str:
    """Return a motion with a step within so many repeats."""
    lines = ['steps:']
    for level in range(depth):
        pad = ' ' * 6 * level
        lines += [f'{pad}- repeat:', f'{pad}    times: 1', f'{pad}    steps:']
    return '\n'.join([*lines, ' ' * 6 * depth + '- wait: 1', ''])


def test_repeats_may_be_nested_as_deep_as_a_motion_has_them_and_no_deeper():
    loads(nested(MAX_NESTING))
    assert refusal(nested(MAX_NESTING + 1)) == [
        (f'bad.yaml:2: step 1: repeat: steps has repeats {MAX_NESTING + 1} deep; at most '
         f'{MAX_NESTING} may be nested')]
    assert 'nested more than 70 deep' in refusal(nested(200))[0]


def test_all_errors_are_reported_at_once_in_the_order_of_the_lines():
    lines = refusal("""\
descriptoin: x
rate: 2 s
steps:
  - wait: 2 m
  - repeat:
      times: -1
      steps:
        - arc: {radius: 0 m, angle: 1 m}
        - wait: .nan
        - trun: 1
  - wait: 1
    wait: 2
""")
    assert [line.split(': ')[0] for line in lines] == [
        f'bad.yaml:{line}' for line in (1, 2, 4, 6, 8, 9, 10, 12)]
    places = [
        'descriptoin', 'rate', 'step 1: wait', 'step 2: repeat.times',
        'step 2: repeat: step 1: arc.angle', 'step 2: repeat: step 2: wait',
        'step 2: repeat: step 3: trun', 'step 3: wait']
    assert [line.partition(': ')[2].startswith(f'{place}: ')
            for line, place in zip(lines, places)] == [True] * 8


def test_each_missing_key_is_named_once():
    assert refusal('steps: [{move: {linear_x: 1}}]') == [
        ("bad.yaml:1: step 1: move: 'angular_z' is missing: an angular velocity, as in 45 deg/s "
         '(in rad/s, deg/s or °/s)'),
        ("bad.yaml:1: step 1: move: 'duration' is missing: a time, as in 2 s (in s, ms or min)")]


def test_an_error_is_an_invalid_motion_error_and_has_its_locations():
    with pytest.raises(InvalidMotionError) as caught:
        loads('steps:\n- wait: 1 m\n', 'a.yaml')
    assert isinstance(caught.value, MotionFileError)
    problem, = caught.value.problems
    assert (caught.value.source, problem.line, problem.path) == ('a.yaml', 2, 'steps[0].wait')
