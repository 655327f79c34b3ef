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
"""Test motion files with parameters, and files that include others."""

from __future__ import annotations

import os
from pathlib import Path
import time

from golden import compare
from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
from kachaka_simple_control import find, Forward, Goto, Include, Limits, Motion, plan, Repeat, Turn
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import load, loads
from kachaka_simple_control.files.motion_writer import dump
from kachaka_simple_control.motion.steps import MAX_INCLUDES
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

LIMITS = Limits(0.3, 1.57, max_linear_acceleration=0.5, max_angular_acceleration=2.5)
SQUARE = """\
name: square
parameters:
  laps: {default: 4, max: 20}
  side:
    {default: 0.5 m, min: 20 cm, max: 4 m, description: of the square}
steps:
  - repeat: {times: $laps, steps: [{forward: $side}, {turn: 90 deg}]}
"""
PATROL = """\
name: patrol
corners: 5 cm
parameters:
  side: {default: 0.5 m, min: 20 cm, max: 4 m, description: of the square}
  laps: {default: 4, max: 20}
steps:
  - repeat: {times: $laps, steps: [{forward: $side}, {turn: 90 deg}]}
  - forward: 2 * $side + 10 cm
  - arc: {radius: ($side + 10 cm) / 2, angle: 180 deg}
  - goto: [1 m, 0.5 m]
  - goto: {point: [0 m, -$side], heading: 0 deg, speed: 0.2 m/s}
  - waypoints: {points: [[1 m, 0 m], [1 m, 1 m], [0 m, 0 m]], heading: 0 deg, corners: 10 cm}
  - wait: 0 s
  - include: {motion: ./square.yaml, with: {side: 2 * $side}}
  - include: square
"""
ROWS = """\
steps:
  - forward: 0.5 m
  - turn:
      {angle: 90 deg, speed: 2 rad/s}
"""
#: Files with errors; the first of each case is read.
WRONG = (
    {'patrol.yaml': PATROL.replace('2 * $side + 10 cm', '$sid').replace(
        '($side + 10 cm) / 2', '$side + 90 deg').replace('{side: 2 * $side}', '{side: 5 m}'),
     'square.yaml': SQUARE},
    {'patrol.yaml': PATROL.replace('include: square', 'include: ./rows.yaml'),
     'square.yaml': SQUARE, 'rows.yaml': ROWS},
    {'top.yaml': 'steps: [include: ./patrol.yaml]',
     'patrol.yaml': PATROL.replace('include: square', 'include: ./rows.yaml'),
     'square.yaml': SQUARE, 'rows.yaml': ROWS.replace('rad/s', 'm/s')},
    {'a.yaml': 'steps:\n  - wait: 1 s\n  - include: ./b.yaml',
     'b.yaml': 'steps: [include: a.yaml]'},
    {'me.yaml': 'steps: [include: ./me.yaml]'},
    {'m.yaml': 'steps: [include: ./a.yaml]', 'a.yaml': 'steps: [include: ./b.yaml]',
     'b.yaml': 'steps: [include: ./a.yaml]'},
    {'square.yaml': SQUARE.replace('parameters:', 'corners: -5 cm\nparameters:')},
    {'p.yaml': """\
parameters:
  dim: {default: 1 m, max: 20 deg}
  bounds: {default: 5 m, max: 4 m}
  order: {min: 4 m, max: 3 m, default: 3.5 m}
  none: {min: 4 m}
  bare:
  9x: 3
  minimum: {minimum: 3}
  comma: "0,5 m"
  text: side
  kind: 3 Hz
  many: [1, 2]
steps:
  - forward: $dim
  - forward: $nobody
  - repeat: {times: $bare, steps: [{wait: 1 s}]}
"""},
    {'i.yaml': """\
parameters: {n: 1.5, side: 0.5 m}
steps:
  - include: squar
  - include: {with: {side: 1 m}}
  - include: {motion: square, name: x}
  - include: {motion: square, file: x}
  - include: {motion: ./square.yaml, with: {sied: 1 m, laps: 1 m}}
  - include: {motion: ./square.yaml, with: {side: 10 * $side, laps: $n * 1 m}}
  - include: {motion: ./square.yaml, with: {side: 1, laps: $m}}
  - include: ./needs.yaml
  - include: ./
  - include: ./none.yaml
  - include: {motion: ./square.yaml, with: {laps: 2 * $n - 0.5}}
  - repeat: {times: $n, steps: []}
  - repeat: {times: 1e6 * $n, steps: []}
  - arc: {radius: $side - 0.5 m, angle: 1 rad}
  - include: ''
  - include: 3
""", 'square.yaml': SQUARE, 'needs.yaml': 'parameters: {side: {min: 20 cm}}\nsteps: []'},
    {'alike.yaml': 'rate: 10\nsteps: [include: ./own.yaml, include: ./same.yaml]',
     'same.yaml': 'rate: 10\nsteps: []', 'own.yaml': """\
rate: 20 Hz
robot: turtlebot3
closed_loop: true
watch: false
limits: {max_linear_velocity: 0.1 m/s}
steps: []
"""},
    {'full.yaml': 'steps: [include: ./half.yaml]',
     'half.yaml': 'steps:\n- repeat: {times: 1000000, steps: [{wait: 0 s}]}'},
)


def write(folder: Path, files: dict[str, str]) -> str:
    """Write files, and return the name of the first, seen from the folder."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding='utf-8')
    return next(iter(files))


def test_wrong_files_are_refused_with_all_places(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = []
    for case in WRONG:
        with pytest.raises(MotionFileError) as caught:
            load(write(tmp_path, case)).check(LIMITS, 'kachaka')
        lines += [str(caught.value), '']
    compare('includes', '\n'.join(lines))


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Return the folder of the square and the patrol, which is the current one."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path, {'square.yaml': SQUARE, 'patrol.yaml': PATROL})
    return tmp_path


def square(side: float, times: int = 4) -> Repeat:
    return Repeat(times, (Forward(side), Turn(1.5707963267948966)))


def test_a_parameter_has_its_default_or_what_is_given(files):
    assert load('square.yaml').motion.steps == (square(0.5),)
    for values in ({'side': '1 m', 'laps': '2'}, {'side': 1.0, 'laps': 2}, {'side': '100cm',
                                                                            'laps': '2.0'}):
        file = find('./square.yaml', **values)
        assert file.motion.steps == (square(1.0, 2),)
        assert set(file.values) == {'side', 'laps'}
    assert str(file.parameters['side']) == 'side 0.5 m (20 cm to 4 m)'
    assert str(file.parameters['laps']) == 'laps 4 (at most 20)'
    assert file.parameters['side'].description == 'of the square'


@pytest.mark.parametrize('values, text', [
    ({'sid': '1 m'}, "square.yaml: there is no parameter 'sid'; did you mean 'side'?"),
    ({'side': '5 m'}, 'square.yaml:4: parameters.side: 5 m is above its largest, 4 m'),
    ({'side': 0.1}, 'square.yaml:4: parameters.side: 0.1 m is below its smallest, 20 cm'),
    ({'side': '1 s'}, (
        'square.yaml:4: parameters.side: 1 s is a time; it must be a length, as in 0.5 m')),
    ({'side': '1'}, (
        'square.yaml:4: parameters.side: 1 has no unit; a length needs one: write 1 cm or 1 m')),
    ({'side': '2 * 1 m'}, (
        "square.yaml:4: parameters.side: '2 * 1 m'; it must be a number, or a number with a unit, "
        'as in 4 or 0.5 m')),
    ({'side': True}, 'square.yaml:4: parameters.side: True; it must be a number [m]'),
    ({'side': float('nan')}, 'square.yaml:4: parameters.side: nan m; it must be a finite number'),
])
def test_a_value_that_is_wrong_is_refused(files, values, text):
    with pytest.raises(MotionFileError) as caught:
        find(Path('square.yaml'), **values)
    assert str(caught.value) == text


def test_what_is_included_is_a_step_with_its_own_frame(files):
    motion = load('patrol.yaml').motion
    assert motion.steps[1:3] == (Forward(1.1), motion.steps[2])
    assert motion.steps[7:] == (
        Include([square(1.0)], 'square'), Include(find('square').motion.steps, 'square'))
    there = Motion('there', [Forward(1.0), Turn(1.5707963267948966),
                             Include([Goto((1.0, 0.0)), Goto((0.0, 0.0))])])
    pose = plan(there, LIMITS, 10.0).steps[-2].pose
    assert (pose.x, pose.y) == pytest.approx((1.0, 1.0))
    end = plan(there, LIMITS, 10.0).pose
    assert (end.x, end.y) == pytest.approx((1.0, 0.0), abs=1e-12)
    outside = plan(Motion('out', [*there.steps, Goto((0.0, 0.0))]), LIMITS, 10.0).pose
    assert (outside.x, outside.y) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_the_corners_of_what_is_included_win_inside_it(tmp_path):
    leg = 'steps: [{forward: 0.5 m}, {turn: 90 deg}, {forward: 0.5 m}]'
    write(tmp_path, {
        'stops.yaml': f'corners: 0 cm\n{leg}', 'flows.yaml': f'corners: 5 cm\n{leg}',
        'any.yaml': leg,
        'main.yaml': 'corners: 2 cm\nsteps: [{include: ./stops.yaml}, {wait: 0}, '
                     '{include: ./flows.yaml}, {wait: 0}, {include: ./any.yaml}]'})
    steps = plan(load(tmp_path / 'main.yaml').motion, LIMITS, 10.0).steps
    cuts = [0.0 if step.cut is None else step.cut.deviation
            for step in steps if isinstance(step.step, Turn)]
    assert cuts == pytest.approx([0.0, 0.05, 0.02], abs=1e-6)
    assert [step.included for step in steps] == [
        *['stops'] * 3, '', *['flows'] * 3, '', *['any'] * 3]


def test_what_is_written_reads_back_without_the_files(files):
    motion = load('patrol.yaml').motion
    text = dump(motion)
    assert 'parameters' not in text
    assert '.yaml' not in text
    assert loads(text).motion == motion


def test_errors_in_python_have_the_place_of_the_step():
    step = Forward(1.0)
    for _ in range(MAX_INCLUDES):
        step = Include([step])
    with pytest.raises(InvalidMotionError, match='it includes motions 21 deep; at most 20'):
        Include([step])
    with pytest.raises(InvalidMotionError, match='sequence of steps'):
        Include('square')


def test_a_motion_that_doubles_at_each_include_is_refused_quickly(tmp_path):
    for level in range(20):
        write(tmp_path, {f'f{level}.yaml': 'steps:\n' + 2 * f'  - include: ./f{level + 1}.yaml\n'})
    write(tmp_path, {'f20.yaml': 'steps: [{wait: 0 s}, {wait: 0 s}]'})
    begin = time.process_time()
    with pytest.raises(MotionFileError, match='at most 1000000 are read'):
        load(tmp_path / 'f0.yaml')
    assert load(tmp_path / 'f4.yaml')
    assert time.process_time() - begin < 5.0


def test_at_most_twenty_deep_and_a_hundred_files(tmp_path):
    for level in range(22):
        write(tmp_path, {f'd{level}.yaml': f'steps: [include: ./d{level + 1}.yaml]'})
    write(tmp_path, {'d22.yaml': 'steps: []'})
    assert load(tmp_path / 'd2.yaml')
    with pytest.raises(MotionFileError, match=r'd21.yaml:1: step 1: include: .* 20 deep'):
        load(tmp_path / 'd1.yaml')
    write(tmp_path, {
        'leaf.yaml': 'parameters: {n: 1}\nsteps: [repeat: {times: $n, steps: []}]',
        **{f'w{count}.yaml': 'steps:\n' + ''.join(
            f'- include: {{motion: ./leaf.yaml, with: {{n: {number}}}}}\n'
            for number in range(count)) for count in (100, 101)}})
    assert len(load(tmp_path / 'w100.yaml').motion.steps) == 100
    with pytest.raises(MotionFileError, match='w101.yaml:102: .* more than 100 files'):
        load(tmp_path / 'w101.yaml')


NAMES = st.sampled_from(['a', 'b', 'c'])
UNITS = st.sampled_from(['m', 'cm', 'deg', 's', 'm/s', ''])
AMOUNTS = st.builds(lambda number, unit: f'{number} {unit}', st.integers(-3, 9), UNITS)
EXPRESSIONS = st.recursive(
    AMOUNTS | NAMES.map(lambda name: f'${name}'), lambda inner: st.builds(
        lambda one, sign, two: f'({one} {sign} {two})', inner, st.sampled_from('+-*/'), inner),
    max_leaves=5)
FILES = [f'f{number}.yaml' for number in range(6)]


def _entries(values: dict[str, str]) -> str:
    return ', '.join(f'{key}: {value}' for key, value in values.items())


WITH = st.dictionaries(NAMES, EXPRESSIONS, max_size=2)
LINES = st.one_of(
    st.builds(lambda word, value: f'{word}: {value}',
              st.sampled_from(['forward', 'turn', 'wait', 'trun']), EXPRESSIONS),
    st.builds(lambda times, value: f'repeat: {{times: {times}, steps: [{{forward: {value}}}]}}',
              st.integers(0, 10**6) | EXPRESSIONS, EXPRESSIONS),
    st.builds(
        lambda name, values: f'include: {{motion: {name}, with: {{{_entries(values)}}}}}',
        st.sampled_from([*(f'./{file}' for file in FILES), 'square', './none.yaml']), WITH))
TEXTS = st.builds(
    lambda parameters, lines: (
        f'parameters: {{{_entries(parameters)}}}\n'
        f'steps: [{", ".join(f"{{{line}}}" for line in lines)}]\n'),
    st.dictionaries(NAMES, st.builds(
        lambda value, most: f'{{default: {value}, max: {most}}}', AMOUNTS, AMOUNTS)),
    st.lists(LINES, max_size=6))


@given(texts=st.lists(TEXTS, min_size=len(FILES), max_size=len(FILES)))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture],
          deadline=None)
def test_random_files_are_read_or_refused_with_their_places(tmp_path, texts):
    write(tmp_path, dict(zip(FILES, texts)))
    begin = time.process_time()
    try:
        file = load(tmp_path / FILES[0])
    except MotionFileError as error:
        problems, lines = error.problems, str(error).split('\n')
    else:
        problems, lines = (), []
        assert loads(dump(file.motion)).motion == file.motion
    assert all(problem.line for problem in problems)
    assert all(line.startswith(os.fspath(tmp_path)) for line in lines)
    assert time.process_time() - begin < 5.0


def test_a_chain_of_twenty_files_with_parameters_is_exact(tmp_path):
    for level in range(20):
        write(tmp_path, {f'c{level}.yaml': (
            f'parameters: {{side: 57 cm}}\nsteps:\n  - forward: $side\n'
            f'  - include: {{motion: ./c{level + 1}.yaml, with: {{side: $side / 3}}}}\n')})
    write(tmp_path, {'c20.yaml': 'parameters: {side: 1 m}\nsteps: [forward: $side * 3486784401]'})
    steps = load(tmp_path / 'c0.yaml').motion.steps
    for _ in range(20):
        assert isinstance(steps[-1], Include)
        steps = steps[-1].steps
    assert steps == (Forward(0.57),)
