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
"""The values of a file, which know their lines, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.diagnostics import (
    format_path,
    KeyPath,
    MAX_PROBLEMS,
    Problem,
    UnreadableFileError,
)
from kachaka_simple_control.motion.units import Quantity, UnitError


@dataclass(eq=False)
class Node:
    """
    A value in a file.

    :param line: the line it begins in, or that of its key, counted from 1
    :param data: the value, as JSON has it
    :param children: the values in it, by key or index
    :param is_bad: whether a problem of it was recorded while the YAML was read
    :param has_problem: whether it, or something in it, has a problem
    """

    line: int
    data: Any
    children: dict[str | int, Node] = field(default_factory=dict)
    is_bad: bool = False
    has_problem: bool = False

    def along(self, path: KeyPath) -> list[Node]:
        """
        Return the values along a path, this one first, as far as there are any.

        :param path: keys and indices, from here
        """
        found = [self]
        for part in path:
            if part not in found[-1].children:
                break
            found.append(found[-1].children[part])
        return found

    def at(self, path: KeyPath) -> Node:
        """
        Return the value at the end of a path, or the last one along it that there is.

        :param path: keys and indices, from here
        """
        return self.along(path)[-1]


@dataclass(eq=False)
class Document:
    """
    The values of a file, and what is wrong with them.

    :param root: the outermost value
    :param problems: in the order in which they were found
    """

    root: Node
    problems: list[Problem] = field(default_factory=list)

    def add_problem(self, path: KeyPath, text: str) -> None:
        """
        Record what is wrong with a value, unless something was recorded for it already.

        :param path: the path of the value
        :param text: what is wrong
        :raises UnreadableFileError: if there are too many problems
        """
        nodes = self.root.along(path)
        if len(nodes) > len(path) and nodes[-1].is_bad:
            return
        self.problems.append(Problem(text, nodes[-1].line, format_path(path)))
        for node in nodes:
            node.has_problem = True
        if len(self.problems) >= MAX_PROBLEMS:
            raise UnreadableFileError(*self.problems)

    def add_error(self, path: KeyPath, error: InvalidMotionError) -> None:
        """
        Record the error of a class that refused its fields.

        :param path: the path of the mapping that the object was to be made from
        :param error: its message begins with the name of the field, as in ``speed is ...``
        """
        field_name, verb, rest = error.message.partition(' is ')
        if verb and field_name.isidentifier():
            self.add_problem([*path, field_name], rest)
        else:
            self.add_problem(path, error.message)

    def read_quantity(self, path: KeyPath, quantity: Quantity) -> float | None:
        """
        Return a value in its SI unit; None, and a problem is recorded, if it is not one.

        :param path: the path of the value
        :param quantity: what it is to be
        """
        value = self.root.at(path).data
        try:
            return quantity.parse(value) if isinstance(value, str) else float(value)
        except UnitError as error:
            self.add_problem(path, str(error))
            return None

    def read_quantities(
            self, path: KeyPath, quantities: Mapping[str, Quantity]) -> dict[str, float]:
        """
        Return the quantities of a mapping in SI units, without those that are missing or wrong.

        :param path: the path of the mapping
        :param quantities: what each of its keys is to be
        """
        node = self.root.at(path)
        numbers = {
            key: self.read_quantity([*path, key], quantity) for key, quantity in quantities.items()
            if key in node.children and not node.children[key].has_problem}
        return {key: number for key, number in numbers.items() if number is not None}
