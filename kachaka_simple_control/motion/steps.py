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
"""The kinds of steps that a motion consists of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import get_args

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import require_duration, require_finite, require_speed

__all__ = [
    'MAX_NESTING', 'MAX_TIMES', 'Arc', 'Forward', 'Motion', 'Move', 'Repeat', 'Step', 'Turn',
    'Wait',
]

#: How many repeats may stand within each other.
MAX_NESTING = 20
#: How often something may be repeated.
MAX_TIMES = 1_000_000


@dataclass(frozen=True)
class Move:
    """
    Hold a velocity for a time: the lesson's step.

    :param linear_x: forward velocity [m/s], negative backwards
    :param angular_z: turning velocity [rad/s], positive to the left
    :param duration: how long to hold it [s], not negative
    """

    linear_x: float
    angular_z: float
    duration: float

    def __post_init__(self) -> None:
        """
        Refuse a step that nobody could drive.

        :raises InvalidMotionError: if a value is not a finite number, or the duration is negative
        """
        require_finite('linear_x', self.linear_x, 'm/s')
        require_finite('angular_z', self.angular_z, 'rad/s')
        require_duration(self.duration)

    @property
    def velocity(self) -> Velocity:
        """Return the velocity this step holds."""
        return Velocity(float(self.linear_x), float(self.angular_z))


@dataclass(frozen=True)
class Wait:
    """
    Stand still for a time.

    :param duration: how long [s], not negative
    """

    duration: float

    def __post_init__(self) -> None:
        """
        Refuse a time that is none.

        :raises InvalidMotionError: if the duration is not a finite number, or negative
        """
        require_duration(self.duration)


@dataclass(frozen=True)
class Repeat:
    """
    Do some steps several times.

    :param times: how often, from 0 to a million
    :param steps: what to do each time, in order; a list is kept as a tuple
    """

    times: int
    steps: tuple[Step, ...]

    def __post_init__(self) -> None:
        """
        Refuse what cannot be repeated.

        :raises InvalidMotionError: if the number is not whole or negative, a step is none, or the
            repeats are nested too deep
        """
        if isinstance(self.times, bool) or not isinstance(self.times, int):
            raise InvalidMotionError(f'times is {self.times!r}; it must be a whole number')
        if not 0 <= self.times <= MAX_TIMES:
            raise InvalidMotionError(f'times is {self.times}; it must be from 0 to {MAX_TIMES}')
        object.__setattr__(self, 'steps', _steps(self.steps))
        if _nesting(self) > MAX_NESTING:
            raise InvalidMotionError(
                f'steps has repeats {_nesting(self)} deep; at most {MAX_NESTING} may be nested')


@dataclass(frozen=True)
class Motion:
    """
    A named sequence of steps: plain data.

    :param name: what people call it
    :param steps: what to do, in order; a list is kept as a tuple
    :param description: what it is for, for people
    """

    name: str
    steps: tuple[Step, ...]
    description: str = ''

    def __post_init__(self) -> None:
        """
        Refuse what is no motion.

        :raises InvalidMotionError: if name or description is no text, or a step is none
        """
        for what, text in (('name', self.name), ('description', self.description)):
            if not isinstance(text, str):
                raise InvalidMotionError(f'{what} is {text!r}; it must be text')
        object.__setattr__(self, 'steps', _steps(self.steps))


def _steps(steps: object) -> tuple[Step, ...]:
    if isinstance(steps, (str, bytes)) or not isinstance(steps, Iterable):
        raise InvalidMotionError(f'steps is {steps!r}; it must be a sequence of steps')
    kept = tuple(steps)
    for index, step in enumerate(kept):
        if not isinstance(step, Step):
            kinds = ', '.join(kind.__name__ for kind in get_args(Step))
            raise InvalidMotionError(
                f'it is {step!r}; it must be one of {kinds}', path=f'steps[{index}]')
    return kept


def _nesting(repeat: Repeat) -> int:
    within = (_nesting(step) for step in repeat.steps if isinstance(step, Repeat))
    return 1 + max(within, default=0)


#: The least radius [m]: a circle of a micrometre is none that a robot could drive.
MIN_RADIUS = 1e-6


@dataclass(frozen=True)
class Forward:
    """
    Drive straight for a distance, from rest to rest.

    :param distance: how far [m], negative backwards
    :param speed: drive no faster than this [m/s], positive; None: as fast as the robot may
    """

    distance: float
    speed: float | None = None

    def __post_init__(self) -> None:
        """
        Refuse a step that nobody could drive.

        :raises InvalidMotionError: if a value is not a finite number, or the speed not positive
        """
        require_finite('distance', self.distance, 'm')
        require_speed(self.speed, 'm/s')


@dataclass(frozen=True)
class Turn:
    """
    Turn in place by an angle, from rest to rest.

    :param angle: how far [rad], positive to the left; more than a whole turn is more than one
    :param speed: turn no faster than this [rad/s], positive; None: as fast as the robot may
    """

    angle: float
    speed: float | None = None

    def __post_init__(self) -> None:
        """
        Refuse a step that nobody could drive.

        :raises InvalidMotionError: if a value is not a finite number, or the speed not positive
        """
        require_finite('angle', self.angle, 'rad')
        require_speed(self.speed, 'rad/s')


@dataclass(frozen=True)
class Arc:
    """
    Drive along a part of a circle, from rest to rest.

    The path is ``|radius| * angle`` long and turns the heading by that length over the radius: a
    positive angle is driven forwards, to the left about a centre on the left, to the right about
    one on the right; a negative angle goes the same way back.

    :param radius: distance of the centre [m], positive on the left, negative on the right, not 0
        nor nearly so
    :param angle: how much of the circle [rad], negative backwards
    :param speed: drive no faster than this along the path [m/s], positive; None: as fast as the
        robot may
    """

    radius: float
    angle: float
    speed: float | None = None

    def __post_init__(self) -> None:
        """
        Refuse a step that nobody could drive.

        :raises InvalidMotionError: if a value is not a finite number, the radius zero or almost,
            or the speed not positive
        """
        if abs(require_finite('radius', self.radius, 'm')) < MIN_RADIUS:
            raise InvalidMotionError(
                f'radius is {self.radius} m; its size must be at least {MIN_RADIUS:g} m; to turn '
                'in place, use a turn')
        require_finite('angle', self.angle, 'rad')
        require_speed(self.speed, 'm/s')


#: One thing to do.
Step = Move | Forward | Turn | Arc | Wait | Repeat
