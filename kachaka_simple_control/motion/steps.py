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
"""What a motion is made of."""

from __future__ import annotations

from dataclasses import dataclass
import math
from numbers import Real

from kachaka_simple_control.motion.errors import InvalidMotionError
from kachaka_simple_control.motion.kinematics import Velocity


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
        _require_finite('linear_x', self.linear_x, 'm/s')
        _require_finite('angular_z', self.angular_z, 'rad/s')
        _require_finite('duration', self.duration, 's')
        if self.duration < 0.0:
            raise InvalidMotionError(
                f'duration is {self.duration} s; it must be 0 s or longer')

    @property
    def velocity(self) -> Velocity:
        """Return the velocity this step holds."""
        return Velocity(float(self.linear_x), float(self.angular_z))


@dataclass(frozen=True)
class Motion:
    """
    A named sequence of steps: plain data.

    :param name: what people call it
    :param steps: what to do, in order
    """

    name: str
    steps: tuple[Move, ...]


def _require_finite(name: str, value: object, unit: str) -> None:
    # bool is a Real in Python, and move_robot(True, ...) is a mistake.
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InvalidMotionError(f'{name} is {value!r}; it must be a number [{unit}]')
    if not math.isfinite(value):
        raise InvalidMotionError(f'{name} is {value} {unit}; it must be a finite number')
