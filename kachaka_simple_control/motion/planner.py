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
"""Check the steps of a motion against limits, and make their trajectories."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.step_base import MAX_DURATION, Step
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.trajectory import Trajectory

#: The largest number of steps of a motion, each repetition counted.
MAX_STEPS = 1_000_000


class Part(ABC):
    """A part of a motion with its limits applied: a step or a block of repeated parts."""

    @abstractmethod
    def total(self, measure: Callable[[PlannedItem], float]) -> float:
        """Return the sum of a measure over all items; a repeated item counts each time."""

    @abstractmethod
    def expand(self) -> list[PlannedItem]:
        """Return the items in driving order; a repeated item occurs each time."""


# Compared by identity: a repeated item is one object.
@dataclass(frozen=True, eq=False)
class PlannedItem(Part):
    """
    A step at its place in a motion, with its trajectories.

    :param path: the place of the step, as in ``steps[3].repeat.steps[0]``
    :param step: the step, not a block of steps
    :param trajectories: the trajectories that drive the step, in order
    """

    path: str
    step: Step
    trajectories: Sequence[Trajectory]

    @property
    def duration(self) -> float:
        """Return the duration of the step, driven once [s]."""
        return sum(trajectory.duration for trajectory in self.trajectories)

    def total(self, measure: Callable[[PlannedItem], float]) -> float:
        """Return the measure of this item."""
        return measure(self)

    def expand(self) -> list[PlannedItem]:
        """Return this item."""
        return [self]


@dataclass(frozen=True, eq=False)
class RepeatBlock(Part):
    """
    Parts that are driven several times.

    :param times: the number of repetitions
    :param parts: the parts that are driven each time
    """

    times: int
    parts: Sequence[Part]

    def total(self, measure: Callable[[PlannedItem], float]) -> float:
        """Return the sum of a measure over all items; a repeated item counts each time."""
        return self.times * sum(part.total(measure) for part in self.parts)

    def expand(self) -> list[PlannedItem]:
        """Return the items in driving order; a repeated item occurs each time."""
        return [item for part in self.parts for item in part.expand()] * self.times


def find_errors(motion: Motion, limits: Limits) -> list[InvalidMotionError]:
    """
    Return all errors of a motion for the limits of a robot.

    :param motion: the motion
    :param limits: the limits of the robot
    :returns: the errors, in the order of the motion; empty if the motion can be planned at each
        rate that gives at most ``MAX_SEGMENTS`` velocities
    """
    return MotionValidator(motion, limits).errors


class MotionValidator:
    """
    Checks a motion against limits; a repeated step is checked once.

    :ivar whole: the whole motion; a refused step has no trajectories
    :ivar errors: all errors, in the order of the motion
    """

    def __init__(self, motion: Motion, limits: Limits) -> None:
        self._limits = limits
        self.errors: list[InvalidMotionError] = []
        self.whole = self._block(1, motion.steps, '')
        count = self.whole.total(lambda _: 1)
        if count > MAX_STEPS:
            self._refuse(f'the motion has {count:.10g} steps, its repeats counted; it may have '
                         f'{MAX_STEPS} at most')
        duration = self.whole.total(lambda item: item.duration)
        if duration > MAX_DURATION:
            self._refuse(f'the motion takes {duration:.10g} s, its repeats counted; it may take '
                         f'{MAX_DURATION:.10g} s at most')

    def _refuse(self, message: str) -> None:
        self.errors.append(InvalidMotionError(message))

    def _block(self, times: int, steps: Sequence[Step], prefix: str) -> RepeatBlock:
        return RepeatBlock(times, [
            self._part(step, f'{prefix}steps[{index}]') for index, step in enumerate(steps)])

    def _part(self, step: Step, path: str) -> Part:
        place = f'{path}.{step.keyword}.'
        block = step.block()
        if block is not None:
            return self._block(*block, place)
        return PlannedItem(path, step, step.trajectories(
            self._limits, lambda name, error: self.errors.append(error.at(place + name))))
