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
"""Read the parameters of a motion file, and the values that they are given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
import re
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.amounts import (
    Amount,
    dimension_of,
    PARAMETER_QUANTITIES,
    read_value,
    unit_of,
)
from kachaka_simple_control.files.document import Document
from kachaka_simple_control.files.expressions import NAME
from kachaka_simple_control.files.wording import did_you_mean
from kachaka_simple_control.motion.units import require_finite, UnitError

#: The largest number of parameters of a file.
MAX_PARAMETERS = 100


class Value(NamedTuple):
    """An amount, and the text that it was written as, for messages."""

    amount: Amount
    text: str


#: What a program may give as the value of a parameter: a text with a unit, or an SI number.
Given = str | float


@dataclass(frozen=True)
class Parameter:
    """
    A parameter of a motion file.

    :param default: its value if none is given; None if one must be given
    :param smallest: the smallest value allowed; None for any
    :param largest: the largest value allowed; None for any
    :param line: the line in its file
    :param is_bad: whether the file is wrong about it, so that it has no value
    """

    name: str
    default: Value | None = None
    smallest: Value | None = None
    largest: Value | None = None
    description: str = ''
    line: int | None = None
    is_bad: bool = False

    @property
    def kind(self) -> Amount | None:
        """Return an amount of its dimension; None for any dimension."""
        for value in (self.default, self.smallest, self.largest):
            if value is not None:
                return value.amount
        return None

    @property
    def bounds(self) -> str:
        """Return the bounds as text, as in ``20 cm to 4 m``; empty without bounds."""
        if self.smallest and self.largest:
            return f'{self.smallest.text} to {self.largest.text}'
        return (f'at least {self.smallest.text}' if self.smallest else
                f'at most {self.largest.text}' if self.largest else '')

    def __str__(self) -> str:
        """Return name, default and bounds, as in ``side 0.5 m (20 cm to 4 m)``."""
        notes = [*([] if self.default else ['to be given']), *filter(None, [self.bounds])]
        return ' '.join([self.name, *([self.default.text] if self.default else []),
                         *([f'({", ".join(notes)})'] if notes else [])])

    def value(self, given: Given) -> Value:
        """
        Return the value that a program gave.

        :raises UnitError: if it is no value of this parameter
        """
        if isinstance(given, str):
            value = Value(read_value(given), given.strip())
        else:
            unit = unit_of(self.kind.dimension) if self.kind else ''
            try:
                number = require_finite(self.name, given, unit)
            except InvalidMotionError as error:
                raise UnitError(error.message) from None
            short = f'{number:.10g}'
            # Such that the text, which reports keep, reads back as this value.
            text = f'{short if float(short) == number else repr(number)} {unit}'.strip()
            value = Value(read_value(text), text)
        self.check(value)
        return value

    def check(self, value: Value) -> None:
        """
        Check the dimension and the bounds of a value.

        :raises UnitError: if they are wrong
        """
        amount, text = value
        if self.kind is not None and amount.dimension != self.kind.dimension:
            quantity = next((one for one in PARAMETER_QUANTITIES
                             if dimension_of(one.unit) == self.kind.dimension), None)
            if quantity is not None and not any(amount.dimension):
                raise UnitError(quantity.without_unit(text))
            raise UnitError(f'{text} is {amount.kind}; it must be {self.kind.kind}' + (
                f', as in {quantity.example}' if quantity else ''))
        if self.largest and self.largest.amount < amount:
            raise UnitError(f'{text} is above its largest, {self.largest.text}')
        if self.smallest and amount < self.smallest.amount:
            raise UnitError(f'{text} is below its smallest, {self.smallest.text}')


def read_parameters(document: Document) -> dict[str, Parameter]:
    """Return the parameters of a file by name, and record the problems of the others."""
    nodes = document.root.at(['parameters']).children if (
        isinstance(document.root.data, dict) and 'parameters' in document.root.children) else {}
    if len(nodes) > MAX_PARAMETERS:
        document.add_problem(['parameters'], f'{len(nodes)}; at most {MAX_PARAMETERS} are read')
        return {}
    found = {str(name): _read_parameter(document, str(name)) for name in nodes}
    return {name: replace(parameter, is_bad=nodes[name].has_problem)
            for name, parameter in found.items()}


def _read_parameter(document: Document, name: str) -> Parameter:
    path = ['parameters', name]
    node = document.root.at(path)
    if not re.fullmatch(NAME, name):
        document.add_problem(path, 'a name has letters a to z, digits and underscores, and '
                             'begins with no digit')
    is_short = not isinstance(node.data, dict)
    found = Parameter(
        name, description='' if is_short else str(node.data.get('description', '')),
        line=node.line)
    if is_short and node.data is None:
        return found
    # The default last, so that it is compared with the bounds.
    for key, attribute in _VALUES.items():
        place = path if is_short and key == 'default' else [*path, key]
        nodes = document.root.along(place)
        if len(nodes) <= len(place) or nodes[-1].has_problem:
            continue
        text = str(nodes[-1].data)
        try:
            value = Value(read_value(text), text)
            found.check(value)
        except UnitError as error:
            document.add_problem(place, str(error))
        else:
            found = replace(found, **{attribute: value})  # type: ignore[arg-type]
    return found


_VALUES = {'min': 'smallest', 'max': 'largest', 'default': 'default'}


def assign(
        parameters: Mapping[str, Parameter],
        given: Mapping[str, Given | Value]) -> tuple[dict[str, Amount | None], dict[str, str]]:
    """
    Return the value of each parameter: the one given, or its default.

    :returns: the values, None for one that is wrong; and by name what is wrong with a value, with
        a name, or because no value is given
    """
    values: dict[str, Amount | None] = dict.fromkeys(parameters)
    problems = {
        str(name): f'there is no parameter {str(name)!r}; ' + (
            did_you_mean(str(name), list(parameters)) if parameters else 'the file has none')
        for name in given if name not in parameters}
    for name, parameter in parameters.items():
        try:
            value = parameter.default
            if name in given:
                one = given[name]
                value = one if isinstance(one, Value) else parameter.value(one)
                parameter.check(value)
        except UnitError as error:
            problems[name] = str(error)
            continue
        if value is not None:
            values[name] = value.amount
        elif not parameter.is_bad:
            kind = parameter.kind.kind if parameter.kind else 'a value'
            bounds = f', {parameter.bounds}' if parameter.bounds else ''
            problems[name] = f'it must be given: {kind}{bounds}'
    return values, problems
