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
"""From what is in a file to the steps of a motion."""

from __future__ import annotations

from collections.abc import Iterable

from kachaka_simple_control.motion.errors import InvalidMotionError
from kachaka_simple_control.motion.steps import Repeat, Step
from kachaka_simple_control.motion_file.document import Document
from kachaka_simple_control.motion_file.problems import Place
from kachaka_simple_control.motion_file.quantities import (
    object_with,
    read_quantities,
    read_quantity,
)
from kachaka_simple_control.motion_file.step_kinds import Kind, KINDS, REPEAT


def read_steps(document: Document, way: Place) -> tuple[Step, ...]:
    """
    Return the steps of a list; object to those that are none, and leave them out.

    :param document: what is in the file, held against the schema already
    :param way: the way to the list
    :returns: the steps
    """
    nodes = document.root.on_the_way(way)
    if len(nodes) <= len(way) or not isinstance(nodes[-1].data, list):
        return ()
    steps = (_read_step(document, [*way, index]) for index in range(len(nodes[-1].data)))
    return tuple(step for step in steps if step is not None)


def count(steps: Iterable[Step]) -> int:
    """
    Return how many steps there are to do, each repeat counted as one more.

    :param steps: the steps
    :returns: the number, without doing any
    """
    return sum(
        1 + step.times * count(step.steps) if isinstance(step, Repeat) else 1 for step in steps)


def _read_step(document: Document, way: Place) -> Step | None:
    node = document.root.at(way)
    word = next(iter(node.children), None) if isinstance(node.data, dict) else None
    way = [*way, str(word)]
    if word == REPEAT:
        return _read_repeat(document, way)
    return None if node.is_spoilt else _read_simple(document, way, KINDS[str(word)])


def _read_simple(document: Document, way: Place, kind: Kind) -> Step | None:
    node = document.root.at(way)
    if isinstance(node.data, dict):
        numbers = read_quantities(document, way, kind.quantities)
    else:
        number = read_quantity(document, way, kind.quantities[kind.first])
        numbers = {} if number is None else {kind.first: number}
    return None if node.is_spoilt else _make(document, way, kind, numbers)


def _make(
        document: Document, way: Place, kind: Kind, numbers: dict[str, float]) -> Step | None:
    try:
        return kind.make(**numbers)
    except InvalidMotionError as error:
        object_with(document, way, error)
        return None


def _read_repeat(document: Document, way: Place) -> Step | None:
    node = document.root.at(way)
    steps = read_steps(document, [*way, 'steps'])
    if node.is_spoilt:
        return None
    try:
        return Repeat(int(node.data['times']), steps)
    except InvalidMotionError as error:
        object_with(document, way, error)
        return None
