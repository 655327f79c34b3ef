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
"""Velocities, poses and the exact motion of a unicycle between two commands."""

from __future__ import annotations

from dataclasses import dataclass
import math


@dataclass(frozen=True, slots=True)
class Velocity:
    """
    What a robot is told: REP-103 axes, x forward, counter-clockwise positive.

    :param linear_x: forward velocity [m/s], negative backwards
    :param angular_z: turning velocity [rad/s], positive to the left
    """

    linear_x: float = 0.0
    angular_z: float = 0.0

    @property
    def is_zero(self) -> bool:
        """Whether this velocity asks for rest."""
        return self.linear_x == 0.0 and self.angular_z == 0.0


@dataclass(frozen=True, slots=True)
class Pose:
    """
    Where a robot is, in the ``odom`` frame of REP-105.

    :param x: position along x [m]
    :param y: position along y [m]
    :param theta: heading [rad], counter-clockwise positive, not wrapped: two turns are 4 pi
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0


ZERO = Velocity()
ORIGIN = Pose()


def sinc(angle: float) -> float:
    """
    Return sin(angle) / angle, which is 1 at zero.

    :param angle: an angle [rad]
    :returns: the unnormalised cardinal sine
    """
    # Below 1e-4 rad the series is exact to the last bit of a double: the next term is < 1e-18.
    return 1.0 - angle * angle / 6.0 if abs(angle) < 1e-4 else math.sin(angle) / angle


def advance(pose: Pose, distance: float, angle: float) -> Pose:
    """
    Return the pose after an arc of constant curvature.

    The chord of an arc of length s that turns by a is s sin(a/2) / (a/2), and it points along the
    heading half-way, (14) in docs/theory.md.  The same form covers straight lines, arcs and turns
    in place.

    :param pose: the pose to start from
    :param distance: signed length of the arc [m]
    :param angle: heading change along the arc [rad]
    :returns: the pose at its end
    """
    chord = distance * sinc(angle / 2.0)
    heading = pose.theta + angle / 2.0
    return Pose(
        x=pose.x + chord * math.cos(heading),
        y=pose.y + chord * math.sin(heading),
        theta=pose.theta + angle)


def integrate(pose: Pose, velocity: Velocity, duration: float) -> Pose:
    """
    Return the pose after a velocity was held for a time.

    :param pose: the pose to start from
    :param velocity: the velocity held
    :param duration: how long it is held [s]
    :returns: the pose at the end, exact for a unicycle
    """
    return advance(pose, velocity.linear_x * duration, velocity.angular_z * duration)
