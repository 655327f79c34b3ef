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
The base class of all steps of a motion, such as straight lines, turns and waits.

Tested by test/motion/test_steps.py.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, MISSING
from functools import cache
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
    """The type of a field of a step: a whole number from 0 to a largest value."""

    largest: int

    def require(self, name: str, value: object) -> None:
        """Check that a value is a whole number from 0 to ``largest``."""
        if isinstance(value, bool) or not isinstance(value, int):
            raise InvalidMotionError(f'{value!r}; it must be a whole number', name=name)
        if not 0 <= value <= self.largest:
            raise InvalidMotionError(f'{value}; it must be from 0 to {self.largest}', name=name)


@dataclass(frozen=True)
class StepList:
    """The type of a field of a step: a list of other steps."""

    def require(self, _name: str, value: object) -> None:
        """Check that a value is a sequence of steps."""
        step_tuple(value)


@dataclass(frozen=True)
class PointField:
    """The type of a field of a step: a point, given by x and y."""

    def require(self, name: str, value: object) -> None:
        """Check that a value is a pair of finite numbers."""
        as_point(name, value)


@dataclass(frozen=True)
class PointList:
    """The type of a field of a step: a list of at least one point, each given by x and y."""

    def require(self, name: str, value: object) -> None:
        """Check that a value is a list of at least one point."""
        as_points(name, value)


@dataclass(frozen=True)
class Text:
    """The type of a field of a step: a text."""

    def require(self, name: str, value: object) -> None:
        """Check that a value is text."""
        if not isinstance(value, str):
            raise InvalidMotionError(f'{value!r}; it must be text', name=name)


def as_point(name: str, value: object) -> Point:
    """
    Return x and y [m], any iterable, as a pair of floats.

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
    Return points, any iterable, as a tuple of pairs of floats [m].

    :raises InvalidMotionError: if the value is no iterable of points, or is empty
    """
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise InvalidMotionError(f'{value!r}; it must be a list of points', name=name)
    points = tuple(as_point(f'{name}[{index}]', point) for index, point in enumerate(value))
    if not points:
        raise InvalidMotionError('empty; it must have at least one point', name=name)
    return points


#: The types of a step's fields.
FieldKind = Quantity | Count | StepList | PointField | PointList | Text


class FileField(NamedTuple):
    """How a field of a step is written in a motion file, and how an editor explains it."""

    kind: FieldKind
    description: str
    examples: tuple[Any, ...]


def in_file(kind: FieldKind, description: str, *examples: Any) -> dict[str, FileField]:
    """Return the metadata of a field: its kind, its meaning for editors, and examples."""
    return {'file': FileField(kind, description, examples)}


@dataclass(frozen=True)
class PlacedStep:
    """
    A part of a step that depends on the pose at its start: a turn or a straight leg.

    :param name: its place in the step, for paths, as in ``points[1].forward``
    """

    name: str
    step: Step


#: The kinds of steps by their keywords, in the order of their definition.
KINDS: dict[str, type[Step]] = {}


class Step(ABC):
    """
    One part of a motion, such as a turn: the base class of all kinds of steps.

    A subclass is a frozen dataclass.  It must define ``path()`` and ``describe()``; the first line
    of its docstring explains the step in the JSON Schema of motion files.  Each field has the
    metadata of ``in_file()``; an optional one is None by default.  The last required field says
    how large the step is: an error about its duration names it.  The robot stands still at both
    ends of each path segment, unless ``trajectories()`` is overridden.

    :cvar keyword: the name of the step in files and messages: the class name in lower case

    :cvar form: how the step is written in a file, for messages; '' if the value of the first field
        can be written alone, as in ``wait: 2 s``

    :cvar synonyms: words that users may write instead; a message then suggests the keyword

    :cvar is_placed: whether the path depends on the pose at its start; ``placed()`` then returns
        the steps that drive it, and ``path()`` is its path from the start of the motion

    :cvar settles: whether this is a settle

    :cvar has_frame: whether points and headings in its block are seen from where it begins

    :cvar nesting: how deeply repeats, and how deeply includes, are nested, with this step; a block
        has its own

    :ivar speed: the largest velocity along the path [m/s, or rad/s for a turn in place]; None: as
        fast as the limits allow
    :ivar corners: how far the robot may pass corners inside the step [m]; None: as the motion says
    :ivar name: the name of the motion that the step includes; None if it has none
    """

    keyword: ClassVar[str]
    form: ClassVar[str] = ''
    synonyms: ClassVar[tuple[str, ...]] = ()
    is_placed: ClassVar[bool] = False
    settles: ClassVar[bool] = False
    has_frame: ClassVar[bool] = False
    nesting: ClassVar[tuple[int, int]] = (0, 0)
    speed: float | None = None
    corners: float | None = None
    name: str | None = None

    def __init_subclass__(cls) -> None:
        """Register a new kind of step, with its keyword."""
        super().__init_subclass__()
        cls.keyword = cls.__name__.lower()
        KINDS[cls.keyword] = cls

    def __post_init__(self) -> None:
        """
        Check each value.

        :raises InvalidMotionError: if one is not a finite number or has the wrong sign
        """
        for item in fields(self):  # type: ignore[arg-type]
            value, kind = getattr(self, item.name), item.metadata['file'].kind
            if value is not item.default:
                kind.require(item.name, value)

    @abstractmethod
    def path(self) -> tuple[PathSegment, ...]:
        """Return the segments of the path in driving order, each from the end of the last."""

    @abstractmethod
    def describe(self) -> str:
        """Return a short text about the step, for tables with a separate duration column."""

    def describe_fully(self) -> str:
        """Return a short text about the step, with its ``duration`` if it has such a field."""
        return self.describe()

    def block(self) -> tuple[int, tuple[Step, ...]] | None:
        """Return the number of repetitions and the repeated steps; None if there are none."""
        return None

    def placed(self, pose: Pose, refuse: Refuse) -> tuple[list[PlacedStep], Pose]:
        """
        Return the turns and legs of a step whose ``is_placed`` is true, and the pose at their end.

        :param refuse: called with each field, and error, because of which it cannot begin at this
            pose
        """
        raise NotImplementedError(f'{self.keyword} does not depend on the pose')

    def with_stops(self) -> Step:
        """Return this step without a tolerance of corners of its own."""
        return self

    @property
    def displacement(self) -> Displacement:
        """Return the length of the path [m] and the change of the heading [rad], signed."""
        path = self.path()
        return Displacement(math.fsum(segment.length for segment in path),
                            math.fsum(segment.angle for segment in path))

    @property
    def is_rest(self) -> bool:
        """Return whether the robot stands still during the whole step."""
        return all(segment.is_rest for segment in self.path())

    @classmethod
    @cache
    def file_fields(cls) -> dict[str, FileField]:
        """Return how each field of the step is written in a file, in their order."""
        return {item.name: item.metadata['file'] for item in fields(cls)}  # type: ignore[arg-type]

    def trajectories(self, limits: Limits, refuse: Refuse) -> list[Trajectory]:
        """
        Return the fastest trajectory along each segment under ``limits`` and ``speed``.

        :param refuse: called as ``refuse(name, error)`` for each field that makes the step
            impossible
        :returns: in driving order; empty if nothing limits the velocity, or the step takes too
            long
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
        """Return the last words of the message for a speed above the limit, as in ' backwards'."""
        return ''

    def _extent(self) -> str:
        return [item.name for item in fields(self)  # type: ignore[arg-type]
                if item.default is MISSING][-1]

    def _unit(self, name: str) -> str:
        kind = self.file_fields()[name].kind
        return kind.unit if isinstance(kind, Quantity) else ''

    def _held(self, limits: Limits, refuse: Refuse) -> list[Trajectory]:
        """
        Return a trajectory with constant velocity for each segment, as long as it takes.

        :returns: empty if the step takes too long
        """
        held: list[Trajectory] = [
            ConstantVelocity(segment, limits_along(segment, limits)) for segment in self.path()]
        duration = sum(trajectory.duration for trajectory in held)
        if duration <= MAX_DURATION:
            return held
        refuse(self._extent(), InvalidMotionError(
            f'{duration} s is too long; a motion may take {MAX_DURATION:.10g} s at most'))
        return []


def nesting_of(steps: Iterable[Step]) -> tuple[int, int]:
    """Return how deeply repeats, and how deeply includes, are nested in some steps."""
    # Each block keeps its own, because a step may be in many blocks.
    pairs = [step.nesting for step in steps]
    return (max((repeats for repeats, _ in pairs), default=0),
            max((includes for _, includes in pairs), default=0))


def step_tuple(steps: object) -> tuple[Step, ...]:
    """
    Return steps as a tuple, after a check that each item is a step.

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
