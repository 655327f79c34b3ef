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
"""The base class of all kinds of steps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, MISSING
import math
from typing import Any, ClassVar, NamedTuple

from kachaka_simple_control.errors import InvalidMotionError, LimitError
from kachaka_simple_control.motion.geometry import Displacement
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.replanning import PathLimits
from kachaka_simple_control.motion.trajectory import (
    ConstantVelocity,
    limits_along,
    PathSegment,
    ProfiledPath,
    Trajectory,
)
from kachaka_simple_control.motion.units import Quantity
from kachaka_simple_control.motion.velocity_profile import time_optimal_profile

#: How long a motion may take [s]: a day.
MAX_DURATION = 86_400.0
#: A speed may be this part above a limit: what rounding makes of the same number.
ROUNDING = 1e-9
#: Called with the name of a field and what is wrong with it.
Refuse = Callable[[str, InvalidMotionError], None]


@dataclass(frozen=True)
class Count:
    """
    What a field of a step may be: a whole number from 0 on.

    :param largest: the largest allowed
    """

    largest: int

    def require(self, name: str, value: object) -> None:
        """
        Refuse a value that is not such a number.

        :raises InvalidMotionError: if it is refused
        """
        if isinstance(value, bool) or not isinstance(value, int):
            raise InvalidMotionError(f'{value!r}; it must be a whole number', name=name)
        if not 0 <= value <= self.largest:
            raise InvalidMotionError(f'{value}; it must be from 0 to {self.largest}', name=name)


@dataclass(frozen=True)
class StepList:
    """The type of a field of a step that holds a list of steps."""


#: The types of fields of a step.
FieldKind = Quantity | Count | StepList


class FileField(NamedTuple):
    """
    What a field of a step is in a file.

    :param kind: what may be its value
    :param description: what it means, for the JSON Schema: shown by editors
    :param examples: values as they are written in a file
    """

    kind: FieldKind
    description: str
    examples: tuple[Any, ...]


def in_file(kind: FieldKind, description: str, *examples: Any) -> dict[str, FileField]:
    """Return the metadata of a dataclass field that is written in files."""
    return {'file': FileField(kind, description, examples)}


#: The kinds of steps by their keywords, in the order of their definition.
KINDS: dict[str, type[Step]] = {}


class Step(ABC):
    """
    One thing to do: the base class of all kinds of steps.

    A kind is a frozen dataclass with a path and a description; planner, files, tables, plots and
    reports need no more.  The first line of its docstring explains it in the JSON Schema.  Each
    field has ``in_file()`` as metadata; one that may be left out is None by default, and the
    last one that may not says how far or how long the step goes.  Unless ``trajectories()`` is
    overridden, each segment of the path is driven from rest to rest.

    :cvar keyword: its word in files and in the paths of errors: the class name in lower case
    :cvar form: how it is written in a file, for errors; '' if the value of its first field may
        stand for it, as in ``wait: 2 s``
    :cvar synonyms: other words for it, for the advice where somebody writes one of them
    :cvar settles: whether a closed loop corrects the heading during it, at rest
    :ivar speed: the largest velocity along its path, in the unit of that field; None: as fast as
        the limits allow
    """

    keyword: ClassVar[str]
    form: ClassVar[str] = ''
    synonyms: ClassVar[tuple[str, ...]] = ()
    settles: ClassVar[bool] = False
    speed: float | None = None

    def __init_subclass__(cls) -> None:
        """Register a kind of step."""
        super().__init_subclass__()
        cls.keyword = cls.__name__.lower()
        KINDS[cls.keyword] = cls

    def __post_init__(self) -> None:
        """
        Refuse a step that cannot be driven.

        :raises InvalidMotionError: if a value is not a finite number of the sign allowed
        """
        for item in fields(self):  # type: ignore[arg-type]
            value, kind = getattr(self, item.name), item.metadata['file'].kind
            if value is not item.default:
                kind.require(item.name, value)

    @abstractmethod
    def path(self) -> tuple[PathSegment, ...]:
        """Return the segments of the path, in order; each begins where the one before ends."""

    @abstractmethod
    def describe(self) -> str:
        """Return the step in a few words with units, for tables that have its time elsewhere."""

    def describe_fully(self) -> str:
        """Return the step in a few words with units and, where it is given, its time."""
        return self.describe()

    def block(self) -> tuple[int, tuple[Step, ...]] | None:
        """Return how often which steps are driven for this one; None if it is driven itself."""
        return None

    @property
    def displacement(self) -> Displacement:
        """Return the signed length of the path and the change of heading."""
        path = self.path()
        return Displacement(math.fsum(segment.length for segment in path),
                            math.fsum(segment.angle for segment in path))

    @property
    def is_rest(self) -> bool:
        """Return whether the robot stands still throughout."""
        return all(segment.is_rest for segment in self.path())

    @classmethod
    def file_fields(cls) -> dict[str, FileField]:
        """Return what each field is in a file, in the order of the class."""
        return {item.name: item.metadata['file'] for item in fields(cls)}  # type: ignore[arg-type]

    def trajectories(self, limits: Limits, refuse: Refuse) -> list[Trajectory]:
        """
        Return how each segment of the path is driven: as fast as limits and speed allow.

        :param limits: of the robot
        :param refuse: called for each field that is beyond what the robot can do
        :returns: the trajectories, in order; none if nothing can be driven
        """
        path = [(segment, limits_along(segment, limits)) for segment in self.path()]
        if self.speed is not None:
            speed = float(self.speed)
            self._check_speed(
                speed, min((bounds.velocity for _, bounds in path), default=math.inf), refuse)
            path = [(segment, PathLimits(min(speed, bounds.velocity), *bounds[1:]))
                    for segment, bounds in path]
        if any(min(bounds) == math.inf for _, bounds in path):
            refuse('speed', InvalidMotionError(
                'it is not given, and the robot has no limit either; give one'))
            return []
        # A lower bound, checked first: no profile is computed from extreme numbers.
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
        """Return what tightens the limit of the speed, for the error of a speed above it."""
        return ''

    def _check_speed(self, speed: float, limit: float, refuse: Refuse) -> None:
        unit = self._unit('speed')
        if speed > limit * (1.0 + ROUNDING):
            refuse('speed', LimitError(speed, unit, limit, whose='the', note=self.limit_note()))

    def _extent(self) -> str:
        return [item.name for item in fields(self)  # type: ignore[arg-type]
                if item.default is MISSING][-1]

    def _unit(self, name: str) -> str:
        kind = self.file_fields()[name].kind
        return kind.unit if isinstance(kind, Quantity) else ''

    def _held(self, limits: Limits, refuse: Refuse) -> list[Trajectory]:
        """Return the trajectories of a path in seconds: each segment is one velocity."""
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
    Return steps as a tuple.

    :param steps: any iterable of steps
    :raises InvalidMotionError: if it is something else
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
