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
"""The JSON Schema of motions: its steps follow from the classes of steps."""

from __future__ import annotations

from dataclasses import fields
import inspect
from typing import Any

from kachaka_simple_control.files.schema import read_schema
from kachaka_simple_control.motion.step_base import Count, FileField, KINDS, Step
from kachaka_simple_control.motion.units import Quantity, SignRule

#: Where the package has it, for editors; ``tools/write_schema.py`` writes it.
PATH = 'motions/motion.schema.json'
Schema = dict[str, Any]


def motion_schema() -> Schema:
    """Return the schema of a motion, with all kinds of steps that there are."""
    schema = read_schema(PATH)
    definitions = schema['definitions']
    steps = {word: _step_schema(kind) for word, kind in KINDS.items()}
    return {**schema, 'definitions': {
        **definitions, 'step': {**definitions['step'], 'properties': steps}}}


def _step_schema(kind: type[Step]) -> Schema:
    parts = kind.file_fields()
    first = next(iter(parts.values()))
    example = {name: part.examples[0] for name, part in parts.items()}
    mapping = {
        'required': [item.name for item in fields(kind)  # type: ignore[arg-type]
                     if item.default is not None],
        'additionalProperties': False,
        'properties': {name: _field_schema(part) for name, part in parts.items()}}
    # Without Python's docstrings (-OO), editors have no description to show.
    head = {'description': (inspect.getdoc(kind) or '').partition('\n')[0]}
    if kind.form:
        return {**head, 'expected': kind.form, 'type': 'object', **mapping, 'examples': [example]}
    short = _field_schema(first)
    return {
        **short, **head, 'type': [*short['type'], 'object'],
        'examples': [first.examples[0], example], **mapping}


def _field_schema(part: FileField) -> Schema:
    return {
        'description': part.description, **_kind_schema(part.kind),
        'examples': list(part.examples)}


def _kind_schema(kind: object) -> Schema:
    match kind:
        case Quantity():
            return _quantity_schema(kind)
        case Count():
            return {'expected': 'a whole number', 'type': 'integer', 'minimum': 0,
                    'maximum': kind.largest}
        case _:
            return {'expected': "a list of steps, each beginning with '- '", 'type': 'array',
                    'items': {'$ref': '#/definitions/step'}}


def _quantity_schema(quantity: Quantity) -> Schema:
    bounds = {SignRule.ANY: {}, SignRule.NOT_NEGATIVE: {'minimum': 0},
              SignRule.POSITIVE: {'exclusiveMinimum': 0}}[quantity.sign]
    return {'quantity': quantity.keyword, 'type': ['number', 'string'],
            'pattern': quantity.pattern, **bounds}
