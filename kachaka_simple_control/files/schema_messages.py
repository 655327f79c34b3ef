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
Write a message for each value that the JSON Schema of a file forbids.

Tested by test/files/test_document.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from kachaka_simple_control.files.amounts import read_value
from kachaka_simple_control.files.expressions import compute, compute_count, is_expression
from kachaka_simple_control.files.schema_check import Schema
from kachaka_simple_control.files.wording import did_you_mean, step_advice
from kachaka_simple_control.motion.units import QUANTITIES, UnitError
from kachaka_simple_control.text import quoted

_Messages = Iterator[tuple[str | None, str]]


def messages(error: Any) -> _Messages:
    """
    Return pairs of a key and a message about its value, for an error of jsonschema.

    The key is None if the message is about the whole value that was checked.
    """
    return _MESSAGES[error.validator](error)


def _wrong(error: Any) -> _Messages:
    quantity, value = QUANTITIES.get(error.schema.get('quantity')), error.instance
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    text = f'{_shown(value)}; it must be {_expected(error.schema)}'
    if quantity and quantity.needs_unit and is_number:
        text = quantity.without_unit(value)
    elif isinstance(value, str):
        try:
            _read_as(error.schema, value)
        except UnitError as reason:
            text = str(reason)
    yield None, text


def _read_as(schema: Schema, text: str) -> None:
    """Raise a UnitError that says more about a text than its schema."""
    quantity = QUANTITIES.get(schema.get('quantity', ''))
    if quantity and schema.get('expressions'):
        compute(text, quantity, None)
    elif quantity:
        quantity.parse(text)
    elif schema.get('expressions') and is_expression(text):
        compute_count(text, None)
    elif schema.get('amount'):
        read_value(text)


def _enum(error: Any) -> _Messages:
    choices = [str(choice) for choice in error.validator_value]
    yield None, f'{_shown(error.instance)}; it must be {" or ".join(choices)}'


def _unknown(error: Any) -> _Messages:
    known = error.schema['properties']
    if len(error.instance) > error.schema.get('maxProperties', len(error.instance)):
        return  # maxProperties has its own message
    for key in error.instance:
        if key not in known:
            entry = error.schema.get('entry', 'key')
            steps = error.schema.get('definitions', {}).get('step', {}).get('properties', ())
            advice = step_advice(key, error.instance[key]) if entry == 'step' else (
                'it is a step: put it below `steps:`, after `- `' if key in steps else None)
            yield key, advice or f'there is no such {entry}; {did_you_mean(key, known)}'


def _missing(error: Any) -> _Messages:
    for key in error.validator_value:
        if key not in error.instance:
            yield None, missing(key, error.schema)


def missing(key: str, schema: Mapping[str, Any]) -> str:
    """
    Return an error message about a missing key; it says which value the key must have.

    :param schema: the JSON Schema of the mapping that must have the key
    """
    return f'{key!r} is missing: {_expected(schema["properties"][key])}'


def _too_few(error: Any) -> _Messages:
    yield None, f'nothing; it must be {_expected(error.schema)}'


def _number_of_items(error: Any) -> _Messages:
    found = f'a list of {len(error.instance)}' if error.instance else 'an empty list'
    yield None, f'{found}; it must be {_expected(error.schema)}'


def _too_many(error: Any) -> _Messages:
    keys = ' and '.join(quoted(key) for key in list(error.instance)[:3])
    yield None, (f"{keys} in one step; begin each step with '- ', and indent what belongs to it "
                 'by two more')


def _beyond(error: Any) -> _Messages:
    quantity = QUANTITIES.get(error.schema.get('quantity'))
    if quantity and quantity.needs_unit:
        return  # a number without a unit has its own message
    unit = f' {quantity.unit}' if quantity else ''
    bound = f'{_BOUNDS[error.validator]} {error.validator_value}{unit}'
    yield None, f'{error.instance}{unit}; it must be {bound}'


_BOUNDS = {'exclusiveMinimum': 'above', 'maximum': 'at most', 'minimum': 'at least'}
#: For each keyword of JSON Schema, the function that writes the messages about its violation.
_MESSAGES: dict[str, Callable[[Any], _Messages]] = {
    'additionalProperties': _unknown,
    'enum': _enum,
    'maxProperties': _too_many,
    'minProperties': _too_few,
    'required': _missing,
    **dict.fromkeys(('minItems', 'maxItems'), _number_of_items),
    **dict.fromkeys(('pattern', 'type'), _wrong),
    **dict.fromkeys(_BOUNDS, _beyond)}


def _expected(schema: Mapping[str, Any]) -> str:
    quantity = QUANTITIES.get(schema.get('quantity', ''))
    return quantity.wanted if quantity else str(schema['expected'])


def _shown(value: Any) -> str:
    if value is None:
        return 'nothing'
    if isinstance(value, (dict, list)):
        return 'a list' if isinstance(value, list) else 'keys with values'
    return str(value).lower() if isinstance(value, bool) else quoted(value) if isinstance(
        value, str) else repr(value)
