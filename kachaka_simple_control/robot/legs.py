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
"""The parts of an errand: what the robot does by itself, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
import math

from kachaka_simple_control.motion.kinematics import advance, Pose

#: A point that is nearer than this [m] is where the robot stands.
HERE = 1e-4


@dataclass(frozen=True)
class Straight:
    """
    Drive straight on.

    :param distance: how far [m], negative backwards
    :param speed: how fast at most [m/s]; 0 for as fast as the robot can
    """

    distance: float
    speed: float = 0.0

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the signed way [m]
        """
        return self.distance


@dataclass(frozen=True)
class Turn:
    """
    Turn on the spot.

    :param angle: how far [rad], counter-clockwise positive; more than a turn is more than a turn
    """

    angle: float

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the signed angle [rad]
        """
        return self.angle


@dataclass(frozen=True)
class Face:
    """
    Turn towards a point, the shorter way.

    :param x: where it is in odometry [m]
    :param y: likewise [m]
    """

    x: float
    y: float

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the signed angle [rad]; 0 where the robot stands on the point
        """
        # A point that the robot stands on is in no direction.
        if math.hypot(self.x - start.x, self.y - start.y) <= HERE:
            return 0.0
        direction = math.atan2(self.y - start.y, self.x - start.x)
        return math.remainder(direction - start.theta, math.tau)


@dataclass(frozen=True)
class Approach:
    """
    Drive straight on as far as a point is away.

    :param x: where it is in odometry [m]
    :param y: likewise [m]
    """

    x: float
    y: float

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the way [m]
        """
        return math.hypot(self.x - start.x, self.y - start.y)


@dataclass(frozen=True)
class Align:
    """
    Turn to a heading, the shorter way.

    :param theta: the heading in odometry [rad]
    """

    theta: float

    def length(self, start: Pose) -> float:
        """
        Return how far this is.

        :param start: where the robot is at its beginning
        :returns: the signed angle [rad]
        """
        return math.remainder(self.theta - start.theta, math.tau)


@dataclass(frozen=True)
class Stay:
    """
    Stay for a time.

    :param duration: how long [s]
    :param can_be_ended: whether somebody may tell the robot to go on before
    """

    duration: float
    can_be_ended: bool = False


Leg = Straight | Turn | Face | Approach | Align | Stay


def reach(pose: Pose) -> tuple[Leg, ...]:
    """
    Return how the robot drives to a pose, with nothing in its way.

    :param pose: the pose in odometry
    :returns: a turn, a straight line and a turn
    """
    return Face(pose.x, pose.y), Approach(pose.x, pose.y), Align(pose.theta)


def park(dock: Pose, distance: float, speed: float) -> tuple[Leg, ...]:
    """
    Return how the robot drives onto its dock: to the place before it, then backwards.

    :param dock: where it stands then, in odometry
    :param distance: how far before the dock it turns its back to it [m]
    :param speed: how fast it drives backwards [m/s]
    :returns: the legs
    """
    before = advance(dock, distance, 0.0)
    return (*reach(before), Straight(-distance, speed))
