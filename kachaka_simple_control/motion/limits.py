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
"""The limits of a robot, and checks of numbers against them."""

from __future__ import annotations

from dataclasses import dataclass
import math
from numbers import Real

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import Velocity


def require_number(name: str, value: object, unit: str) -> float:
    """
    Return a value that must be a number.

    :param name: what people call it
    :param value: the value
    :param unit: its unit
    :returns: the number; what is too large for one is infinite
    :raises InvalidMotionError: if it is none
    """
    # bool is a Real in Python, and move_robot(True, ...) is a mistake.
    if isinstance(value, bool) or not isinstance(value, (int, float, Real)):
        raise InvalidMotionError(f'{name} is {value!r}; it must be a number [{unit}]')
    try:
        return float(value)
    except OverflowError:  # a whole number may have any number of digits
        return -math.inf if value < 0.0 else math.inf


def require_finite(name: str, value: object, unit: str) -> float:
    """
    Return a value that must be a finite number.

    :param name: what people call it
    :param value: the value
    :param unit: its unit
    :returns: the number
    :raises InvalidMotionError: if it is none, or not finite
    """
    number = require_number(name, value, unit)
    if not math.isfinite(number):
        raise InvalidMotionError(f'{name} is {number} {unit}; it must be a finite number')
    return number


def require_duration(value: object) -> None:
    """
    Refuse what is no duration.

    :param value: the value [s]
    :raises InvalidMotionError: if it is no finite number, or negative
    """
    if require_finite('duration', value, 's') < 0.0:
        raise InvalidMotionError(f'duration is {value} s; it must be 0 s or longer')


def require_positive(name: str, value: object, unit: str) -> None:
    """
    Refuse what is not above zero; infinity is.

    :param name: what people call it
    :param value: the value
    :param unit: its unit
    :raises InvalidMotionError: if it is no number above zero
    """
    # Written so that NaN fails.
    if not require_number(name, value, unit) > 0.0:
        raise InvalidMotionError(f'{name} is {value} {unit}; it must be above 0 {unit}')


def require_speed(value: object, unit: str) -> None:
    """
    Refuse what is no speed for a goal.

    :param value: the value; None leaves the choice to the robot's limits
    :param unit: its unit
    :raises InvalidMotionError: if it is no finite number above zero
    """
    if value is None:
        return
    require_finite('speed', value, unit)
    require_positive('speed', value, unit)


@dataclass(frozen=True)
class Limits:
    """
    The largest velocities, accelerations and jerks of a robot; each is positive or infinite.

    They hold in both directions alike, but for ``max_backward_velocity``.  Deceleration is what
    brings a velocity of either sign towards zero.

    :param max_linear_velocity: largest forward velocity [m/s]
    :param max_angular_velocity: largest turning velocity [rad/s]
    :param max_linear_acceleration: largest change of the linear velocity [m/s^2]
    :param max_angular_acceleration: largest change of the angular velocity [rad/s^2]
    :param max_linear_jerk: largest change of the linear acceleration [m/s^3]
    :param max_angular_jerk: largest change of the angular acceleration [rad/s^3]
    :param max_linear_deceleration: [m/s^2]; None: as the acceleration
    :param max_angular_deceleration: [rad/s^2]; None: as the acceleration
    :param max_backward_velocity: [m/s]; None: as the forward one
    """

    max_linear_velocity: float
    max_angular_velocity: float
    max_linear_acceleration: float = math.inf
    max_angular_acceleration: float = math.inf
    max_linear_jerk: float = math.inf
    max_angular_jerk: float = math.inf
    max_linear_deceleration: float | None = None
    max_angular_deceleration: float | None = None
    max_backward_velocity: float | None = None

    def __post_init__(self) -> None:
        """
        Refuse limits that no robot has.

        :raises InvalidMotionError: if a limit is not a positive number
        """
        for name, unit in UNITS.items():
            value = getattr(self, name)
            if value is not None or name not in OPTIONAL:
                require_positive(name, value, unit)

    @property
    def backward_velocity(self) -> float:
        """Return the largest backward velocity [m/s], positive."""
        own = self.max_backward_velocity
        return self.max_linear_velocity if own is None else own

    @property
    def linear_deceleration(self) -> float:
        """Return the largest linear deceleration [m/s^2]."""
        own = self.max_linear_deceleration
        return self.max_linear_acceleration if own is None else own

    @property
    def angular_deceleration(self) -> float:
        """Return the largest angular deceleration [rad/s^2]."""
        own = self.max_angular_deceleration
        return self.max_angular_acceleration if own is None else own

    def check(self, velocity: Velocity) -> None:
        """
        Refuse a velocity that must never be sent.

        :param velocity: the velocity to look at
        :raises InvalidMotionError: if a component is not finite or beyond its limit
        """
        self.check_linear(velocity.linear_x)
        self.check_angular(velocity.angular_z)

    def check_linear(self, linear_x: float) -> None:
        """
        Refuse a linear velocity that must never be sent.

        :param linear_x: the velocity [m/s]
        :raises InvalidMotionError: if it is not finite or beyond its limit
        """
        _check('linear_x', linear_x, self.backward_velocity, self.max_linear_velocity, 'm/s')

    def check_angular(self, angular_z: float) -> None:
        """
        Refuse an angular velocity that must never be sent.

        :param angular_z: the velocity [rad/s]
        :raises InvalidMotionError: if it is not finite or beyond its limit
        """
        limit = self.max_angular_velocity
        _check('angular_z', angular_z, limit, limit, 'rad/s')


#: The unit of each limit.
UNITS = {
    'max_linear_velocity': 'm/s',
    'max_angular_velocity': 'rad/s',
    'max_linear_acceleration': 'm/s^2',
    'max_angular_acceleration': 'rad/s^2',
    'max_linear_jerk': 'm/s^3',
    'max_angular_jerk': 'rad/s^3',
    'max_linear_deceleration': 'm/s^2',
    'max_angular_deceleration': 'rad/s^2',
    'max_backward_velocity': 'm/s',
}
#: The limits that may be None, and then are as large as another one.
OPTIONAL = ('max_linear_deceleration', 'max_angular_deceleration', 'max_backward_velocity')


def _check(name: str, value: float, backward: float, forward: float, unit: str) -> None:
    # NaN is within no limits, and infinity not even within infinite ones.
    if not (math.isfinite(value) and -backward <= value <= forward):
        raise InvalidMotionError(
            f"{name} is {value} {unit}, outside the robot's limits of "
            f'-{backward} to {forward} {unit}')
