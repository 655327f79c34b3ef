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
"""What is in a file: values, each with its line."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from kachaka_simple_control.motion_file.problems import (
    dotted,
    MAX_PROBLEMS,
    Place,
    Problem,
    UnreadableFileError,
)


@dataclass(eq=False)
class Node:
    """
    A value in a file.

    :param line: the line it begins in, or that of its key, counted from 1
    :param data: the value, as JSON has it
    :param children: what is in it, by key or index
    :param is_bad: whether something is wrong with it, and was said
    :param is_spoilt: whether it is bad, or something in it is
    """

    line: int
    data: Any
    children: dict[str | int, Node] = field(default_factory=dict)
    is_bad: bool = False
    is_spoilt: bool = False

    def on_the_way(self, way: Place) -> list[Node]:
        """
        Return the values on the way to a place, this one first.

        :param way: keys and indices, from here
        :returns: the values, as far as there are any
        """
        found = [self]
        for part in way:
            if part not in found[-1].children:
                break
            found.append(found[-1].children[part])
        return found

    def at(self, way: Place) -> Node:
        """
        Return the value at a place.

        :param way: keys and indices, from here
        :returns: the value, or the last one on the way where the way ends before
        """
        return self.on_the_way(way)[-1]


@dataclass(eq=False)
class Document:
    """
    What is in a file.

    :param root: all of it
    :param problems: what is wrong with it
    """

    root: Node
    problems: list[Problem] = field(default_factory=list)

    def object_to(self, way: Place, text: str) -> None:
        """
        Say what is wrong with a value, unless something is that was said already.

        :param way: the way to the value
        :param text: what is wrong
        :raises UnreadableFileError: if that is enough
        """
        nodes = self.root.on_the_way(way)
        if len(nodes) > len(way) and nodes[-1].is_bad:
            return
        self.problems.append(Problem(text, nodes[-1].line, dotted(way)))
        for node in nodes:
            node.is_spoilt = True
        if len(self.problems) >= MAX_PROBLEMS:
            raise UnreadableFileError(*self.problems)
