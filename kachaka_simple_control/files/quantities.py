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
"""From values in a file to numbers in SI units."""

from __future__ import annotations

from collections.abc import Mapping

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.diagnostics import KeyPath
from kachaka_simple_control.files.yaml_document import Document
from kachaka_simple_control.motion.units import Quantity, UnitError


def read_quantities(
        document: Document, way: KeyPath, quantities: Mapping[str, Quantity]) -> dict[str, float]:
    """
    Return the quantities of a mapping, in SI units; object to those that are none.

    :param document: what is in the file
    :param way: the way to the mapping
    :param quantities: what each of its keys is
    :returns: a number for each key that is there and good
    """
    node = document.root.at(way)
    numbers: dict[str, float] = {}
    for key, quantity in quantities.items():
        if key in node.children and not node.children[key].has_problem:
            number = read_quantity(document, [*way, key], quantity)
            if number is not None:
                numbers[key] = number
    return numbers


def read_quantity(document: Document, way: KeyPath, quantity: Quantity) -> float | None:
    """
    Return a quantity in its SI unit; object to what is none.

    :param document: what is in the file
    :param way: the way to it
    :param quantity: what it is
    :returns: the number; None if it is none
    """
    value = document.root.at(way).data
    try:
        return quantity.parse(value) if isinstance(value, str) else float(value)
    except UnitError as error:
        document.add_problem(way, str(error))
        return None


def add_error(document: Document, way: KeyPath, error: InvalidMotionError) -> None:
    """
    Object to a value in the words of the class that refused it.

    :param document: what is in the file
    :param way: the way to what was to be made an object of that class
    :param error: what it said, beginning with the name of the field
    """
    field, verb, rest = error.message.partition(' is ')
    if verb and field.isidentifier():
        document.add_problem([*way, field], f'{rest}')
    else:
        document.add_problem(way, error.message)
