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
Read the steps of a motion file.

Tested by test/files/test_motion_file.py.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.document import Document, KeyPath
from kachaka_simple_control.files.motion_schema import POINT
from kachaka_simple_control.motion.include import Include
from kachaka_simple_control.motion.step_base import (
    Count,
    FieldKind,
    KINDS,
    PointField,
    PointList,
    Step,
    StepList,
    Text,
)
from kachaka_simple_control.motion.units import LENGTH, Quantity


class StepReader:
    """
    Reads the steps of one file, whose values agree with the JSON Schema or have problems.

    :param include: called with the path of a step that includes a file; returns the step, or None
        with recorded problems
    """

    def __init__(
            self, document: Document, include: Callable[[KeyPath], Step | None]) -> None:
        self._document, self._include = document, include

    def steps(self, path: KeyPath) -> tuple[Step, ...]:
        """Return the valid steps of a list; the problems of the others are recorded."""
        nodes = self._document.root.along(path)
        if len(nodes) <= len(path) or not isinstance(nodes[-1].data, list):
            return ()
        steps = (self._step([*path, index]) for index in range(len(nodes[-1].data)))
        return tuple(step for step in steps if step is not None)

    def _step(self, path: KeyPath) -> Step | None:
        node = self._document.root.at(path)
        word = str(next(iter(node.children), ''))
        if word not in KINDS:
            return None
        path, kind = [*path, word], KINDS[word]
        if kind is Include and 'steps' not in node.children[word].children:
            return None if node.has_problem else self._include(path)
        return self._fields(path, kind)

    def _fields(self, path: KeyPath, kind: type[Step]) -> Step | None:
        document = self._document
        step, node = document.root.at(path[:-1]), document.root.at(path)
        parts, is_short = kind.file_fields(), not isinstance(node.data, dict)
        is_good = not step.has_problem
        values: dict[str, Any] = {}
        for name in ([next(iter(parts))] if is_short else parts):
            place = path if is_short else [*path, name]
            if isinstance(parts[name].kind, StepList):
                # Read nested steps even if this step is invalid, to report all their errors.
                values[name] = self.steps(place)
            elif is_good and (is_short or name in node.children):
                values[name] = self._value(place, parts[name].kind)
        if step.has_problem:
            return None
        try:
            return kind(**values)
        except InvalidMotionError as error:
            document.add_error(path, error)
            return None

    def _value(self, path: KeyPath, kind: FieldKind) -> Any:
        """
        Return a value of a step: a number, a text, a point or a list of points.

        If the value is invalid, record a problem; the returned value is then of no use.
        """
        document = self._document
        match kind:
            case Quantity():
                return document.read_quantity(path, kind)
            case Count():
                return document.read_count(path, kind.largest)
            case PointField():
                return tuple(document.read_quantity([*path, index], LENGTH) for index in range(2))
            case PointList():
                points = range(len(document.root.at(path).data))
                return tuple(self._value([*path, index], POINT) for index in points)
            case Text() | StepList():
                return document.root.at(path).data
