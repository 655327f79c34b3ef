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
"""How fast a robot may be told to go."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.motion.errors import InvalidMotionError
from kachaka_simple_control.motion.kinematics import Velocity


@dataclass(frozen=True)
class Limits:
    """
    The largest velocities of a robot, the same in both directions.

    :param max_linear_velocity: largest forward and backward velocity [m/s], positive
    :param max_angular_velocity: largest turning velocity [rad/s], positive
    """

    max_linear_velocity: float
    max_angular_velocity: float

    def __post_init__(self) -> None:
        """
        Refuse limits that no robot has.

        :raises InvalidMotionError: if a limit is not a positive number
        """
        for name, value, unit in (
                ('max_linear_velocity', self.max_linear_velocity, 'm/s'),
                ('max_angular_velocity', self.max_angular_velocity, 'rad/s')):
            if not value > 0.0:
                raise InvalidMotionError(f'{name} is {value} {unit}; it must be above 0 {unit}')

    def check(self, velocity: Velocity) -> None:
        """
        Refuse a velocity that must never be sent.

        :param velocity: the velocity to look at
        :raises InvalidMotionError: if a component is not finite or beyond its limit
        """
        # Written so that NaN fails: NaN <= limit is false.
        if not abs(velocity.linear_x) <= self.max_linear_velocity:
            raise InvalidMotionError(_beyond(
                'linear_x', velocity.linear_x, self.max_linear_velocity, 'm/s'))
        if not abs(velocity.angular_z) <= self.max_angular_velocity:
            raise InvalidMotionError(_beyond(
                'angular_z', velocity.angular_z, self.max_angular_velocity, 'rad/s'))


def _beyond(name: str, value: float, limit: float, unit: str) -> str:
    return f"{name} is {value} {unit}, outside the robot's limits of -{limit} to {limit} {unit}"
