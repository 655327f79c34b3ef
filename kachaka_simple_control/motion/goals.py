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
"""Steps that say where to be, not how long to drive: the planner finds the velocities."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.motion.errors import InvalidMotionError
from kachaka_simple_control.motion.validation import require_finite, require_speed

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
