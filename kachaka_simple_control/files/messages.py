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
Convert frozen dataclasses to JSON messages and back, and make their JSON Schema.

The types of the fields decide what a message may contain.  A message of another form is refused
with one sentence, so code that receives a message need not check it again.

Tested by test/files/test_protocol.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, Field, fields, is_dataclass, MISSING
from functools import cache
import json
import math
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    get_args,
    get_origin,
    get_type_hints,
    Literal,
    NoReturn,
    TypeVar,
    Union,
)

from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.text import quoted

#: The version of the messages; both ends must have the same.
VERSION = 1
#: The largest size of a message, without the line break at its end [bytes].
MAX_SIZE = 64_000
#: The largest whole number that JavaScript and Python read alike.
MAX_INTEGER = 2**53 - 1


class MessageError(ControlError, ValueError):
    """A message is invalid; the text says why, in one sentence."""


@dataclass(frozen=True)
class Range:
    """The lowest and the highest allowed number, for ``Annotated[float, Range(0.0, 1.0)]``."""

    lowest: float
    highest: float


@dataclass(frozen=True)
class Message:
    """The base class of all messages; a subclass is a frozen dataclass with a ``TYPE``."""

    #: The value of the key ``type``.
    TYPE: ClassVar[str] = ''


MessageT = TypeVar('MessageT', bound=Message)


def to_json(message: Message, max_size: int = MAX_SIZE) -> str:
    """
    Return a message as JSON text in one line, without a line break at the end.

    :param max_size: the largest size [bytes]
    :raises MessageError: if a number of the message is NaN or infinite, or the message is too long
    """
    values = {'v': VERSION, 'type': message.TYPE, **_plain(message)}
    try:
        text = json.dumps(values, separators=(',', ':'), allow_nan=False, default=_plain)
    except ValueError as error:
        raise MessageError(f'{message.TYPE!r}: {error}') from None
    # Only ASCII, so a character is a byte.
    if len(text) > max_size:
        raise MessageError(f'{message.TYPE!r}: {len(text)} bytes, more than {max_size}')
    return text


def _plain(value: Any) -> dict[str, Any]:
    """Return an object that JSON does not know, a message or a mapping, as a dict."""
    if isinstance(value, Mapping):
        return {**value}
    return {part.name: getattr(value, part.name) for part in fields(value)}


def from_json(
        text: str | bytes, kinds: Mapping[str, type[MessageT]],
        max_size: int = MAX_SIZE) -> MessageT:
    """
    Read a message from JSON text, and check it completely.

    :param text: the text, as ``str`` or in UTF-8
    :param kinds: the allowed classes of messages, by type; ``by_type()`` makes it
    :param max_size: the largest size [bytes]
    :raises MessageError: if the text is too long, no JSON, of an unknown type or another version,
        or if a value is missing, unknown or wrong
    """
    data = text.encode('utf-8', 'surrogatepass') if isinstance(text, str) else text
    if len(data) > max_size:
        raise MessageError(f'the message has more than {max_size} bytes')
    values = _decoded(data)
    if not isinstance(values, dict):
        raise MessageError('the message is no JSON object')
    version, name = values.pop('v', None), values.pop('type', None)
    if version != VERSION or isinstance(version, bool):
        raise MessageError(f"'v' is {_shown(version)}; it must be {VERSION}")
    if not isinstance(name, str) or name not in kinds:
        raise MessageError(f"'type' is {_shown(name)}, which is unknown here")
    try:
        message: MessageT = _read_fields(values, kinds[name], '')
    except MessageError as error:
        raise MessageError(f'{name!r}: {error}') from None
    return message


def by_type(kinds: Iterable[type[MessageT]]) -> dict[str, type[MessageT]]:
    """Return a dict of classes of messages; the keys are their types."""
    return {kind.TYPE: kind for kind in kinds}


def schema_of(title: str, kinds: Iterable[type[Message]]) -> dict[str, Any]:
    """Return the JSON Schema (Draft 7) of a message."""
    return {
        '$schema': 'http://json-schema.org/draft-07/schema#',
        'title': title,
        'oneOf': [_object_schema(kind, {
            'v': {'const': VERSION}, 'type': {'const': kind.TYPE}}) for kind in kinds]}


def _decoded(data: bytes) -> Any:
    try:
        return json.loads(
            data.decode('utf-8'), object_pairs_hook=_distinct, parse_constant=_refuse_constant)
    except MessageError:
        raise
    except (ValueError, RecursionError):
        raise MessageError('the message is no JSON text') from None


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) != len(pairs):
        raise MessageError('a key of the message occurs twice')
    return values


def _refuse_constant(name: str) -> NoReturn:
    raise MessageError(f'{name} is no number of a message')


@cache
def _types(kind: Any) -> dict[str, tuple[Any, Field[Any]]]:
    hints = get_type_hints(kind, include_extras=True)
    return {part.name: (hints[part.name], part) for part in fields(kind)}


def _is_required(part: Field[Any]) -> bool:
    return part.default is MISSING and part.default_factory is MISSING


def _read_fields(values: dict[str, Any], kind: Any, place: str) -> Any:
    parts = _types(kind)
    for name in values:
        if name not in parts:
            raise MessageError(f'there is no key {quoted(place + name)}')
    for name, (_, part) in parts.items():
        if name not in values and _is_required(part):
            raise MessageError(f"'{place}{name}' is missing")
    return kind(**{
        name: _read(value, parts[name][0], place + name) for name, value in values.items()})


def _read(value: Any, hint: Any, place: str) -> Any:
    """Check a value against a type; return it with lists as tuples, numbers as ``float``."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin is Annotated:
        number, allowed = _read(value, parts[0], place), parts[1]
        if not allowed.lowest <= number <= allowed.highest:
            _refuse(value, place, f'a number from {allowed.lowest} to {allowed.highest}')
        return number
    if origin in (Union, UnionType):
        return None if value is None else _read(value, parts[0], place)
    if origin is Literal:
        return value if isinstance(value, str) and value in parts else _refuse(
            value, place, f'one of {", ".join(parts)}')
    if origin is tuple:
        return _read_list(value, parts, place)
    if origin is not None:
        # Mapping[str, ...]: the only other generic type that fields have.
        if not isinstance(value, dict):
            _refuse(value, place, 'an object')
        return {key: part if parts[1] is Any else _read(part, parts[1], f'{place}.{key}')
                for key, part in value.items()}
    return _read_simple(value, hint, place)


def _read_list(value: Any, parts: tuple[Any, ...], place: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        _refuse(value, place, 'a list')
    if parts[-1] is Ellipsis:
        parts = parts[:1] * len(value)
    if len(parts) != len(value):
        raise MessageError(f"'{place}' has {len(value)} values; it must have {len(parts)}")
    return tuple(
        _read(part, hint, f'{place}[{index}]')
        for index, (part, hint) in enumerate(zip(value, parts)))


def _read_simple(value: Any, hint: Any, place: str) -> Any:
    if is_dataclass(hint):
        return _read_fields(value, hint, f'{place}.') if isinstance(value, dict) else _refuse(
            value, place, 'an object')
    if hint is float:
        return _read_float(value, place)
    if not isinstance(value, hint) or (isinstance(value, bool) and hint is not bool):
        _refuse(value, place, _EXPECTED[hint])
    if hint is int and abs(value) > MAX_INTEGER:
        _refuse(value, place, f'at most {MAX_INTEGER}')
    if hint is str and any('\ud800' <= char <= '\udfff' for char in value):
        # No file and no other program could take it.
        raise MessageError(f"'{place}' is no valid text: it has half a character")
    return value


def _read_float(value: Any, place: str) -> float:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        _refuse(value, place, 'a number')
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    return number if math.isfinite(number) else _refuse(value, place, 'a finite number')


_EXPECTED = {str: 'a text', int: 'a whole number', bool: 'true or false'}


def _refuse(value: Any, place: str, expected: str) -> NoReturn:
    raise MessageError(f"'{place}' is {_shown(value)}; it must be {expected}")


def _shown(value: Any) -> str:
    if isinstance(value, (dict, list)):
        return 'a list' if isinstance(value, list) else 'an object'
    if isinstance(value, str):
        return quoted(value)
    is_huge = isinstance(value, int) and abs(value) > MAX_INTEGER
    return 'too large' if is_huge else json.dumps(value)


def _object_schema(kind: Any, first: Mapping[str, Any]) -> dict[str, Any]:
    parts = _types(kind)
    properties = {name: _schema(hint) for name, (hint, _) in parts.items()}
    required = [name for name, (_, part) in parts.items() if _is_required(part)]
    return {'type': 'object', 'properties': {**first, **properties},
            'required': [*first, *required], 'additionalProperties': False}


def _schema(hint: Any) -> dict[str, Any]:
    origin, parts = get_origin(hint), get_args(hint)
    schema: dict[str, Any]
    if origin is Annotated:
        schema = {**_schema(parts[0]), 'minimum': parts[1].lowest, 'maximum': parts[1].highest}
    elif origin in (Union, UnionType):
        schema = {'anyOf': [_schema(parts[0]), {'type': 'null'}]}
    elif origin is Literal:
        schema = {'enum': list(parts)}
    elif origin is tuple and parts[-1] is Ellipsis:
        schema = {'type': 'array', 'items': _schema(parts[0])}
    elif origin is tuple:
        schema = {'type': 'array', 'items': [_schema(part) for part in parts],
                  'minItems': len(parts), 'maxItems': len(parts)}
    elif origin is not None:
        schema = {'type': 'object', 'additionalProperties': _schema(parts[1])}
    elif is_dataclass(hint):
        schema = _object_schema(hint, {})
    else:
        schema = {} if hint is Any else {'type': _JSON_TYPES[hint]}
    return schema


_JSON_TYPES = {str: 'string', int: 'integer', float: 'number', bool: 'boolean', NoneType: 'null'}
