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
List the steps of a motion whose paths depend on the poses at which they begin.

A step such as ``Goto`` becomes turns and legs, by following the motion from pose to pose.

Tested by test/motion/test_waypoints.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import advance, compose, ORIGIN, Pose
from kachaka_simple_control.motion.step_base import Step


@dataclass(frozen=True)
class Leaf:
    """
    A step that does not depend on a pose, with its place in the motion.

    :param path: its place, as in ``steps[2].goto.forward``
    :param place: the place of its fields, as in ``steps[2].goto.forward.``
    :param corners: its tolerance of corners [m]
    :param included: the name of the motion that includes it; empty if none does
    """

    path: str
    step: Step
    place: str
    speed_place: str
    corners: float
    included: str = ''


class Block(NamedTuple):
    """
    Steps that are driven several times, always on the same path seen from their start.

    :param parts: the steps, in driving order
    """

    times: int
    parts: Sequence[Leaf | Block]


def depends_on_pose(step: Step) -> bool:
    """
    Return whether the path of a step depends on the pose at its start.

    :param step: the step; a block without a frame of its own depends on it if a step in it does
    """
    block = step.block()
    if block is None:
        return step.is_placed
    return not step.has_frame and any(map(depends_on_pose, block[1]))


def has_placed_steps(step: Step) -> bool:
    """Return whether a step, or one in its block, depends on the pose at its start."""
    block = step.block()
    return step.is_placed if block is None else any(map(has_placed_steps, block[1]))


class Placer:
    """
    Follows the steps of a motion from pose to pose, and turns each goto into turns and legs.

    :param corners: the tolerance of corners of the motion [m]
    :param visit: called with each step that is listed; an error ends the list
    :param refuse: called with the place of each wrong value, and the error
    """

    def __init__(
            self, corners: float, visit: Callable[[Leaf], None],
            refuse: Callable[[str, InvalidMotionError], None]) -> None:
        self._corners, self._visit, self._refuse = corners, visit, refuse
        self._pose = ORIGIN
        self._included = ''

    def parts(self, steps: Sequence[Step], prefix: str) -> list[Leaf | Block]:
        """
        Return the steps that drive some steps, from the current pose on.

        :param prefix: the place of the steps in the motion, as in ``steps[3].repeat.``
        """
        found: list[Leaf | Block] = []
        for index, step in enumerate(steps):
            path = f'{prefix}steps[{index}]'
            place = f'{path}.{step.keyword}.'
            if (block := step.block()) is None:
                found += self._leaves(step, path, place)
            elif step.has_frame:
                found.append(self._framed(step, block[1], place))
            elif depends_on_pose(step):
                found += self._unrolled(*block, place)
            else:
                found.append(self._repeated(*block, place))
        return found

    def _leaves(self, step: Step, path: str, place: str) -> list[Leaf]:
        if not step.is_placed:
            leaves = [Leaf(path, step, place, f'{place}speed', self._corners,
                           self._included)]
            for segment in step.path():
                self._pose = advance(self._pose, segment.length, segment.angle)
        else:
            parts, self._pose = step.placed(
                self._pose, lambda name, error: self._refuse(place + name, error))
            corners = self._corners if step.corners is None else step.corners
            leaves = [Leaf(place + part.name, part.step, f'{place}{part.name}.', f'{place}speed',
                           corners, self._included) for part in parts]
        for leaf in leaves:
            self._visit(leaf)
        return leaves

    def _framed(self, step: Step, steps: Sequence[Step], place: str) -> Block:
        outside = self._corners, self._included
        self._included = step.name or ''
        if step.corners is not None:
            self._corners = step.corners
        block = self._repeated(1, steps, place)
        self._corners, self._included = outside
        return block

    def _repeated(self, times: int, steps: Sequence[Step], place: str) -> Block:
        start, self._pose = self._pose, ORIGIN
        block = Block(times, self.parts(steps, place))
        self._pose = compose(start, _power(self._pose, times))
        return block

    def _unrolled(self, times: int, steps: Sequence[Step], place: str) -> list[Leaf | Block]:
        """Return the steps of each repetition; those after a known pose are a block."""
        passes: list[list[Leaf | Block]] = []
        known: dict[Pose, int] = {}
        for index in range(times):
            if (first := known.setdefault(self._pose, index)) != index:
                # From here on the repetitions are the same again and again.
                cycle, left = passes[first:], times - index
                whole, rest = divmod(left, len(cycle))
                again = Block(whole, [*chain.from_iterable(cycle)])
                self._pose = list(known)[first + rest]
                return [*chain.from_iterable(passes), again, *chain.from_iterable(cycle[:rest])]
            passes.append(self.parts(steps, place))
        return [*chain.from_iterable(passes)]


def leaves(parts: Sequence[Leaf | Block]) -> Iterator[Leaf]:
    """Yield the steps of some parts in driving order, with each repetition."""
    for part in parts:
        if isinstance(part, Leaf):
            yield part
        else:
            for _ in range(part.times):
                yield from leaves(part.parts)


def _power(pose: Pose, times: int) -> Pose:
    """Return the pose after a displacement was driven several times."""
    result = ORIGIN
    while times:
        if times % 2:
            result = compose(result, pose)
        pose, times = compose(pose, pose), times // 2
    return result
