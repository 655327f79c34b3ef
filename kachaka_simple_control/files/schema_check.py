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
Compile JSON Schemas to functions that only say whether a value is valid.

This takes a tenth of the time of jsonschema, which then explains what is wrong with a value.
Tested by test/files/test_schema.py.
"""

from __future__ import annotations

from collections.abc import Callable
import re
from typing import Any

Check = Callable[[Any], bool]
Schema = dict[str, Any]
_TYPES: dict[str, Check] = {
    'object': lambda value: isinstance(value, dict),
    'array': lambda value: isinstance(value, list),
    'string': lambda value: isinstance(value, str),
    'boolean': lambda value: isinstance(value, bool),
    'null': lambda value: value is None,
    'number': lambda value: isinstance(value, (int, float)) and not isinstance(value, bool),
    'integer': lambda value: not isinstance(value, bool) and (
        isinstance(value, int) or (isinstance(value, float) and value.is_integer()))}
#: What has no effect on whether a value is valid.
_NOTES = frozenset([
    '$schema', 'title', 'description', 'examples', 'definitions', 'expected', 'quantity',
    'synonyms', 'entry', 'expressions', 'amount'])
_PARTS = frozenset([
    'type', 'enum', 'pattern', 'properties', 'additionalProperties', 'items'])
_LIMITS: dict[str, Callable[[Any], Check]] = {
    'required': lambda keys: lambda value: all(key in value for key in keys),
    'minProperties': lambda count: lambda value: len(value) >= count,
    'maxProperties': lambda count: lambda value: len(value) <= count,
    'minItems': lambda count: lambda value: len(value) >= count,
    'maxItems': lambda count: lambda value: len(value) <= count,
    'minimum': lambda bound: lambda value: value >= bound,
    'maximum': lambda bound: lambda value: value <= bound,
    'exclusiveMinimum': lambda bound: lambda value: value > bound}
#: The type of the values to which a keyword applies.
_APPLIES = {
    **dict.fromkeys(('required', 'minProperties', 'maxProperties'), 'object'),
    **dict.fromkeys(('minItems', 'maxItems'), 'array'),
    **dict.fromkeys(('minimum', 'maximum', 'exclusiveMinimum'), 'number')}


_COMPILED: dict[int, tuple[Schema, Check]] = {}


def compile_schema(schema: Schema) -> Check:
    """
    Return a function that says whether a value is valid.

    It says no to all, so that jsonschema decides, if the schema has a keyword that is not known
    here.
    """
    # By identity, because a dict cannot be hashed; the few schemas of the package stay.
    if id(schema) not in _COMPILED:
        _COMPILED[id(schema)] = schema, _Compiler(schema).check(schema)
    return _COMPILED[id(schema)][1]


class _Compiler:
    """Compiles the parts of one schema, each once, because they may contain each other."""

    def __init__(self, whole: Schema) -> None:
        self._whole = whole
        self._known: dict[str, list[Check]] = {}

    def check(self, schema: Schema) -> Check:
        if '$ref' in schema:
            return self._referred(schema['$ref'])
        if set(schema) - _NOTES - _PARTS - set(_LIMITS):
            return lambda _: False
        types = schema.get('type', _TYPES)
        kinds = [(_TYPES[name], self._of_type(name, schema))
                 for name in ([types] if isinstance(types, str) else types)]
        choices = schema.get('enum')

        def is_valid(value: Any) -> bool:
            if choices is not None and value not in choices:
                return False
            return any(
                is_type(value) and all(part(value) for part in parts) for is_type, parts in kinds)
        return is_valid

    def _of_type(self, name: str, schema: Schema) -> list[Check]:
        """Return the checks of a value of one type."""
        checks = [limit(schema[key]) for key, limit in _LIMITS.items()
                  if key in schema and _APPLIES[key] in (name, name.replace('integer', 'number'))]
        if name == 'string' and 'pattern' in schema:
            pattern = re.compile(schema['pattern'])
            checks.append(lambda value: pattern.search(value) is not None)
        if name == 'array' and 'items' in schema:
            item = self.check(schema['items'])
            checks.append(lambda value: all(map(item, value)))
        if name == 'object':
            known = {key: self.check(part) for key, part in schema.get('properties', {}).items()}
            others = schema.get('additionalProperties', True)
            other: Check = self.check(others) if isinstance(others, dict) else (lambda _: others)
            checks.append(lambda value: all(
                known.get(key, other)(part) for key, part in value.items()))
        return checks

    def _referred(self, reference: str) -> Check:
        if reference not in self._known:
            self._known[reference] = found = []
            part: Any = self._whole
            for key in reference.removeprefix('#/').split('/'):
                part = part[key]
            found.append(self.check(part))
        compiled = self._known[reference]

        def is_valid(value: Any) -> bool:
            # Looked up now, because a step may contain steps.
            return compiled[0](value)
        return is_valid
