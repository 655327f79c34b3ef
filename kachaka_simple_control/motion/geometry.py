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
"""Planar geometry: velocities, poses, SE(2) transforms, and the outlines of robots from above."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
import math
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Velocity:
    """A planar velocity in the axes of REP-103: x forward, counter-clockwise positive."""

    linear_x: float = 0.0
    angular_z: float = 0.0

    @property
    def is_zero(self) -> bool:
        """Return whether the linear and the angular velocity are both zero."""
        return self.linear_x == 0.0 and self.angular_z == 0.0


@dataclass(frozen=True, slots=True)
class Pose:
    """
    A planar pose in a frame, for example in the ``odom`` frame of REP-105.

    :param theta: heading [rad], counter-clockwise positive, not wrapped: 4 pi after two turns
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0


@dataclass(frozen=True)
class Displacement:
    """
    How far a robot has driven and turned.

    :param distance: the length of the driven path [m]; a part driven backwards counts as negative
    :param angle: the change of the heading [rad], counter-clockwise positive
    """

    distance: float
    angle: float


#: x and y [m].
Point = tuple[float, float]

ZERO = Velocity()
ORIGIN = Pose()


def sinc(angle: float) -> float:
    """Return sin(angle) / angle, or 1 at angle zero."""
    # Below 1e-4 rad the series is exact to the last bit of a double: the next term is < 1e-18.
    return 1.0 - angle * angle / 6.0 if abs(angle) < 1e-4 else math.sin(angle) / angle


def yaw(x: float, y: float, z: float, w: float) -> float:
    """Return the heading of a rotation [rad], between -pi and pi."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def advance(pose: Pose, distance: float, angle: float) -> Pose:
    """
    Return the pose after an arc, a line or a turn: formula (14) of docs/theory.md.

    :param distance: the length of the arc [m], negative if it is driven backwards
    :param angle: the heading change along the arc [rad], positive to the left
    """
    # The chord of an arc with length s and heading change a has the length s sin(a/2) / (a/2).  It
    # points along the heading at the middle of the arc.
    chord = distance * sinc(angle / 2.0)
    heading = pose.theta + angle / 2.0
    return Pose(
        x=pose.x + chord * math.cos(heading),
        y=pose.y + chord * math.sin(heading),
        theta=pose.theta + angle)


def integrate(pose: Pose, velocity: Velocity, duration: float) -> Pose:
    """Return the pose after a constant velocity, exactly (unicycle model)."""
    return advance(pose, velocity.linear_x * duration, velocity.angular_z * duration)


def compose(frame: Pose, pose: Pose) -> Pose:
    """Return the product frame * pose in SE(2): a pose from a child frame to its parent frame."""
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    return Pose(
        frame.x + pose.x * cosine - pose.y * sine,
        frame.y + pose.x * sine + pose.y * cosine,
        frame.theta + pose.theta)


def relative_to(frame: Pose, pose: Pose) -> Pose:
    """Return the product inverse(frame) * pose in SE(2): a pose relative to a frame."""
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    x, y = pose.x - frame.x, pose.y - frame.y
    return Pose(x * cosine + y * sine, y * cosine - x * sine, pose.theta - frame.theta)


def distance_between(one: Pose, two: Pose) -> tuple[float, float]:
    """
    Return the distance of two poses [m], and by how much the second heading is larger [rad].

    :returns: the angle is wrapped to the range from -pi to pi
    """
    return (math.hypot(two.x - one.x, two.y - one.y),
            math.remainder(two.theta - one.theta, math.tau))


#: A turn that is less than this short of half a turn to the right is made to the left [rad].  So
#: rounding does not decide the direction of half a turn.
HALF_TURN_TOLERANCE = 1e-9


def shorter_turn(start: float, end: float) -> float:
    """Return the turn from one heading to another, the shorter way [rad]; half a turn is left."""
    angle = math.remainder(end - start, math.tau)
    return angle + math.tau if angle <= HALF_TURN_TOLERANCE - math.pi else angle


#: The number of corners of the polygon that is drawn for a circle.
CORNERS = 48


@dataclass(frozen=True)
class Box:
    """
    The outline of a rectangular robot, seen from above.

    :param length: from back to front [m]
    :param width: from side to side [m]
    :param ahead: from the wheel axle to the middle of the robot [m], positive ahead
    """

    length: float
    width: float
    ahead: float = 0.0

    @property
    def front(self) -> float:
        """Return the distance from the wheel axle to the front of the robot [m]."""
        return self.ahead + self.length / 2.0

    def corners(self) -> list[Point]:
        """
        Return x (ahead) and y (left) of each corner from the axle [m], counter-clockwise.

        The first one is at the front right.
        """
        front, back, side = self.front, self.ahead - self.length / 2.0, self.width / 2.0
        return [(front, -side), (front, side), (back, side), (back, -side)]


@dataclass(frozen=True)
class Disc:
    """The outline of a round robot with the wheel axle in the middle, seen from above."""

    radius: float

    @property
    def front(self) -> float:
        """Return the distance from the wheel axle to the front of the robot [m]."""
        return self.radius

    def corners(self) -> list[Point]:
        """Return points on the outline [m], counter-clockwise, the first at the front."""
        angles = (math.tau * corner / CORNERS for corner in range(CORNERS))
        return [(self.radius * math.cos(angle), self.radius * math.sin(angle)) for angle in angles]


Footprint = Box | Disc


def outline(footprint: Footprint, pose: Pose) -> list[Point]:
    """Return x and y of the corners of a robot at a pose [m], counter-clockwise."""
    return [transform_point(corner, pose) for corner in footprint.corners()]


def outlines(footprint: Footprint | None, poses: Iterable[Pose]) -> list[Point]:
    """
    Return the corners of a robot's outline at each of several poses [m].

    :param footprint: the robot's outline from above; if it is None, only the positions of the
        poses are returned
    """
    if footprint is None:
        return [(pose.x, pose.y) for pose in poses]
    return [corner for pose in poses for corner in outline(footprint, pose)]


def transform_point(point: Point, pose: Pose) -> Point:
    """Return x and y of a point that is given relative to a pose [m]."""
    transformed = compose(pose, Pose(*point))
    return transformed.x, transformed.y


class Area(NamedTuple):
    """
    A rectangle on the floor, parallel to the axes.

    :param left: the smallest x [m]
    :param bottom: the smallest y [m]
    :param width: the size along x [m]
    :param height: the size along y [m]
    """

    left: float
    bottom: float
    width: float
    height: float

    @property
    def corners(self) -> tuple[Point, Point]:
        """Return the lower left and the upper right corner of the rectangle [m]."""
        return (self.left, self.bottom), (self.left + self.width, self.bottom + self.height)
