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

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_file import loads
from kachaka_simple_control.motion.steps import MAX_NESTING
from motion_texts import refusal, step_refusal
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

TIME = 'it must be a time, as in 2 s (in s, ms or min)'
LENGTH = 'it must be a length, as in 0.5 m (in m, cm or mm)'
OCTAL = 'has a leading zero, which makes it octal for some readers; leave the zero out'
SEVERAL = "in one step; begin each step with '- ', and indent what belongs to it by two more"


@pytest.mark.parametrize('step, line', [
    # No steps.
    ('trun: 90 deg', "trun: there is no such step; did you mean 'turn'?"),
    ('Forward: 1 m', "Forward: there is no such step; did you mean 'forward'?"),
    ('WAIT: 1', "WAIT: there is no such step; did you mean 'wait'?"),
    ('rotate: 90 deg', "rotate: there is no such step; did you mean 'turn'?"),
    ('Pause: 1 s', "Pause: there is no such step; did you mean 'wait'?"),
    ('move_robot: {}', "move_robot: there is no such step; did you mean 'move'?"),
    ('fly: 1',
     'fly: there is no such step; known are move, forward, turn, arc, wait, settle, repeat'),
    ('stop', "'stop'; it must be a step, as in - forward: 0.5 m"),
    ('{}', 'nothing; it must be a step, as in - forward: 0.5 m'),
    ('', 'nothing; it must be a step, as in - forward: 0.5 m'),
    ('[wait: 1]', 'a list; it must be a step, as in - forward: 0.5 m'),
    ('{turn: 1 rad, wait: 1}', f"'turn' and 'wait' {SEVERAL}"),
    ('{forward: 1 m, speed: 0.1}', f"'forward' and 'speed' {SEVERAL}"),
    # Keys.
    ('turn: {angle: 1 rad, sped: 1}', "turn.sped: there is no such key; did you mean 'speed'?"),
    ('wait: {duration: 1, "a b": 1}',
     "wait.'a b': there is no such key; known are duration"),
    ('wait: {duration: 1, 5: 1}', 'wait.5: there is no such key; known are duration'),
    ('turn: {speed: 1}', "turn: 'angle' is missing: an angle, as in 90 deg (in rad, deg or °)"),
    ('wait: {duration: 1, duration: 2}',
     'wait.duration: this key is here twice, first in line 2'),
    # Values of the wrong kind.
    ('wait: fast', f"wait: 'fast'; {TIME}"),
    ('wait: 2 m', f"wait: '2 m'; {TIME}"),
    ('wait: 1:30', "wait: '1:30'; write 1:30 as 90 s or 1.5 min"),
    ('wait:', f'wait: nothing; {TIME}'),
    ('wait: [1]', f'wait: a list; {TIME}'),
    ('wait: true', f'wait: true; {TIME}'),
    ('wait: {duration: {}}', f'wait.duration: keys with values; {TIME}'),
    ('forward: 1_000 m', f"forward: '1_000 m'; {LENGTH}"),
    ('forward: 0x10', f"forward: '0x10'; {LENGTH}"),
    ('forward: yes', f"forward: 'yes'; {LENGTH}"),
    # A decimal comma; in braces it would begin another key.
    ('forward: 0,5 m', "forward: '0,5 m'; write '0.5 m', with a point"),
    ('{forward: 0,5 m}', "forward: '0,5 m'; write '0.5 m', with a point"),
    ('{wait: 1,5}', "wait: '1,5'; write '1.5', with a point"),
    ('forward: {distance: 0,5 m,speed: 0.1}',
     "forward.distance: '0,5 m'; write '0.5 m', with a point"),
    ('move: {linear_x: 0.1, angular_z: -0,25 rad/s, duration: 1}',
     "move.angular_z: '-0,25 rad/s'; write '-0.25 rad/s', with a point"),
    # Numbers that could be read in two ways.
    ('turn: 90', 'turn: 90 has no unit; an angle needs one: write 90 deg or 90 rad'),
    ("turn: '90'", 'turn: 90 has no unit; an angle needs one: write 90 deg or 90 rad'),
    ('forward: 50', 'forward: 50 has no unit; a length needs one: write 50 cm or 50 m'),
    ('forward: -1.5', 'forward: -1.5 has no unit; a length needs one: write -1.5 cm or -1.5 m'),
    ('turn: {angle: 0, speed: 1}',
     'turn.angle: 0 has no unit; an angle needs one: write 0 deg or 0 rad'),
    ('arc: 5', 'arc: 5; it must be radius and angle, as in {radius: 0.3 m, angle: 90 deg}'),
    ('repeat: {times: 2.5, steps: []}', 'repeat.times: 2.5; it must be a whole number'),
    ('repeat: {times: "4", steps: []}', "repeat.times: '4'; it must be a whole number"),
    ('repeat: {times: 1, steps: wait}',
     "repeat.steps: 'wait'; it must be a list of steps, each beginning with '- '"),
    # Numbers out of bounds.
    ('wait: -2', 'wait: -2 s; it must be at least 0 s'),
    ('wait: -2 s', "wait: '-2 s'; it must not be negative"),
    ('forward: {distance: 1 m, speed: 0}', 'forward.speed: 0 m/s; it must be above 0 m/s'),
    ('turn: {angle: 1 rad, speed: 0 deg/s}', "turn.speed: '0 deg/s'; it must be above 0 rad/s"),
    ('turn: {angle: 1 rad, speed: 2 m/s}',
     "turn.speed: '2 m/s'; it must be a turning speed, as in 45 deg/s (in rad/s, deg/s or °/s)"),
    ('repeat: {times: -1, steps: []}', 'repeat.times: -1; it must be at least 0'),
    ('repeat: {times: 1000001, steps: []}', 'repeat.times: 1000001; it must be at most 1000000'),
    # No numbers.
    ('wait: .inf', 'wait: .inf is not a finite number'),
    ('wait: -.Inf', 'wait: -.Inf is not a finite number'),
    ('wait: .nan', 'wait: .nan is not a finite number'),
    ('wait: inf s', f"wait: 'inf s'; {TIME}"),
    ('wait: 1e999999', "wait: '1e999999' is too large a number"),
    ('wait: 1e999999 s', "wait: '1e999999 s' is too large a number"),
    ('wait: 010', f"wait: '010' {OCTAL}"),
    ('wait: ' + '1' * 100_000, 'wait: this number has 100000 characters; 100 are enough'),
    # YAML that hides what is in a file.
    ('wait: &a 1', "wait: anchors such as '&a' are not read; leave it out"),
    ('wait: *a', "wait: aliases such as '*a' are not read; write it out"),
    ('wait: !!float 1', "wait: tags such as 'tag:yaml.org,2002:float' are not read; leave it out"),
    ('wait: !time 1', "wait: tags such as '!time' are not read; leave it out"),
    ('{<<: {wait: 1}}',
     "'<<': there is no such step; known are move, forward, turn, arc, wait, settle, repeat"),
])
def test_an_invalid_step_is_refused_in_one_line(step, line):
    assert step_refusal(step) == line


def test_a_radius_of_zero_is_refused_by_the_step_itself():
    refused = step_refusal('arc: {radius: 0 m, angle: 1 rad}')
    assert refused.startswith('arc.radius: 0.0 m; its size')


@pytest.mark.parametrize('text, line', [
    ('', 'bad.yaml: the file is empty'),
    ('# a comment\n', 'bad.yaml: the file is empty'),
    ('~', 'bad.yaml: the file is empty'),
    ('hello', "bad.yaml:1: 'hello'; it must be a motion: the word steps: and below it a list"),
    ('- wait: 1',
     'bad.yaml:1: a list; it must be a motion: the word steps: and below it a list'),
    ('name: a\n', "bad.yaml:1: 'steps' is missing: a list of steps, each beginning with '- '"),
    ('steps:\n',
     "bad.yaml:1: steps: nothing; it must be a list of steps, each beginning with '- '"),
    ('name: 5\nsteps: []', 'bad.yaml:1: name: 5; it must be a text, in quotes'),
    ('steps: []\nrate: 0 Hz', "bad.yaml:2: rate: '0 Hz'; it must be above 0 Hz"),
    ('steps: []\nrate: 1001', 'bad.yaml:2: rate: 1001 Hz; it must be at most 1000 Hz'),
    ('steps: []\nlimits: {max_linear_velocity: 0}',
     'bad.yaml:2: limits.max_linear_velocity: 0 m/s; it must be above 0 m/s'),
    ('steps: []\nlimits: {max_linear_jerk: 1 m/s^2}',
     ("bad.yaml:2: limits.max_linear_jerk: '1 m/s^2'; it must be a linear jerk, as in 2 m/s^3 "
      '(in m/s^3, cm/s^3 or mm/s^3)')),
    ('name: a\nsteps: [wait: 1,\n  forward: 0,5 m, wait: 1]',
     "bad.yaml:3: step 2: forward: '0,5 m'; write '0.5 m', with a point"),
    ('steps: []\nlimits: {max_linear_velocity: 0,5}',
     "bad.yaml:2: limits.max_linear_velocity: '0,5'; write '0.5', with a point"),
    ('steps: []\nsteps: []', 'bad.yaml:2: steps: this key is here twice, first in line 1'),
    ('steps: []\n---\nsteps: []',
     'bad.yaml:2: a second document begins here; a file has one'),
    ('steps: []\n? [a]\n: b', 'bad.yaml:2: a key must be a word'),
    ('steps:\n\t- wait: 1',
     r"bad.yaml:2: this is not YAML: nothing can begin with '\t' here; indent with spaces"),
    ('steps: []\nname: @me',
     "bad.yaml:2: this is not YAML: nothing can begin with '@' here; put the text in quotes"),
    ('steps:\n  - forward: 1 m\n - turn: 20 deg',
     ('bad.yaml:3: this is not YAML: this line does not belong to those above; indent it as they '
      'are, and close all quotes')),
    ('steps:\n- forward: 1 m\n   turn: 20 deg',
     ("bad.yaml:3: this is not YAML: no ':' can be here; indent this line as those above, or put "
      'the text in quotes')),
    ('name: a\nsteps\n- forward: 1 m', "bad.yaml:3: this is not YAML: a key is followed by ': '"),
    ('steps: [{repeat: {times: 1000, steps: [{repeat: {times: 1001, steps: [wait: 0]}}]}}]',
     'bad.yaml:1: steps: 1002001 steps, with all repeats; at most 1000000 are read'),
    ('steps: [{repeat: {times: 1e6, steps: [{repeat: {times: 1e6, steps: []}}]}}]',
     'bad.yaml:1: steps: 1000001 steps, with all repeats; at most 1000000 are read'),
])
def test_a_file_that_is_no_motion_is_refused_in_one_line(text, line):
    assert refusal(text) == [line]


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


def test_a_file_full_of_errors_does_not_fill_the_screen():
    lines = refusal('steps:\n' + '- wiat: 1\n' * 150)
    assert len(lines) == 21
    assert lines[-1] == 'bad.yaml: and 130 more'
    assert refusal('steps:\n' + '- wiat: 1\n' * 20_000)[-1] == 'bad.yaml: and many more'


def test_an_error_is_an_invalid_motion_error_and_has_its_locations():
    with pytest.raises(InvalidMotionError) as caught:
        loads('steps:\n- wait: 1 m\n', 'a.yaml')
    assert isinstance(caught.value, MotionFileError)
    problem, = caught.value.problems
    assert (caught.value.source, problem.line, problem.path) == ('a.yaml', 2, 'steps[0].wait')


def test_errors_contain_no_control_characters_of_the_file():
    lines = refusal('steps: []\n"\\e[31m\\n": 1\nname: ["\\e[2J"]\n', 'bad\n.yaml')
    assert len(lines) == 2
    assert all(line.isprintable() for line in lines)
