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
"""Check a file against a JSON Schema; build the motion schema from the step classes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
import difflib
from functools import cache
from importlib.resources import files
import inspect
import json
from typing import Any

from kachaka_simple_control.files.document import Document, INSTALL, Problem, UnreadableFileError
from kachaka_simple_control.files.yaml_document import parse_yaml, require_text
from kachaka_simple_control.motion.step_base import Count, FileField, KINDS, Step
from kachaka_simple_control.motion.units import QUANTITIES, Quantity, SignRule, UnitError
from kachaka_simple_control.text import quoted

PACKAGE = 'kachaka_simple_control'


def read_document(text: str, schema: Mapping[str, Any]) -> Document:
    """
    Read a YAML text, and check its values against a schema.

    :param text: the text of a file
    :param schema: a JSON Schema, Draft 7
    :returns: the values of the file, and the problems found in them
    :raises UnreadableFileError: if the text is not YAML, a library is missing, or there are too
        many problems
    """
    document = parse_yaml(require_text(text))
    try:
        from jsonschema import Draft7Validator
    except ImportError:
        raise UnreadableFileError(Problem(INSTALL)) from None
    for error in Draft7Validator(schema).iter_errors(document.root.data):
        for part, message in _MESSAGES[error.validator](error):
            document.add_problem(
                [*error.absolute_path, *([] if part is None else [part])], message)
    return document


@cache
def read_schema(path: str) -> dict[str, Any]:
    """
    Return a schema of the package.

    The text format of quantities is not in the schema file; it is added from ``QUANTITIES``.

    :param path: the path in the package, as in ``motions/motion.schema.json``
    """
    schema: dict[str, Any] = json.loads(
        files(PACKAGE).joinpath(path).read_text('utf-8'), object_hook=_with_quantity)
    return schema


def _with_quantity(schema: dict[str, Any]) -> dict[str, Any]:
    quantity = QUANTITIES.get(str(schema.get('quantity')))
    return {**schema, **_quantity_schema(quantity)} if quantity else schema


def nearest(word: str, known: Mapping[str, Any] | list[str]) -> str | None:
    """
    Return the known word that is most similar to a given word; None if none is similar.

    :param word: the given word
    :param known: the known words
    """
    close = difflib.get_close_matches(word.lower(), list(known), n=1)
    return close[0] if close else None


def did_you_mean(word: str, known: Mapping[str, Any] | list[str]) -> str:
    """
    Return the advice for an unknown word: the most similar known word, or else all known words.

    :param word: the unknown word
    :param known: the known words, or schemas with synonyms by known word
    """
    parts = known if isinstance(known, Mapping) else {}
    near = next((name for name, part in parts.items()
                 if word.lower() in part.get('synonyms', [])), nearest(word, known))
    return f'did you mean {near!r}?' if near else f'known are {", ".join(known)}'


#: The key that a message is about, or None, and the message.
_Messages = Iterator[tuple[str | None, str]]


def _type(error: Any) -> _Messages:
    quantity = QUANTITIES.get(error.schema.get('quantity'))
    is_number = isinstance(error.instance, (int, float)) and not isinstance(error.instance, bool)
    if quantity and quantity.needs_unit and is_number:
        yield None, quantity.without_unit(error.instance)
        return
    yield None, f'{_shown(error.instance)}; it must be {_expected(error.schema)}'


def _pattern(error: Any) -> _Messages:
    quantity = QUANTITIES.get(error.schema.get('quantity'))
    text = f'{_shown(error.instance)}; it must be {_expected(error.schema)}'
    if quantity:
        try:
            quantity.parse(error.instance)
        except UnitError as reason:
            text = str(reason)
    yield None, text


def _enum(error: Any) -> _Messages:
    choices = [str(choice) for choice in error.validator_value]
    yield None, f'{_shown(error.instance)}; it must be {" or ".join(choices)}'


def _unknown(error: Any) -> _Messages:
    known = error.schema['properties']
    if len(error.instance) > error.schema.get('maxProperties', len(error.instance)):
        return  # maxProperties has its own message
    for key in error.instance:
        if key not in known:
            yield key, f'there is no such {_entry(error)}; {did_you_mean(key, known)}'


def _missing(error: Any) -> _Messages:
    for key in error.validator_value:
        if key not in error.instance:
            yield None, missing(key, error.schema)


def missing(key: str, schema: Mapping[str, Any]) -> str:
    """
    Return the message for a key that is missing in a mapping.

    :param key: the missing key
    :param schema: the schema of the mapping
    """
    return f'{key!r} is missing: {_expected(schema["properties"][key])}'


def _too_few(error: Any) -> _Messages:
    yield None, f'nothing; it must be {_expected(error.schema)}'


def _too_many(error: Any) -> _Messages:
    keys = ' and '.join(quoted(key) for key in list(error.instance)[:3])
    yield None, (f"{keys} in one step; begin each step with '- ', and indent what belongs to it "
                 'by two more')


def _bound(words: str) -> Callable[[Any], _Messages]:
    def message(error: Any) -> _Messages:
        quantity = QUANTITIES.get(error.schema.get('quantity'))
        unit = f' {quantity.unit}' if quantity else ''
        yield None, (f'{error.instance}{unit}; it must be '
                     f'{words.format(error.validator_value)}{unit}')
    return message


#: The functions that make messages, by the schema keyword that is violated.
_MESSAGES: dict[str, Callable[[Any], _Messages]] = {
    'additionalProperties': _unknown,
    'enum': _enum,
    'exclusiveMinimum': _bound('above {}'),
    'maxProperties': _too_many,
    'maximum': _bound('at most {}'),
    'minProperties': _too_few,
    'minimum': _bound('at least {}'),
    'pattern': _pattern,
    'required': _missing,
    'type': _type,
}


def _entry(error: Any) -> str:
    return str(error.schema.get('entry', 'key'))


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


#: The path of the motion schema in the package, for editors; ``tools/write_schemas.py`` writes it.
PATH = 'motions/motion.schema.json'
Schema = dict[str, Any]


def motion_schema() -> Schema:
    """Return the JSON Schema of a motion, with all kinds of steps."""
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
    types = ['string'] if quantity.needs_unit else ['number', 'string']
    return {'quantity': quantity.keyword, 'type': types,
            'pattern': quantity.pattern, **bounds}
