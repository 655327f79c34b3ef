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
"""A motion, and the kinds of steps that it consists of, such as ``Forward`` and ``Turn``."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
import math
from typing import Any, ClassVar, overload

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion import units
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.path_segment import PathSegment
from kachaka_simple_control.motion.step_base import (
    Count,
    in_file,
    nesting_of,
    Refuse,
    Step,
    step_tuple,
    StepList,
)
from kachaka_simple_control.motion.trajectory import Trajectory
from kachaka_simple_control.motion.units import format_number, require_finite

__all__ = [
    'MAX_NESTING', 'MAX_TIMES', 'Arc', 'Forward', 'Motion', 'Move', 'Repeat', 'Settle', 'Step',
    'Turn', 'Wait']

#: The largest nesting depths of repeats, and of includes.
MAX_NESTING, MAX_INCLUDES = 20, 20
#: The largest number of repetitions of a block.
MAX_TIMES = 1_000_000
TIMES = Count(MAX_TIMES)
#: The time for which a closed loop corrects the heading at the end of a motion [s].
SETTLE_TIME = 1.5
#: The name of a motion that was given none.
UNNAMED = 'motion'
#: The smallest radius of an arc [m], far below a radius that a robot can drive.
MIN_RADIUS = 1e-6


@dataclass(frozen=True)
class Move(Step):
    """
    Hold a velocity for a time: the lesson's step.

    :param linear_x: forward velocity [m/s], negative backwards
    :param angular_z: turning velocity [rad/s], positive to the left
    :param duration: how long to hold the velocity [s], not negative
    """

    form = 'linear_x, angular_z and duration, in braces or further in'
    synonyms = ('move_robot', 'velocity', 'cmd_vel', 'twist')
    linear_x: float = field(metadata=in_file(
        units.LINEAR_VELOCITY, 'Forward velocity, in m/s, cm/s or mm/s.  Negative is backwards.',
        '0.1 m/s'))
    angular_z: float = field(metadata=in_file(
        units.ANGULAR_VELOCITY, 'Turning velocity, in rad/s or deg/s.  Positive is to the left.',
        '0.5 rad/s'))
    duration: float = field(metadata=in_file(
        units.TIME, 'How long, in s, ms or min; a bare number is in seconds.', '2 s'))

    @property
    def velocity(self) -> Velocity:
        """Return the constant velocity of this step."""
        return Velocity(float(self.linear_x), float(self.angular_z))

    def path(self) -> tuple[PathSegment, ...]:
        """Return the path of the step: one segment, whose length is the duration [s]."""
        return (PathSegment(float(self.duration), float(self.linear_x), float(self.angular_z)),)

    def describe(self) -> str:
        """Return the linear and the angular velocity of the step as text."""
        return f'move {format_number(self.linear_x)} m/s, {format_number(self.angular_z)} rad/s'

    def describe_fully(self) -> str:
        """Return the linear velocity, the angular velocity and the duration as text."""
        return f'{self.describe().removeprefix("move ")} for {self.duration:g} s'

    def trajectories(self, limits: Limits, refuse: Refuse) -> list[Trajectory]:
        """Return one trajectory of a constant velocity; none if the step takes too long."""
        for error in limits.excesses(self.velocity):
            refuse(error.name or '', error)
        return self._held(limits, refuse)


@dataclass(frozen=True)
class Forward(Step):
    """
    Drive straight, from rest to rest: a distance, negative backwards; or distance and speed.

    :param distance: how far to drive [m], negative backwards
    :param speed: drive no faster than this [m/s], positive; None: as fast as the limits allow
    """

    # Not 'back': the advice to write 'forward' instead would reverse the direction.
    synonyms = ('drive', 'go', 'straight')
    distance: float = field(metadata=in_file(
        units.LENGTH, 'How far, in m, cm or mm.  Negative is backwards.', '0.5 m', '-20 cm'))
    speed: float | None = field(default=None, metadata=in_file(
        units.POSITIVE_LINEAR_VELOCITY,
        'Drive no faster than this, along the path.  Left out: as fast as the limits allow.',
        '0.1 m/s'))

    def path(self) -> tuple[PathSegment, ...]:
        """Return the path of the step: one straight segment, whose length is in metres."""
        distance = float(self.distance)
        return (PathSegment(abs(distance), math.copysign(1.0, distance), 0.0),)

    def describe(self) -> str:
        """Return the distance of the step as text."""
        return f'forward {format_number(self.distance)} m'

    def limit_note(self) -> str:
        """Return ' backwards' if the distance is negative."""
        return ' backwards' if self.distance < 0.0 else ''


@dataclass(frozen=True)
class Turn(Step):
    """
    Turn in place, from rest to rest: an angle, positive to the left; or angle and speed.

    :param angle: how far to turn [rad], positive to the left; it may be more than one whole turn
    :param speed: turn no faster than this [rad/s], positive; None: as fast as the limits allow
    """

    synonyms = ('rotate', 'spin', 'rotation')
    angle: float = field(metadata=in_file(
        units.ANGLE, 'How far to turn, in rad or deg.  Positive is to the left; '
        'more than 360 deg is more than one turn.', '90 deg', '-90 deg'))
    speed: float | None = field(default=None, metadata=in_file(
        units.POSITIVE_ANGULAR_VELOCITY,
        'Turn no faster than this.  Left out: as fast as the limits allow.', '45 deg/s'))

    def path(self) -> tuple[PathSegment, ...]:
        """Return the path of the step: one turn in place, whose length is in radians."""
        angle = float(self.angle)
        return (PathSegment(abs(angle), 0.0, math.copysign(1.0, angle)),)

    def describe(self) -> str:
        """Return the angle of the turn as text."""
        return f'turn {format_number(math.degrees(self.angle))} deg'


@dataclass(frozen=True)
class Arc(Step):
    """
    Drive along a part of a circle, from rest to rest.

    The robot drives forwards if ``angle`` is positive, and backwards on the same circle if it is
    negative.  The heading changes by ``angle`` with the centre on the left, by minus ``angle`` on
    the right.

    :param radius: distance to the centre of the circle [m], positive if the centre is on the left,
        negative if it is on the right; ``|radius|`` must be at least 1e-6 m
    :param angle: the angle of the part of the circle, seen from its centre [rad], for example pi
        for half a circle; negative if the robot drives backwards
    :param speed: drive no faster than this along the path [m/s], positive; None: as fast as the
        limits allow
    """

    form = 'radius and angle, as in {radius: 0.3 m, angle: 90 deg}'
    synonyms = ('curve', 'circle')
    radius: float = field(metadata=in_file(
        units.LENGTH, 'How far away the centre is.  Positive: on the left; negative: on the '
        'right; never 0.', '0.3 m', '-0.3 m'))
    angle: float = field(metadata=in_file(
        units.ANGLE, 'How much of the circle.  Positive is forwards, negative the same way back.',
        '180 deg'))
    speed: float | None = field(default=None, metadata=in_file(
        units.POSITIVE_LINEAR_VELOCITY,
        'Drive no faster than this, along the path.  Left out: as fast as the limits allow.',
        '0.15 m/s'))

    def __post_init__(self) -> None:
        """Check each value, and that the radius is not too small."""
        if abs(require_finite('radius', self.radius, 'm')) < MIN_RADIUS:
            raise InvalidMotionError(
                f'{self.radius} m; its size must be at least {MIN_RADIUS:g} m; to turn in place, '
                'use a turn', name='radius')
        super().__post_init__()

    def path(self) -> tuple[PathSegment, ...]:
        """Return the path of the step: one arc, whose length is in metres."""
        radius, angle = float(self.radius), float(self.angle)
        sign = math.copysign(1.0, angle)
        return (PathSegment(abs(radius * angle), sign, sign / radius),)

    def describe(self) -> str:
        """Return the radius and the angle of the arc as text."""
        return f'arc {format_number(self.radius)} m, {format_number(math.degrees(self.angle))} deg'

    def limit_note(self) -> str:
        """Return a text with the radius, for the error message about a speed above the limit."""
        return f' along a radius of {self.radius} m'


@dataclass(frozen=True)
class Wait(Step):
    """
    Stand still for a time.

    :param duration: how long to stand still [s], not negative
    """

    synonyms: ClassVar[tuple[str, ...]] = ('pause', 'sleep', 'stop', 'stand', 'delay')
    duration: float = field(metadata=in_file(
        units.TIME, 'How long, in s, ms or min; a bare number is in seconds.', '2 s'))

    def path(self) -> tuple[PathSegment, ...]:
        """Return the path of the step: one segment at rest, whose length is the duration [s]."""
        return (PathSegment(float(self.duration), 0.0, 0.0),)

    def describe(self) -> str:
        """Return the duration of the wait as text."""
        return f'wait {format_number(self.duration)} s'

    def trajectories(self, limits: Limits, refuse: Refuse) -> list[Trajectory]:
        """Return one trajectory at rest; none if the step takes too long."""
        return self._held(limits, refuse)


@dataclass(frozen=True)
class Settle(Wait):
    """
    Stand still for a time, in which a closed loop corrects the heading.

    :param duration: how long to stand still [s], not negative
    """

    synonyms = ()
    settles = True

    def describe(self) -> str:
        """Return the duration as text."""
        return f'settle {format_number(self.duration)} s'


@dataclass(frozen=True)
class Repeat(Step):
    """
    Do some steps several times.

    :param times: how many times to drive the steps, from 0 to a million
    :param steps: the steps to repeat, in order; a list is converted to a tuple
    """

    form = 'times and, below it, steps'
    synonyms = ('loop', 'for')
    times: int = field(metadata=in_file(TIMES, 'How often; a whole number.', 4))
    steps: tuple[Step, ...] = field(metadata=in_file(
        StepList(), 'What to do, in order.', [{'forward': '0.5 m'}, {'turn': '90 deg'}]))

    def __post_init__(self) -> None:
        """Check the number and the steps, and how deeply repeats are nested."""
        TIMES.require('times', self.times)
        object.__setattr__(self, 'steps', step_tuple(self.steps))
        repeats, includes = nesting_of(self.steps)
        object.__setattr__(self, 'nesting', (repeats + 1, includes))
        if repeats + 1 > MAX_NESTING:
            raise InvalidMotionError(
                f'steps has repeats {repeats + 1} deep; at most {MAX_NESTING} may be nested')

    def path(self) -> tuple[PathSegment, ...]:
        """Return the path segments of the steps in driving order, with each repetition."""
        return tuple(segment for step in self.steps for segment in step.path()) * self.times

    def describe(self) -> str:
        """Return the number of repetitions as text."""
        return f'repeat {self.times} times'

    def block(self) -> tuple[int, tuple[Step, ...]]:
        """Return the number of repetitions and the repeated steps."""
        return self.times, self.steps

    def with_stops(self) -> Repeat:
        """Return this step with repeated steps that have no tolerance of corners of their own."""
        return replace(self, steps=tuple(step.with_stops() for step in self.steps))


@dataclass(frozen=True, init=False)
class Motion:
    """
    A sequence of steps that a robot drives one after the other; it cannot be changed.

    The steps may come first, and the name may be left out: ``Motion([Forward(0.5)])``.

    :param steps: the steps, in order; a list is converted to a tuple
    :param description: the purpose of the motion, as text to show
    :param corners: how far the robot may pass the corners between steps, to drive through them
        without a stop [m]; 0 to stop after each step
    """

    name: str
    steps: tuple[Step, ...]
    description: str
    corners: float

    @overload
    def __init__(self, name: str, steps: Iterable[Step], description: str = '',
                 corners: float = 0.0) -> None: ...

    @overload
    def __init__(self, steps: Iterable[Step], name: str = UNNAMED, description: str = '',
                 corners: float = 0.0) -> None: ...

    def __init__(self, *values: Any, **named: Any) -> None:
        """
        Make a motion, and raise an error for an invalid value.

        :raises InvalidMotionError: if the name or the description is not text, ``corners`` is no
            tolerance from 0 to 1 m, or an item of ``steps`` is not a step
        """
        if values and not isinstance(values[0], str) and (
                len(values) == 1 or isinstance(values[1], str)):
            first, *rest = values
            values = (rest.pop(0) if rest else named.pop('name', UNNAMED), first, *rest)
        elif not values:
            named.setdefault('name', UNNAMED)
        for key, value in _motion(*values, **named).items():
            object.__setattr__(self, key, value)
        for what, text in (('name', self.name), ('description', self.description)):
            if not isinstance(text, str):
                raise InvalidMotionError(f'{text!r}; it must be text', name=what)
        units.TOLERANCE.require('corners', self.corners)
        object.__setattr__(self, 'steps', step_tuple(self.steps))

    def with_stops(self) -> Motion:
        """Return this motion without corners: the robot stops after each leg and each turn."""
        return replace(self, steps=tuple(step.with_stops() for step in self.steps), corners=0.0)

    def settled(self) -> Motion:
        """Return this motion with a settle step at its end, if there is none yet."""
        if self.steps and self.steps[-1].settles:
            return self
        return replace(self, steps=(*self.steps, Settle(SETTLE_TIME)))


def _motion(
        name: str, steps: Iterable[Step], description: str = '',
        corners: float = 0.0) -> dict[str, Any]:
    return {'name': name, 'steps': steps, 'description': description, 'corners': corners}
