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
"""The base class of all steps of a motion, such as straight lines, turns and waits."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, MISSING
import math
from typing import Any, ClassVar, NamedTuple

from kachaka_simple_control.errors import InvalidMotionError, LimitError
from kachaka_simple_control.motion.geometry import Displacement, Point, Pose
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.path_segment import limits_along, PathSegment
from kachaka_simple_control.motion.trajectory import ConstantVelocity, ProfiledPath, Trajectory
from kachaka_simple_control.motion.units import Quantity, require_finite
from kachaka_simple_control.motion.velocity_profile import time_optimal_profile

#: The longest duration of a motion [s]: a day.
MAX_DURATION = 86_400.0
#: A speed may exceed a limit by this fraction of the limit, because of rounding.
ROUNDING = 1e-9
#: The type of a function that takes the name of an invalid field and the error, to record them.
Refuse = Callable[[str, InvalidMotionError], None]


@dataclass(frozen=True)
class Count:
    """
    The type of a field of a step: a whole number from 0 to a largest value.

    :param largest: the largest value allowed
    """

    largest: int

    def require(self, name: str, value: object) -> None:
        """
        Raise an error for a value that is not a whole number from 0 to ``largest``.

        :param name: the name of the field, for the message
        :param value: the value to check
        :raises InvalidMotionError: if the value is not a whole number, or is out of range
        """
        if isinstance(value, bool) or not isinstance(value, int):
            raise InvalidMotionError(f'{value!r}; it must be a whole number', name=name)
        if not 0 <= value <= self.largest:
            raise InvalidMotionError(f'{value}; it must be from 0 to {self.largest}', name=name)


@dataclass(frozen=True)
class StepList:
    """The type of a field of a step: a list of other steps."""


@dataclass(frozen=True)
class PointField:
    """The type of a field of a step: a point, given by x and y."""

    def require(self, name: str, value: object) -> None:
        """
        Raise an error for a value that is not a pair of finite numbers.

        :param name: the name of the field, for the message
        :param value: the value to check
        :raises InvalidMotionError: if the value is no point
        """
        as_point(name, value)


@dataclass(frozen=True)
class PointList:
    """The type of a field of a step: a list of at least one point, each given by x and y."""

    def require(self, name: str, value: object) -> None:
        """
        Raise an error for a value that is not a list of points.

        :param name: the name of the field, for the message
        :param value: the value to check
        :raises InvalidMotionError: if the value is no list of points, or is empty
        """
        as_points(name, value)


def as_point(name: str, value: object) -> Point:
    """
    Return a point as a pair of floats.

    :param name: the name of the point, for the message
    :param value: any iterable of two numbers: x and y [m]
    :raises InvalidMotionError: if the value is not an iterable of two finite numbers
    """
    numbers = None if isinstance(value, (str, bytes)) or not isinstance(value, Iterable) else (
        tuple(value))
    if numbers is None or len(numbers) != 2:
        raise InvalidMotionError(
            f'{value!r}; it must be a point: two numbers, x and y [m]', name=name)
    return require_finite(name, numbers[0], 'm'), require_finite(name, numbers[1], 'm')


def as_points(name: str, value: object) -> tuple[Point, ...]:
    """
    Return a list of points as a tuple of pairs of floats.

    :param name: the name of the list, for the message
    :param value: any iterable of points: x and y of each [m]
    :raises InvalidMotionError: if the value is no iterable of points, or is empty
    """
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise InvalidMotionError(f'{value!r}; it must be a list of points', name=name)
    points = tuple(as_point(f'{name}[{index}]', point) for index, point in enumerate(value))
    if not points:
        raise InvalidMotionError('empty; it must have at least one point', name=name)
    return points


#: The types of a step's fields.
FieldKind = Quantity | Count | StepList | PointField | PointList


class FileField(NamedTuple):
    """
    How a field of a step is written in a motion file, and how it is explained to the user.

    :param kind: the type of the value
    :param description: the meaning of the field, for the JSON Schema; editors show it
    :param examples: example values as written in a file
    """

    kind: FieldKind
    description: str
    examples: tuple[Any, ...]


def in_file(kind: FieldKind, description: str, *examples: Any) -> dict[str, FileField]:
    """
    Return the dataclass metadata that says how a field of a step is written in a motion file.

    :param kind: the type of the value
    :param description: the meaning of the field, for the JSON Schema; editors show it
    :param examples: example values as written in a file
    """
    return {'file': FileField(kind, description, examples)}


@dataclass(frozen=True)
class PlacedStep:
    """
    A part of a step that depends on the pose at its start: a turn or a straight leg.

    :param name: its place in the step, for paths, as in ``points[1].forward``
    :param step: the turn or the leg
    """

    name: str
    step: Step


#: The kinds of steps by their keywords, in the order of their definition.
KINDS: dict[str, type[Step]] = {}


class Step(ABC):
    """
    One part of a motion, such as a turn: the base class of all kinds of steps.

    Each kind of step is a subclass of ``Step`` and a frozen dataclass.  It must define ``path()``
    and ``describe()``; the other methods have a default.  The first line of its docstring explains
    the step in the JSON Schema of motion files.

    Each field has the metadata of ``in_file()``.  An optional field is None by default.  The last
    required field says how large the step is: its distance, angle or duration.  If the step takes
    too long, the error message names this field.

    The robot stands still at the start and at the end of each path segment, unless the subclass
    overrides ``trajectories()``.

    :cvar keyword: the name of the step in files and error messages: the class name in lower case
    :cvar form: how the step is written in a file, for error messages; '' if the value of the first
        field can be written alone, as in ``wait: 2 s``
    :cvar synonyms: words that users may write instead of the keyword; an error message then
        suggests the keyword
    :cvar is_placed: whether the path of the step depends on the pose at its start; ``placed()``
        then returns the steps that drive it, and ``path()`` is its path from the start of the
        motion
    :cvar settles: whether the robot stands still in this step while a closed loop corrects its
        heading with odometry
    :ivar speed: the largest velocity along the path [m/s, or rad/s for a turn in place]; None: as
        fast as the limits allow
    :ivar corners: how far the robot may pass corners inside the step [m]; None: as the motion says
    """

    keyword: ClassVar[str]
    form: ClassVar[str] = ''
    synonyms: ClassVar[tuple[str, ...]] = ()
    is_placed: ClassVar[bool] = False
    settles: ClassVar[bool] = False
    speed: float | None = None
    corners: float | None = None

    def __init_subclass__(cls) -> None:
        """
        Register a new subclass as a kind of step.

        Its keyword, the name of the step in files, is the class name in lower case.
        """
        super().__init_subclass__()
        cls.keyword = cls.__name__.lower()
        KINDS[cls.keyword] = cls

    def __post_init__(self) -> None:
        """
        Raise an error for a step with an invalid value.

        :raises InvalidMotionError: if a value is not a finite number or has the wrong sign
        """
        for item in fields(self):  # type: ignore[arg-type]
            value, kind = getattr(self, item.name), item.metadata['file'].kind
            if value is not item.default:
                kind.require(item.name, value)

    @abstractmethod
    def path(self) -> tuple[PathSegment, ...]:
        """
        Return the segments of the step's path, each with a constant curvature, in driving order.

        Each segment starts at the end of the previous segment.
        """

    @abstractmethod
    def describe(self) -> str:
        """Return a short text about the step, for tables with a separate duration column."""

    def describe_fully(self) -> str:
        """Return a short text about the step, with its ``duration`` if it has such a field."""
        return self.describe()

    def block(self) -> tuple[int, tuple[Step, ...]] | None:
        """
        Return how many times this step repeats other steps, and the repeated steps.

        Return None if this step does not repeat other steps.
        """
        return None

    def placed(self, pose: Pose, refuse: Refuse) -> tuple[list[PlacedStep], Pose]:
        """
        Return the turns and legs of a step that depends on the pose at its start, and its end.

        Only a step whose ``is_placed`` is true can be asked.

        :param pose: the pose at the start of the step, seen from the start of the motion
        :param refuse: a function to call for each field because of which the step cannot begin at
            this pose, with the name of the field and the error
        :returns: the turns and legs in driving order, and the pose at the end of the step
        """
        raise NotImplementedError(f'{self.keyword} does not depend on the pose')

    def with_stops(self) -> Step:
        """Return this step without a tolerance of corners of its own."""
        return self

    @property
    def displacement(self) -> Displacement:
        """
        Return the length of the step's path [m] and the change of the heading [rad].

        Parts driven backwards and parts turned to the right count as negative.
        """
        path = self.path()
        return Displacement(math.fsum(segment.length for segment in path),
                            math.fsum(segment.angle for segment in path))

    @property
    def is_rest(self) -> bool:
        """Return whether the robot stands still during the whole step."""
        return all(segment.is_rest for segment in self.path())

    @classmethod
    def file_fields(cls) -> dict[str, FileField]:
        """
        Return a dictionary that says how each field of the step is written in a file.

        The keys are the names of the fields, in the order of their definition.
        """
        return {item.name: item.metadata['file'] for item in fields(cls)}  # type: ignore[arg-type]

    def trajectories(self, limits: Limits, refuse: Refuse) -> list[Trajectory]:
        """
        Return the fastest trajectory along each segment of the step's path.

        A trajectory is a path segment with its timing.  It keeps ``limits``, and its velocity is
        at most the ``speed`` of the step if that is given.

        :param limits: the limits of the robot
        :param refuse: a function that is called as ``refuse(name, error)`` for each field that
            makes the step impossible for the robot; ``name`` is the name of the field
        :returns: the trajectories, in driving order.  The list is empty if neither a limit nor
            ``speed`` limits the velocity, or if the step takes too long
        """
        path = [(segment, limits_along(segment, limits)) for segment in self.path()]
        if self.speed is not None:
            speed = float(self.speed)
            limit = min((bounds.velocity for _, bounds in path), default=math.inf)
            if speed > limit * (1.0 + ROUNDING):
                refuse('speed', LimitError(
                    speed, self._unit('speed'), limit, whose='the', note=self.limit_note()))
            path = [(segment, bounds._replace(velocity=min(speed, bounds.velocity)))
                    for segment, bounds in path]
        if any(min(bounds) == math.inf for _, bounds in path):
            refuse('speed', InvalidMotionError(
                'it is not given, and the robot has no limit either; give one'))
            return []
        # Check a lower bound of the time first, so that no profile has extreme numbers.
        duration = sum(segment.distance / bounds.velocity for segment, bounds in path)
        if duration <= MAX_DURATION:
            driven: list[Trajectory] = [
                ProfiledPath(segment, bounds, time_optimal_profile(segment.distance, *bounds))
                for segment, bounds in path]
            duration = sum(trajectory.duration for trajectory in driven)
            if duration <= MAX_DURATION:
                return driven
        extent = self._extent()
        refuse(extent, InvalidMotionError(
            f'{getattr(self, extent)} {self._unit(extent)} takes {duration:.10g} s; a motion may '
            f'take {MAX_DURATION:.10g} s at most'))
        return []

    def limit_note(self) -> str:
        """
        Return the last words of the error message for a speed above the limit.

        They say for which motion the limit is valid, as in ' backwards'.  The text is empty if
        the message does not need them.
        """
        return ''

    def _extent(self) -> str:
        return [item.name for item in fields(self)  # type: ignore[arg-type]
                if item.default is MISSING][-1]

    def _unit(self, name: str) -> str:
        kind = self.file_fields()[name].kind
        return kind.unit if isinstance(kind, Quantity) else ''

    def _held(self, limits: Limits, refuse: Refuse) -> list[Trajectory]:
        """
        Return a trajectory with constant velocity for each segment of the step's path.

        A trajectory is a path segment with its timing.  Here, the length of a segment is its
        duration [s].

        :param limits: the limits of the robot
        :param refuse: a function that is called as ``refuse(name, error)`` if the step takes too
            long; ``name`` is the name of the duration field
        :returns: the trajectories, in order; empty if the step takes too long
        """
        held: list[Trajectory] = [
            ConstantVelocity(segment, limits_along(segment, limits)) for segment in self.path()]
        duration = sum(trajectory.duration for trajectory in held)
        if duration <= MAX_DURATION:
            return held
        refuse(self._extent(), InvalidMotionError(
            f'{duration} s is too long; a motion may take {MAX_DURATION:.10g} s at most'))
        return []


def step_tuple(steps: object) -> tuple[Step, ...]:
    """
    Return steps as a tuple, after a check that each item is a step.

    :param steps: any iterable of steps
    :raises InvalidMotionError: if the value is not an iterable, or if an item is not a step
    """
    if isinstance(steps, (str, bytes)) or not isinstance(steps, Iterable):
        raise InvalidMotionError(f'{steps!r}; it must be a sequence of steps', name='steps')
    kept = tuple(steps)
    for index, step in enumerate(kept):
        if not isinstance(step, Step):
            kinds = ', '.join(kind.__name__ for kind in KINDS.values())
            raise InvalidMotionError(
                f'it is {step!r}; it must be one of {kinds}', path=f'steps[{index}]')
    return kept
