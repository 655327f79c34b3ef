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
Make the JSON Schemas for editors, which know the parameters of the library.

The program does not validate values with them: it reads the included file itself, and says more.

Tested by test/files/test_schema.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from kachaka_simple_control.files.amounts import dimension_of, PARAMETER_QUANTITIES
from kachaka_simple_control.files.expressions import expression_pattern
from kachaka_simple_control.files.fleet_file import fleet_schema
from kachaka_simple_control.files.motion_reader import read_all_parameters
from kachaka_simple_control.files.motion_schema import AMOUNT, motion_schema
from kachaka_simple_control.files.parameters import Parameter
from kachaka_simple_control.files.schema_check import Schema
from kachaka_simple_control.files.yaml_document import look_up, names_in
from kachaka_simple_control.motion.units import DIGITS


def editor_schema() -> Schema:
    """Return ``motion_schema()`` with the values that an include may give to each motion."""
    schema = motion_schema()
    step = schema['definitions']['step']
    steps = step['properties']
    include = {**steps['include'], 'allOf': value_rules(library_parameters(), True)}
    return {**schema, 'definitions': {**schema['definitions'], 'step': {
        **step, 'properties': {**steps, 'include': include}}}}


def fleet_editor_schema() -> Schema:
    """Return ``fleet_schema()`` with the values that a robot may give to each motion."""
    schema = fleet_schema()
    robot = {**schema['definitions']['robot'], 'allOf': value_rules(library_parameters(), False)}
    return {**schema, 'definitions': {**schema['definitions'], 'robot': robot}}


def library_parameters() -> dict[str, tuple[Parameter, ...]]:
    """Return the parameters of each motion that comes with the package as a file, by its name."""
    names = names_in('motions')
    return {name: read_all_parameters(look_up(name, 'motions', names)[1]) for name in names}


def value_rules(
        motions: Mapping[str, Iterable[Parameter]], expressions: bool) -> list[Schema]:
    """
    Return for each motion a schema of a mapping with ``motion`` and ``with``, or of its name.

    :param expressions: whether a value can be computed, as in ``2 * $side``
    """
    return [_rule(name, tuple(parameters), expressions) for name, parameters in motions.items()]


def _rule(name: str, parameters: Iterable[Parameter], expressions: bool) -> Schema:
    values: Schema = {
        'properties': {
            parameter.name: _value_schema(parameter, expressions) for parameter in parameters},
        'additionalProperties': False}
    condition: Schema = {
        'type': 'object', 'required': ['motion'], 'properties': {'motion': {'const': name}}}
    rule: Schema = {'properties': {'with': values}}
    if needed := [parameter.name for parameter in parameters if parameter.default is None]:
        values['required'] = needed
        rule.update({'type': 'object', 'required': ['with']})
        condition = {'anyOf': [{'const': name}, condition]}
    return {'if': condition, 'then': rule}


def _value_schema(parameter: Parameter, expressions: bool) -> Schema:
    kind = parameter.kind
    units = [unit for quantity in PARAMETER_QUANTITIES for unit in quantity.units
             if kind and dimension_of(quantity.unit) == kind.dimension]
    pattern = AMOUNT['pattern'] if kind is None else (
        f'^[-+]?{DIGITS} *({"|".join(units)})$' if units else f'^[-+]?{DIGITS}$')
    schema: Schema = {
        'description': ': '.join(filter(None, [str(parameter), parameter.description])),
        'type': 'string' if units else ['number', 'string'],
        'pattern': f'{pattern}|^{expression_pattern()}$' if expressions else pattern}
    if not units:
        for key, bound in (('minimum', parameter.smallest), ('maximum', parameter.largest)):
            if bound is not None:
                schema[key] = bound.amount.value
    return schema
