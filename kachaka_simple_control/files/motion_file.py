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
"""A motion with what its file says, and the checks against a robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
import math
import os
import re
from types import MappingProxyType

from kachaka_simple_control.errors import InvalidMotionError, LimitError
from kachaka_simple_control.files.document import (
    beside,
    is_path,
    MotionFileError,
    Node,
    parse_path,
    Problem,
)
from kachaka_simple_control.files.parameters import Parameter
from kachaka_simple_control.files.robot_profile import Laser, RobotProfile
from kachaka_simple_control.files.watch_check import watch_errors
from kachaka_simple_control.motion.drive_order import DriveOrder, MotionText
from kachaka_simple_control.motion.limits import CLOSED_LOOP_SHARE, LIMIT_QUANTITIES, Limits
from kachaka_simple_control.motion.plan import find_errors
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.time_scale import slowed
from kachaka_simple_control.text import location

#: The end of the path of a step that includes a file, in the path of a value in the file.
_INCLUDE = re.compile(r'[.]include(?=[.]steps\[)')


def included_key(source: str, name_or_path: str) -> str:
    """
    Return what names a file that another one includes, on any machine.

    :param source: the path of the file that includes it, or its key
    :returns: the name of a motion of the package, or the path of any other file
    """
    if not is_path(name_or_path):
        return name_or_path
    path = os.path.normpath(beside(source, name_or_path))
    return path if is_path(path) else f'./{path}'


def _add_included(texts: dict[str, str], file: MotionFile, source: str) -> None:
    for place, included in file.included.items():
        assert file.root is not None
        step = file.root.at(parse_path(place)).data
        key = included_key(source, step if isinstance(step, str) else step['motion'])
        if key not in texts:
            texts[key] = included.text or ''
            _add_included(texts, included, key)


@dataclass(frozen=True)
class MotionFile:
    """
    A motion and the other contents of the file from which it was read.

    :param robot: the robot that the motion is made for, as a name or as the path of a robot
        profile; None for any robot
    :param limits: the limits given in the file, in SI units; the keys are names of fields of
        :class:`~kachaka_simple_control.motion.limits.Limits`
    :param closed_loop: whether to use odometry to correct the velocities; None if the file does
        not say
    :param watch: whether to hold before obstacles that the laser of the robot sees; None if the
        file does not say
    :param corners: how far the robot may pass the corners between steps [m], as in ``motion``;
        None if the file does not say
    :param parameters: the parameters of the file, by name
    :param values: the values that parameters were given, by name, as text
    :param included: the files that it includes, by the path of the step, as in
        ``steps[2].include``
    :param root: the values of the file, with their line numbers; None if the motion was not read
        from a YAML text
    :param text: the text of the file; None if the motion was not read from a YAML text
    """

    motion: Motion
    source: str
    robot: str | None = None
    limits: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}), hash=False)
    rate: float | None = None
    closed_loop: bool | None = None
    watch: bool | None = None
    corners: float | None = None
    parameters: Mapping[str, Parameter] = field(
        default_factory=lambda: MappingProxyType({}), hash=False)
    values: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}), hash=False)
    included: Mapping[str, MotionFile] = field(
        default_factory=lambda: MappingProxyType({}), repr=False, compare=False)
    root: Node | None = field(default=None, repr=False, compare=False)
    text: str | None = field(default=None, repr=False, compare=False)

    @property
    def title(self) -> str:
        """Return its name with the values that were given, as in ``square (side 1 m, laps 2)``."""
        values = ', '.join(f'{name} {value}' for name, value in self.values.items())
        return f'{self.motion.name} ({values})' if values else self.motion.name

    def where(self, path: str) -> str:
        """
        Return the place of a value in the file as file name and line, as in ``square.yaml:7``.

        :param path: the keys and list indices that lead to the value, as in
            ``steps[2].turn.speed``
        """
        problem = self.problem(InvalidMotionError('', path))
        return location(problem.source or self.source, problem.line)

    def as_text(self) -> MotionText | None:
        """Return what a report keeps of it; None if it was not read from a YAML text."""
        return None if self.text is None else MotionText(
            self.source, self.text, dict(self.values), self.included_texts)

    @property
    def included_texts(self) -> dict[str, str]:
        """Return the text of each file that it includes, also in others, by ``included_key``."""
        texts: dict[str, str] = {}
        _add_included(texts, self, self.source)
        return texts

    def check(
            self, limits: Limits, robot: str = 'the robot', closed_loop: bool = False,
            laser: Laser | None = None) -> Limits:
        """
        Check that a robot can drive the motion.

        :param closed_loop: whether odometry will correct the velocities; then the plan can use
            only a part of each limit, because the rest is reserved for the corrections
        :param laser: the laser of the obstacle watch; None without a watch
        :returns: for each limit, the smaller of the robot's value and the value in the file
        :raises MotionFileError: if the robot cannot drive the motion, the file gives a limit above
            that of the robot, or a step cannot be watched; the message has a line for each problem
        """
        tightened = self._tighten(limits)
        # A step may exceed a limit of the file instead of a limit of the robot.
        whose = 'the' if self.limits else f"{robot}'s"
        planned = tightened
        if closed_loop:
            whose, planned = "the closed loop's", tightened.scaled(CLOSED_LOOP_SHARE)
        errors: list[InvalidMotionError] = []
        for name, value in self.limits.items():
            bound, unit = limits.bound(name), LIMIT_QUANTITIES[name].unit
            if value > bound:
                excess = LimitError(value, unit, bound, whose=f"{robot}'s")
                errors.append(excess.at(f'limits.{name}'))
        errors += [error.by(whose) for error in find_errors(self.motion, planned)]
        if laser is not None:
            errors += watch_errors(self.motion, laser, robot)
        if errors:
            raise MotionFileError(self.source, map(self.problem, errors))
        return tightened

    def order(
            self, robot: RobotProfile, rate: float, closed_loop: bool,
            speed: float = 1.0, watch: bool = False) -> DriveOrder:
        """
        Return how a robot drives the motion.

        :param speed: the speed relative to that of the file, from 0.01 to 1: a time scale
        :param watch: whether it is held before obstacles
        :raises MotionFileError: as ``check``
        :raises InvalidMotionError: if the speed is out of range
        :raises UsageError: if the robot has no laser for a watch
        """
        limits = self.check(
            robot.planning_limits, robot.name, closed_loop,
            robot.watching_laser() if watch else None)
        # What a closed loop adds at the end is slowed, too: all robots of a fleet have one scale.
        motion = self.motion.settled() if closed_loop else self.motion
        return DriveOrder.of(
            slowed(motion, speed), robot.planning_limits, rate, limits.slowed(speed), closed_loop,
            self.as_text())

    def error_at(self, path: str, message: str) -> MotionFileError:
        """Return an error about one value of the file, with the line number of the value."""
        return MotionFileError(self.source, [self.problem(InvalidMotionError(message, path))])

    def _tighten(self, limits: Limits) -> Limits:
        """
        Return for each limit the smaller of the robot's value and the value in the file.

        If the file limits the forward velocity and gives no backward velocity, the file's value
        for the forward velocity also limits the backward velocity.
        """
        own = {name: min(value, limits.bound(name)) for name, value in self.limits.items()}
        if limits.max_backward_velocity is not None:
            # A lower forward limit also limits the backward velocity.
            own.setdefault('max_backward_velocity', min(
                limits.max_backward_velocity, own.get('max_linear_velocity', math.inf)))
        return replace(limits, **own)

    def problem(self, error: InvalidMotionError) -> Problem:
        """Return the problem of an error with its place, which may be in an included file."""
        path = error.path or ''
        for found in _INCLUDE.finditer(path):
            place = path[:found.end()]
            if (file := self.included.get(place)) is not None:
                inner = InvalidMotionError(error.message, path.removeprefix(f'{place}.'))
                return file.problem(inner).within(file.source, self.source, self._line(place))
        return Problem(error.message, self._line(path), path)

    def _line(self, path: str) -> int | None:
        return self.root.at(parse_path(path)).line if self.root and path else None
