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
"""
Make the JSON Schema of motion files from the kinds of steps.

Tested by test/files/test_schema.py.
"""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache
import inspect
import math
from typing import Any

from kachaka_simple_control.files.amounts import UNITS
from kachaka_simple_control.files.document import read_schema
from kachaka_simple_control.files.expressions import expression_pattern
from kachaka_simple_control.files.schema_check import Schema

# Imported so that the steps are known.
import kachaka_simple_control.motion.include
from kachaka_simple_control.motion.step_base import (
    Count,
    FileField,
    KINDS,
    PointField,
    PointList,
    Step,
    Text,
)
from kachaka_simple_control.motion.units import DIGITS, LENGTH, Quantity, SignRule
import kachaka_simple_control.motion.waypoints  # noqa: F401

POINT = PointField()
#: The schema of a number with or without a unit.
AMOUNT: Schema = {
    'amount': True, 'expected': 'a number, or a number with a unit, as in 4 or 0.5 m',
    'type': ['number', 'string'], 'pattern': f'^[-+]?{DIGITS}( *({UNITS}))?$'}
#: The path of the motion schema in the package, for editors; ``tools/write_schemas.py`` writes it.
SCHEMA = 'motions/motion.schema.json'


def motion_schema() -> Schema:
    """Return the JSON Schema of a motion file, with a schema for each kind of step."""
    return _motion_schema(tuple(KINDS.items()))


@lru_cache(maxsize=1)
def _motion_schema(kinds: tuple[tuple[str, type[Step]], ...]) -> Schema:
    schema = read_schema(SCHEMA)
    definitions = schema['definitions']
    steps = {word: _step_schema(kind) for word, kind in kinds}
    steps['include'] = _include_schema(steps['include'])
    return {
        **schema,
        'properties': {**schema['properties'], 'parameters': _parameters_schema()},
        'definitions': {
            **definitions, 'step': {**definitions['step'], 'properties': steps}}}


def _parameters_schema() -> Schema:
    def value(description: str, *examples: Any) -> Schema:
        return {'description': description, **AMOUNT, 'examples': [*examples]}

    return {
        'description': 'Values that a drive, or a file that includes this one, can choose.  In a '
        'step, `$side` is the value of side.',
        'expected': 'keys with values, as in side: {default: 0.5 m, max: 4 m}',
        'type': 'object',
        'additionalProperties': {
            'description': 'A default value, or default, min, max and description.',
            **AMOUNT, 'type': ['object', 'number', 'string', 'null'],
            'properties': {
                'default': {**value('Its value, if none is given.', '0.5 m', 4),
                            'synonyms': ['value']},
                'min': {**value('The smallest value allowed.', '20 cm'),
                        'synonyms': ['minimum', 'smallest', 'from']},
                'max': {**value('The largest value allowed.', '4 m'),
                        'synonyms': ['maximum', 'largest', 'to']},
                'description': {
                    'description': 'A text to show.', 'expected': 'a text, in quotes',
                    'type': 'string', 'examples': ['of the square']}},
            'additionalProperties': False,
            'examples': ['0.5 m', {'default': 4, 'min': 1, 'max': 20}]},
        'examples': [{'side': {'default': '0.5 m', 'min': '20 cm', 'max': '4 m'}}]}


def _step_schema(kind: type[Step]) -> Schema:
    parts = kind.file_fields()
    first = next(iter(parts.values()))
    example = {name: part.examples[0] for name, part in parts.items()}
    mapping = {
        'required': [item.name for item in fields(kind)  # type: ignore[arg-type]
                     if item.default is not None],
        'additionalProperties': False,
        'properties': {name: _field_schema(part) for name, part in parts.items()}}
    # Under python -OO there are no docstrings, so the schema has no descriptions.
    head: Schema = {'description': (inspect.getdoc(kind) or '').partition('\n')[0]}
    if kind.synonyms:
        head['synonyms'] = list(kind.synonyms)
    if kind.form:
        return {**head, 'expected': kind.form, 'type': 'object', **mapping, 'examples': [example]}
    short = _field_schema(first)
    return {
        **short, **head, 'type': [*short['type'], 'object'],
        'examples': [first.examples[0], example], **mapping}


def _include_schema(inline: Schema) -> Schema:
    """Return the schema of an include, which has a motion with values, or steps."""
    name = {'description': 'The motion: a name that the package has, or a path seen from this '
            'file.', 'expected': 'a name or a path, as in ./mine.yaml', 'type': 'string',
            'pattern': '.', 'examples': ['square', './mine.yaml']}
    values = {'description': 'The values of its parameters.',
              'expected': 'keys with values, as in {side: 1 m}', 'type': 'object',
              'additionalProperties': {
                  'expected': 'a number, or a number with a unit, as in 1 m',
                  'type': ['number', 'string']},
              'examples': [{'side': '1 m'}]}
    return {
        **{key: value for key, value in inline.items() if key != 'required'},
        'type': ['string', 'object'], 'minProperties': 1,
        'properties': {'motion': name, 'with': values, **inline['properties']},
        'examples': ['square', {'motion': './mine.yaml', 'with': {'side': '1 m'}}]}


def _field_schema(part: FileField) -> Schema:
    return {'description': part.description, **_kind_schema(part.kind),
            'examples': list(part.examples)}


def _kind_schema(kind: object) -> Schema:
    match kind:
        case Quantity():
            return quantity_schema(kind, expressions=True)
        case Count():
            return {'expected': 'a whole number', 'type': ['integer', 'string'], 'minimum': 0,
                    'maximum': kind.largest, 'expressions': True,
                    'pattern': f'^{expression_pattern()}$'}
        case Text():
            return {'expected': 'a text, in quotes', 'type': 'string'}
        case PointField():
            return {'expected': 'a point: x and y, as in [1 m, 0.5 m]', 'type': ['array'],
                    'minItems': 2, 'maxItems': 2,
                    'items': {'description': 'x, then y.', **_kind_schema(LENGTH)}}
        case PointList():
            return {'expected': 'a list of points, as in [[1 m, 0 m], [1 m, 1 m]]',
                    'type': ['array'], 'minItems': 1,
                    'items': {'description': 'A point.', **_kind_schema(POINT)}}
        case _:
            return {'expected': "a list of steps, each beginning with '- '", 'type': 'array',
                    'items': {'$ref': '#/definitions/step'}}


def quantity_schema(quantity: Quantity, expressions: bool = False) -> Schema:
    """
    Return the JSON Schema of a value with a unit, such as ``0.2 m/s``, in a file.

    :param expressions: whether it can be computed, as in ``2 * $side``
    """
    bounds: Schema = {
        SignRule.ANY: {}, SignRule.NOT_NEGATIVE: {'minimum': 0},
        SignRule.POSITIVE: {'exclusiveMinimum': 0}}[quantity.sign]
    if math.isfinite(quantity.largest):
        bounds['maximum'] = int(quantity.largest)
    types = ['string'] if quantity.needs_unit else ['number', 'string']
    pattern: Schema = {'pattern': quantity.pattern}
    if expressions:
        pattern = {'pattern': f'{quantity.pattern}|^{expression_pattern()}$', 'expressions': True}
    return {'quantity': quantity.keyword, 'type': types, **pattern, **bounds}
