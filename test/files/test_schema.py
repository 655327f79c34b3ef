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
"""The schemas of motions, robots, fleets and floors: what validates is what an editor shows."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from importlib.resources import files
import json
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.files.document import UnreadableFileError
from kachaka_simple_control.files.editor_schema import (
    editor_schema,
    fleet_editor_schema,
    value_rules,
)
from kachaka_simple_control.files.motion_reader import loads, read_all_parameters
from kachaka_simple_control.files.motion_schema import motion_schema
from kachaka_simple_control.files.schema_check import compile_schema
from kachaka_simple_control.files.yaml_document import parse_yaml
from kachaka_simple_control.motion.step_base import KINDS
from kachaka_simple_control.motion.steps import MAX_TIMES
from kachaka_simple_control.motion.units import QUANTITIES, SignRule
from motion_texts import EVERYTHING
from optional_libraries import optional_imports
import pytest
from test_document import FILES, STEPS
from test_motion_reader import PATROL, WRONG

with optional_imports():
    import jsonschema
    import yaml

pytestmark = pytest.mark.needs('jsonschema', 'yaml')


def schema(path: str) -> dict[str, Any]:
    """Return a schema of the package."""
    return json.loads((files('kachaka_simple_control') / path).read_text('utf-8'))


MOTION = schema('motions/motion.schema.json')
ROBOT = schema('robots/robot.schema.json')
FLEET = schema('fleets/fleet.schema.json')
FLOOR = schema('floors/floor.schema.json')
STEP = MOTION['definitions']['step']


def parts(node: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a schema and all schemas within it."""
    yield node
    for inner in [*node.get('properties', {}).values(), *node.get('definitions', {}).values(),
                  *([node['items']] if 'items' in node else [])]:
        yield from parts(inner)


ALL = [part for whole in (MOTION, ROBOT, FLEET, FLOOR) for part in parts(whole)]


def test_each_part_has_a_description_and_a_text_for_errors():
    for part in ALL:
        if '$ref' not in part:
            assert part['description'][-1].isalnum() or part['description'].endswith(('.', '/'))
            assert ('quantity' in part) != ('expected' in part), part


def test_quantities_are_those_of_the_program():
    found = [part for part in ALL if 'quantity' in part]
    assert {part['quantity'] for part in found} == set(QUANTITIES)
    for part in found:
        quantity = QUANTITIES[part['quantity']]
        plain, *computed = part['pattern'].split('|^')
        assert plain == quantity.pattern
        assert len(computed) == part.get('expressions', False)
        assert part.get('maximum', float('inf')) == quantity.largest
        assert ('exclusiveMinimum' in part) == (quantity.sign is SignRule.POSITIVE)
        assert ('minimum' in part) == (quantity.sign is SignRule.NOT_NEGATIVE)
        assert part.get('minimum', part.get('exclusiveMinimum', 0)) == 0


def test_examples_are_valid():
    """An editor offers them."""
    count = 0
    for part in ALL:
        for example in part.get('examples', []):
            whole = {**part, 'definitions': {**MOTION['definitions'], **FLEET['definitions']}}
            jsonschema.Draft7Validator(whole).validate(example)
            count += 1
    assert count > 30


def test_steps_are_those_of_the_program():
    """``tools/write_schemas.py`` writes the file anew."""
    assert list(STEP['properties']) == list(KINDS)
    assert editor_schema() == MOTION
    assert fleet_editor_schema() == FLEET
    for word, kind in KINDS.items():
        part = STEP['properties'][word]
        fields = kind.file_fields()
        # An include has a motion from a file instead of steps.
        assert [name for name in part['properties'] if name not in ('motion', 'with')] == list(
            fields)
        quantities = {name: QUANTITIES[field['quantity']]
                      for name, field in part['properties'].items() if 'quantity' in field}
        assert quantities == {name: fields[name].kind for name in quantities}
        if not kind.form and 'quantity' in part:
            assert QUANTITIES[part['quantity']] is next(iter(quantities.values()))
    assert STEP['properties']['repeat']['properties']['times']['maximum'] == MAX_TIMES


def test_the_schema_alone_accepts_and_refuses_what_the_program_does():
    """An editor has nothing but the schema."""
    validator = jsonschema.Draft7Validator(MOTION)
    good = yaml.safe_load(EVERYTHING)
    assert loads(EVERYTHING)
    assert list(validator.iter_errors(good)) == []
    for step in ({'wait': '2 m'}, {'wait': -1}, {'wait': '-1 s'}, {'trun': 1}, {}, 'stop',
                 {'turn': '1 rad', 'wait': 1}, {'turn': 1}, {'forward': '1'}, {'forward': '1 -'},
                 {'forward': '2 * '}, {'turn': '$a + 1 sec'}, {'forward': 'sin($a)'},
                 {'forward': '1 m + $a deg'}, {'wait': '$a / 2 Hz'},
                 {'include': 3}, {'include': {'file': 'square'}},
                 *({'include': {'motion': 'square', 'with': values}} for values in (
                     {'sied': '1 m'}, {'side': '1 s'}, {'side': 1}, {'side': '1'},
                     {'side': '2 * $a + 1 sec'}, {'laps': '2 m'}, {'laps': 21}, {'laps': True})),
                 {'include': {'motion': 'spin', 'with': {'speed': 0.5}}},
                 {'include': {'motion': 'calibration', 'with': {'side': '1 m'}}},
                 {'arc': {'radius': '1 m'}}):
        assert list(validator.iter_errors({'steps': [step]})), step
        assert list(validator.iter_errors(
            {'steps': [{'repeat': {'times': 1, 'steps': [step]}}]})), step


def test_an_editor_accepts_values_that_a_motion_has():
    validator = jsonschema.Draft7Validator(MOTION)
    for values in ({'side': '1 m'}, {'side': '100cm', 'laps': 2}, {'side': '2 * $a', 'laps': '$n'},
                   {'side': '$a', 'laps': '2'}, {}):
        validator.validate({'steps': [{'include': {'motion': 'square', 'with': values}}]})
    validator.validate({'steps': [
        {'include': 'square'}, {'include': {'motion': './mine.yaml', 'with': {'sied': 1}}}]})
    fleet = jsonschema.Draft7Validator(FLEET)
    for values, is_good in (({'side': '1 m', 'laps': 2}, True), ({'side': '1 s'}, False),
                            ({'sied': '1 m'}, False), ({'side': '2 * $side'}, False)):
        robots = {'r1': {'motion': 'square', 'with': values}, 'r2': {'motion': 'lesson'}}
        assert fleet.is_valid({'robots': robots}) == is_good, values


def test_an_editor_marks_a_value_that_is_missing():
    parameters = read_all_parameters('parameters: {side: {min: 1 m}, laps: 2, any: }\nsteps: []')
    validator = jsonschema.Draft7Validator({'allOf': value_rules({'mine': parameters}, False)})
    for value in ('mine', {'motion': 'mine'}, {'motion': 'mine', 'with': {'side': '1 m'}},
                  {'motion': 'mine', 'with': {'side': '$a', 'any': 1}}):
        assert not validator.is_valid(value), value
    validator.validate({'motion': 'mine', 'with': {'side': '1 m', 'any': 1}})
    validator.validate({'motion': 'other'})


NUMBERS = st.integers(-1, 4) | st.sampled_from([0.5, 2.0, 1e6, 1e6 + 1.0, -0.0])
WORDS = st.sampled_from(['', '0.5 m', '90 deg', '2', '-1 s', '2 * $side', '1 m + 2', 'square'])


@st.composite
def alike(draw: st.DrawFn, part: dict[str, Any], depth: int = 6) -> Any:
    """Return a value that a part of the motion schema may allow."""
    part = STEP if '$ref' in part else part
    if depth == 0 or draw(st.integers(0, 19)) == 0:
        return draw(st.none() | st.booleans() | NUMBERS | WORDS | st.just([]) | st.just({}))
    types = part.get('type', 'string')
    kind = draw(st.sampled_from([types] if isinstance(types, str) else types))
    if kind == 'object':
        known, other = part.get('properties', {}), part.get('additionalProperties')
        least, most = part.get('minProperties', 0), part.get('maxProperties', 4)
        keys = draw(st.lists(
            st.sampled_from([*known, 'other']), min_size=least, max_size=most, unique=True))
        if draw(st.integers(0, 9)):
            keys = [key for key in keys if key in known] + part.get('required', [])
        return {key: draw(alike(known.get(key, other or {}), depth - 1)) for key in keys}
    if kind == 'array':
        least = part.get('minItems', 0)
        return draw(st.lists(alike(part['items'], depth - 1), min_size=least, max_size=2))
    return draw(NUMBERS if kind in ('number', 'integer') else st.sampled_from(
        part.get('examples', ['0.5 m'])) if draw(st.booleans()) else WORDS)


@given(data=alike(MOTION))
@settings(max_examples=300, deadline=None)
def test_the_quick_check_agrees_with_jsonschema_on_random_values(data):
    assert compile_schema(motion_schema())(data) == (
        jsonschema.Draft7Validator(motion_schema()).is_valid(data))


def test_the_quick_check_agrees_with_jsonschema_on_wrong_files():
    texts = [EVERYTHING, PATROL, *FILES, *(f'steps:\n  - {step}\n' for step in STEPS),
             *(text for case in WRONG for text in case.values())]
    answers = []
    for text in texts:
        with contextlib.suppress(UnreadableFileError):
            data = parse_yaml(text).root.data
            answers.append(jsonschema.Draft7Validator(motion_schema()).is_valid(data))
            assert compile_schema(motion_schema())(data) == answers[-1], text
    assert answers.count(True) > 10
    assert answers.count(False) > 50
