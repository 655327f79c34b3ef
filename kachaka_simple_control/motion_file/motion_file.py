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
"""What a motion file says, and where it says it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
import math
from types import MappingProxyType

from kachaka_simple_control.motion.errors import InvalidMotionError
from kachaka_simple_control.motion.limits import Limits, UNITS
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.survey import find_errors
from kachaka_simple_control.motion_file.document import Node
from kachaka_simple_control.motion_file.problems import MotionFileError, place, Problem, undotted


@dataclass(frozen=True)
class MotionFile:
    """
    A motion, and what else its file says.

    :param motion: what to do
    :param source: the file it is from
    :param robot: the robot it is made for, a name or the path of a profile; None if for any
    :param limits: limits to plan it with, in SI units, by the names that
        :class:`~kachaka_simple_control.motion.limits.Limits` has for them
    :param rate: how often to send a velocity [Hz]; None if the file leaves it open
    :param root: what is in the file, with its lines
    """

    motion: Motion
    source: str
    robot: str | None = None
    limits: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}), hash=False)
    rate: float | None = None
    root: Node | None = field(default=None, repr=False, compare=False)

    def where(self, path: str) -> str:
        """
        Return where something in the motion is written down.

        :param path: which, as in ``steps[2].turn.speed``
        :returns: file and line, as in ``square.yaml:7``
        """
        return place(self.source, self._line(path))

    def check(self, limits: Limits, robot: str = 'the robot') -> Limits:
        """
        Hold the motion against a robot.

        :param limits: what the robot can do
        :param robot: what errors call it
        :returns: the limits to plan with: the file's own where it has some, else the robot's
        :raises MotionFileError: if the robot cannot do it, with a line for each step in the way
        """
        tightened = self.tighten(limits, robot)
        errors = find_errors(self.motion, tightened)
        if errors:
            raise self.located(errors, robot)
        return tightened

    def tighten(self, limits: Limits, robot: str = 'the robot') -> Limits:
        """
        Return a robot's limits with those of the file, which are lower, in their places.

        :param limits: what the robot can do
        :param robot: what errors call it
        :returns: the limits to plan with
        :raises MotionFileError: if the file allows more than the robot can do
        """
        bounds = {name: _bound(limits, name) for name in self.limits}
        errors = [
            InvalidMotionError(
                f'{self.limits[name]} {UNITS[name]} is above the limit of {bound} {UNITS[name]}',
                f'limits.{name}')
            for name, bound in bounds.items() if self.limits[name] > bound]
        if errors:
            raise MotionFileError(self.source, [self._problem(e, f"{robot}'s") for e in errors])
        tightened = replace(limits, **self.limits)
        if limits.max_backward_velocity is None or 'max_backward_velocity' in self.limits:
            return tightened
        # Whoever slows the robot down does not expect it to be faster backwards.
        return replace(tightened, max_backward_velocity=min(
            limits.max_backward_velocity, self.limits.get('max_linear_velocity', math.inf)))

    def located(
            self, errors: Iterable[InvalidMotionError], robot: str = 'the robot'
            ) -> MotionFileError:
        """
        Return errors of planning as errors of the file.

        :param errors: what ``find_errors()`` found, with paths such as ``steps[2].turn.speed``
        :param robot: what the line calls the robot whose limits are meant
        :returns: an error with a line for each
        """
        # With limits in the file it may be one of these that is meant.
        whose = 'the' if self.limits else f"{robot}'s"
        return MotionFileError(self.source, [self._problem(error, whose) for error in errors])

    def _problem(self, error: InvalidMotionError, whose: str) -> Problem:
        path = error.path or ''
        text = error.message.removeprefix(f'{path.rpartition(".")[2]} is ')
        text = text.replace('the limit of', f'{whose} limit of')
        text = text.replace("the robot's limit", f'{whose} limit')
        return Problem(text, self._line(path), path)

    def _line(self, path: str) -> int | None:
        return self.root.at(undotted(path)).line if self.root and path else None


def _bound(limits: Limits, name: str) -> float:
    # Limits has properties without max_ for those that may be None: what stands for them.
    bound: float = getattr(limits, name.removeprefix('max_'), getattr(limits, name))
    return bound
