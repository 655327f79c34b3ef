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
"""The limits of a robot: its largest velocities, accelerations and jerks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
import math

from kachaka_simple_control.errors import LimitError
from kachaka_simple_control.motion import units
from kachaka_simple_control.motion.geometry import Velocity

#: The fraction of each limit that a plan for a closed loop uses.  Corrections use the rest.
CLOSED_LOOP_SHARE = 0.9


@dataclass(frozen=True)
class Limits:
    """
    The largest velocities, accelerations and jerks of a robot; each is positive or infinite.

    They hold in both directions, but for ``max_backward_velocity``.

    :param max_linear_velocity: largest forward velocity [m/s]
    :param max_angular_velocity: largest turning velocity [rad/s]
    :param max_linear_acceleration: [m/s^2]
    :param max_angular_acceleration: [rad/s^2]
    :param max_linear_jerk: [m/s^3]
    :param max_angular_jerk: [rad/s^3]
    :param max_linear_deceleration: [m/s^2]; None if it is equal to the acceleration
    :param max_angular_deceleration: [rad/s^2]; None if it is equal to the acceleration
    :param max_backward_velocity: [m/s], a positive number; None if it is equal to that forwards
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
        """Check that each limit is above zero; it may be infinite."""
        for name, quantity in LIMIT_QUANTITIES.items():
            units.require_positive(name, self.bound(name), quantity.unit)

    def bound(self, name: str) -> float:
        """Return the value of a limit, or of the one that stands for it if it is None."""
        value = getattr(self, name)
        bound: float = getattr(self, SAME_AS.get(name, name)) if value is None else value
        return bound

    @property
    def backward_velocity(self) -> float:
        """Return the largest backward velocity [m/s], as a positive number."""
        return self.bound('max_backward_velocity')

    @property
    def linear_deceleration(self) -> float:
        """Return the largest linear deceleration [m/s^2]."""
        return self.bound('max_linear_deceleration')

    @property
    def angular_deceleration(self) -> float:
        """Return the largest angular deceleration [rad/s^2]."""
        return self.bound('max_angular_deceleration')

    def scaled(self, factor: float) -> Limits:
        """Return a copy of these limits, with each limit multiplied by a factor."""
        return Limits(**{
            name: value * factor for name, value in asdict(self).items() if value is not None})

    def slowed(self, factor: float) -> Limits:
        """
        Return the limits under which a motion slowed by a factor has its plan, stretched in time.

        They are the velocities times the factor, the accelerations times its square, and the jerks
        times its cube.
        """
        return Limits(**{
            name: LIMIT_QUANTITIES[name].slowed(value, factor)
            for name, value in asdict(self).items() if value is not None})

    def tightened(self, other: Limits) -> Limits:
        """Return the lower one of each limit."""
        return Limits(**{
            name: min(self.bound(name), other.bound(name)) for name in LIMIT_QUANTITIES})

    def exceeds(self, other: Limits) -> bool:
        """Return whether these limits allow a velocity that other limits forbid."""
        return any(self.bound(name) > other.bound(name) for name in VELOCITIES)

    def excesses(self, velocity: Velocity) -> Iterator[LimitError]:
        """Yield an error for each part of a velocity that is not finite or beyond its limit."""
        turning = self.max_angular_velocity
        for name, unit, lowest, highest in (
                ('linear_x', 'm/s', -self.backward_velocity, self.max_linear_velocity),
                ('angular_z', 'rad/s', -turning, turning)):
            value = getattr(velocity, name)
            # NaN and infinity are refused, even if the limits are infinite.
            if not (math.isfinite(value) and lowest <= value <= highest):
                yield LimitError(value, unit, highest, lowest, whose="the robot's", name=name)

    def check(self, velocity: Velocity) -> None:
        """Raise the first error of a velocity that is not finite or beyond the limits."""
        error = next(self.excesses(velocity), None)
        if error is not None:
            raise error


#: For each field of ``Limits``, the quantity that defines its unit and its allowed values.
LIMIT_QUANTITIES = {
    'max_linear_velocity': units.POSITIVE_LINEAR_VELOCITY,
    'max_angular_velocity': units.POSITIVE_ANGULAR_VELOCITY,
    'max_linear_acceleration': units.LINEAR_ACCELERATION,
    'max_angular_acceleration': units.ANGULAR_ACCELERATION,
    'max_linear_jerk': units.LINEAR_JERK,
    'max_angular_jerk': units.ANGULAR_JERK,
    'max_linear_deceleration': units.LINEAR_ACCELERATION,
    'max_angular_deceleration': units.ANGULAR_ACCELERATION,
    'max_backward_velocity': units.POSITIVE_LINEAR_VELOCITY,
}
#: The fields of ``Limits`` that may be None, and for each the field whose value is used instead.
SAME_AS = {
    'max_linear_deceleration': 'max_linear_acceleration',
    'max_angular_deceleration': 'max_angular_acceleration',
    'max_backward_velocity': 'max_linear_velocity',
}
VELOCITIES = ('max_linear_velocity', 'max_backward_velocity', 'max_angular_velocity')
#: The linear and the angular limits of velocity, of acceleration, and of jerk.
COUPLED = (
    (('max_linear_velocity', 'max_backward_velocity'), ('max_angular_velocity',)),
    (('max_linear_acceleration', 'max_linear_deceleration'),
     ('max_angular_acceleration', 'max_angular_deceleration')),
    (('max_linear_jerk',), ('max_angular_jerk',)))
#: For each linear limit, the angular limits of the same kind: velocity, acceleration or jerk.
ANGULAR_OF = {name: angular for linear, angular in COUPLED for name in linear}
#: For each angular limit, the linear limits of the same kind: velocity, acceleration or jerk.
LINEAR_OF = {name: linear for linear, angular in COUPLED for name in angular}
