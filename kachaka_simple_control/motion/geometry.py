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
"""Velocities, poses, planar transforms (SE(2)) and footprints."""

from __future__ import annotations

from dataclasses import dataclass
import math


@dataclass(frozen=True, slots=True)
class Velocity:
    """
    A planar velocity in the axes of REP-103: x forward, counter-clockwise positive.

    :param linear_x: forward velocity [m/s], negative backwards
    :param angular_z: turning velocity [rad/s], positive to the left
    """

    linear_x: float = 0.0
    angular_z: float = 0.0

    @property
    def is_zero(self) -> bool:
        """Return whether both components are zero."""
        return self.linear_x == 0.0 and self.angular_z == 0.0


@dataclass(frozen=True, slots=True)
class Pose:
    """
    A planar pose in a frame, for example in the ``odom`` frame of REP-105.

    :param x: position along x [m]
    :param y: position along y [m]
    :param theta: heading [rad], counter-clockwise positive, not wrapped: two turns are 4 pi
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0


@dataclass(frozen=True)
class Displacement:
    """
    The length and the heading change of a robot's path.

    :param distance: signed length of the path [m], negative backwards
    :param angle: heading change [rad], counter-clockwise positive
    """

    distance: float
    angle: float


ZERO = Velocity()
ORIGIN = Pose()


def sinc(angle: float) -> float:
    """
    Return sin(angle) / angle, or 1 at angle zero.

    :param angle: an angle [rad]
    """
    # Below 1e-4 rad the series is exact to the last bit of a double: the next term is < 1e-18.
    return 1.0 - angle * angle / 6.0 if abs(angle) < 1e-4 else math.sin(angle) / angle


def advance(pose: Pose, distance: float, angle: float) -> Pose:
    """
    Return the pose after an arc of constant curvature.

    An arc of length s with heading change a has a chord of length s sin(a/2) / (a/2).  The chord
    points along the heading at the middle of the arc; see formula (14) of docs/theory.md.  The
    formula is valid for straight lines, arcs and turns in place.

    :param pose: the pose to start from
    :param distance: signed length of the arc [m]
    :param angle: heading change along the arc [rad]
    :returns: the pose at the end of the arc
    """
    chord = distance * sinc(angle / 2.0)
    heading = pose.theta + angle / 2.0
    return Pose(
        x=pose.x + chord * math.cos(heading),
        y=pose.y + chord * math.sin(heading),
        theta=pose.theta + angle)


def integrate(pose: Pose, velocity: Velocity, duration: float) -> Pose:
    """
    Return the pose after driving at a constant velocity; exact for the unicycle model.

    :param pose: the pose to start from
    :param velocity: the velocity
    :param duration: the duration of the drive [s]
    """
    return advance(pose, velocity.linear_x * duration, velocity.angular_z * duration)


def compose(frame: Pose, pose: Pose) -> Pose:
    """
    Return a pose in the parent frame: frame * pose, as transforms in SE(2).

    :param frame: the pose of a frame in its parent frame
    :param pose: a pose relative to ``frame``
    """
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    return Pose(
        frame.x + pose.x * cosine - pose.y * sine,
        frame.y + pose.x * sine + pose.y * cosine,
        frame.theta + pose.theta)


def relative_to(frame: Pose, pose: Pose) -> Pose:
    """
    Return a pose relative to a frame: inverse(frame) * pose, as transforms in SE(2).

    :param frame: the pose of a frame in its parent frame
    :param pose: a pose in the parent frame of ``frame``
    """
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    x, y = pose.x - frame.x, pose.y - frame.y
    return Pose(x * cosine + y * sine, y * cosine - x * sine, pose.theta - frame.theta)


def distance_between(one: Pose, two: Pose) -> tuple[float, float]:
    """
    Return the distance between two poses [m] and the difference of their headings [rad].

    :param one: the first pose
    :param two: the second pose
    :returns: the distance [m], and the second heading minus the first heading [rad], from -pi
        to pi
    """
    return (math.hypot(two.x - one.x, two.y - one.y),
            math.remainder(two.theta - one.theta, math.tau))


Point = tuple[float, float]

#: The number of corners of the polygon that is drawn for a circle.
CORNERS = 48


@dataclass(frozen=True)
class Box:
    """
    The outline of a rectangular robot from above.

    :param length: from back to front [m]
    :param width: from side to side [m]
    :param ahead: distance from the axle to the middle of the robot [m], positive if the middle is
        in front of the axle; the robot turns about the middle of its axle
    """

    length: float
    width: float
    ahead: float = 0.0

    @property
    def front(self) -> float:
        """Return the distance from the axle to the front of the robot [m]."""
        return self.ahead + self.length / 2.0

    def corners(self) -> list[Point]:
        """Return the corners relative to the axle [m], counter-clockwise, front right first."""
        front, back, side = self.front, self.ahead - self.length / 2.0, self.width / 2.0
        return [(front, -side), (front, side), (back, side), (back, -side)]


@dataclass(frozen=True)
class Disc:
    """
    The outline of a round robot from above, with the axle in the middle.

    :param radius: the radius [m]
    """

    radius: float

    @property
    def front(self) -> float:
        """Return the distance from the axle to the front of the robot [m]."""
        return self.radius

    def corners(self) -> list[Point]:
        """Return points on the circle relative to the axle [m], counter-clockwise, front first."""
        angles = (math.tau * corner / CORNERS for corner in range(CORNERS))
        return [(self.radius * math.cos(angle), self.radius * math.sin(angle)) for angle in angles]


Footprint = Box | Disc


def outline(footprint: Footprint, pose: Pose) -> list[Point]:
    """
    Return the corners of the outline of a robot at a pose [m], counter-clockwise.

    :param footprint: the outline of the robot
    :param pose: the pose of the axle
    """
    return [transform_point(corner, pose) for corner in footprint.corners()]


def transform_point(point: Point, pose: Pose) -> Point:
    """
    Convert a point from the axes of a pose to the parent frame of the pose.

    :param point: the point in the axes of the pose: distance ahead and distance to the left [m]
    :param pose: the pose in the parent frame
    :returns: x and y of the point in the parent frame [m]
    """
    transformed = compose(pose, Pose(*point))
    return transformed.x, transformed.y
