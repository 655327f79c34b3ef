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
"""What the robot is to do, as its gRPC service takes it."""

from __future__ import annotations

from dataclasses import dataclass
import math

from kachaka_simple_control.motion.kinematics import Velocity
from kachaka_simple_control.motion.limits import Limits


@dataclass(frozen=True)
class Command:
    """
    A velocity as parts of the robot's largest, and when it came.

    :param linear: forward, from -1 to 1
    :param angular: turning to the left, from -1 to 1
    :param time: when it came [s, steady clock]
    """

    linear: float
    angular: float
    time: float

    @property
    def is_stop(self) -> bool:
        """Whether it asks the robot to stand still."""
        return self.linear == 0.0 and self.angular == 0.0


def command(velocity: Velocity, limits: Limits, now: float) -> Command:
    """
    Return a velocity as the robot takes it, cut off at its largest.

    :param velocity: the velocity
    :param limits: the largest velocities of the robot
    :param now: the time [s, steady clock]
    :returns: the command
    :raises ValueError: if the velocity is no finite number, in one line
    """
    if not (math.isfinite(velocity.linear_x) and math.isfinite(velocity.angular_z)):
        raise ValueError(
            f'linear.x {velocity.linear_x} m/s and angular.z {velocity.angular_z} rad/s must be '
            'finite numbers')
    return Command(
        _part(velocity.linear_x, limits.max_linear_velocity),
        _part(velocity.angular_z, limits.max_angular_velocity),
        now)


def _part(value: float, largest: float) -> float:
    return max(-1.0, min(value / largest, 1.0))
