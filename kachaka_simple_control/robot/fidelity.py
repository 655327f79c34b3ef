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
"""How true to life the simulated robot is: by default it does exactly as it is told."""

from __future__ import annotations

from dataclasses import dataclass, fields
import math


@dataclass(frozen=True)
class Fidelity:
    """
    What keeps a simulated robot from doing exactly as it is told.

    The maker publishes none of these figures: the defaults are those of an ideal robot, except
    for the way off the dock, which has to take some time and is chosen.

    :param lag: time constant of the drive, first order [s]
    :param linear_acceleration: largest change of the forward velocity [m/s^2]
    :param angular_acceleration: largest change of the turning velocity [rad/s^2]
    :param linear_gain: true over demanded forward velocity
    :param angular_gain: true over demanded turning velocity
    :param velocity_noise: standard deviation of either velocity, as a part of it; drawn anew
        each millisecond of motion
    :param odometry_noise: standard deviation of x and of y in odometry [m]; drawn anew every
        20 ms, and bounded: odometry does not drift
    :param heading_noise: standard deviation of the heading in odometry [rad]; likewise
    :param undock_distance: how far the robot drives straight off its dock [m]
    :param undock_velocity: how fast it does that [m/s]
    """

    lag: float = 0.0
    linear_acceleration: float = math.inf
    angular_acceleration: float = math.inf
    linear_gain: float = 1.0
    angular_gain: float = 1.0
    velocity_noise: float = 0.0
    odometry_noise: float = 0.0
    heading_noise: float = 0.0
    undock_distance: float = 0.2
    undock_velocity: float = 0.1

    def __post_init__(self) -> None:
        """
        Refuse figures that no robot has.

        :raises ValueError: if a figure is not finite (an acceleration may be infinite), is
            negative (a gain may be), or is 0 where nothing would ever move
        """
        for field in fields(self):
            _check(field.name, getattr(self, field.name))

    @property
    def is_prompt(self) -> bool:
        """Whether the velocity is constant between two commands, and equal to what was asked."""
        return (
            self.lag == 0.0 and self.velocity_noise == 0.0
            and math.isinf(self.linear_acceleration) and math.isinf(self.angular_acceleration))


def _check(name: str, value: float) -> None:
    if name.endswith('gain'):
        is_possible, demand = math.isfinite(value), 'a finite number'
    elif name.endswith('acceleration'):
        is_possible, demand = value > 0.0, 'above 0'
    elif name == 'undock_velocity':
        is_possible, demand = math.isfinite(value) and value > 0.0, 'a finite number above 0'
    else:
        is_possible, demand = math.isfinite(value) and value >= 0.0, 'a finite number, 0 or more'
    if not is_possible:
        raise ValueError(f'{name} is {value}; it must be {demand}')


IDEAL = Fidelity()
