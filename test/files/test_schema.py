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
from importlib.resources import files
import json
from typing import Any

from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.motion_schema import motion_schema
from kachaka_simple_control.motion.step_base import KINDS
from kachaka_simple_control.motion.steps import MAX_TIMES
from kachaka_simple_control.motion.units import QUANTITIES, SignRule
from motion_texts import EVERYTHING
from optional_libraries import optional_imports
import pytest

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
    assert motion_schema() == MOTION
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
                 {'include': 3}, {'include': {'file': 'square'}},
                 {'arc': {'radius': '1 m'}}):
        assert list(validator.iter_errors({'steps': [step]})), step
        assert list(validator.iter_errors(
            {'steps': [{'repeat': {'times': 1, 'steps': [step]}}]})), step
