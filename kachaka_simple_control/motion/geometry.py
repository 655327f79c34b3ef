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
        """Return whether the linear and the angular velocity are both zero."""
        return self.linear_x == 0.0 and self.angular_z == 0.0


@dataclass(frozen=True, slots=True)
class Pose:
    """
    A planar pose in a frame, for example in the ``odom`` frame of REP-105.

    :param x: position along x [m]
    :param y: position along y [m]
    :param theta: heading [rad], counter-clockwise positive.  It is not wrapped: after two turns to
        the left it is 4 pi
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0


@dataclass(frozen=True)
class Displacement:
    """
    How far a robot has driven and how far it has turned.

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
    """
    Return sin(angle) / angle, or 1 at angle zero.

    :param angle: an angle [rad]
    """
    # Below 1e-4 rad the series is exact to the last bit of a double: the next term is < 1e-18.
    return 1.0 - angle * angle / 6.0 if abs(angle) < 1e-4 else math.sin(angle) / angle


def yaw(x: float, y: float, z: float, w: float) -> float:
    """
    Return the heading of a rotation [rad], between -pi and pi.

    :param x: the quaternion of the rotation; the other parameters are its other components
    """
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def advance(pose: Pose, distance: float, angle: float) -> Pose:
    """
    Return the pose of a robot after it has driven along an arc.

    The arc can also be a straight line or a turn in place.  See formula (14) of docs/theory.md.

    :param pose: the pose at the start of the arc
    :param distance: the length of the arc [m], negative if it is driven backwards; 0 for a turn in
        place
    :param angle: the heading change along the arc [rad], positive to the left; 0 for a straight
        line
    :returns: the pose at the end of the arc
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
    """
    Return the pose of a robot after it has driven at a constant velocity.

    The result is exact for a robot that cannot move sideways (unicycle model).

    :param pose: the pose to start from
    :param velocity: the constant velocity
    :param duration: the duration of the drive [s]
    """
    return advance(pose, velocity.linear_x * duration, velocity.angular_z * duration)


def compose(frame: Pose, pose: Pose) -> Pose:
    """
    Convert a pose from a child frame to its parent frame.

    In SE(2), the result is the product frame * pose.

    :param frame: the pose of the child frame in the parent frame
    :param pose: the pose to convert, in the child frame
    :returns: the same pose in the parent frame
    """
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    return Pose(
        frame.x + pose.x * cosine - pose.y * sine,
        frame.y + pose.x * sine + pose.y * cosine,
        frame.theta + pose.theta)


def relative_to(frame: Pose, pose: Pose) -> Pose:
    """
    Convert a pose so that it is relative to a frame.

    In SE(2), the result is the product inverse(frame) * pose.

    :param frame: the pose of the frame in its parent frame
    :param pose: the pose to convert, in the parent frame of ``frame``
    :returns: the same pose, relative to ``frame``
    """
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    x, y = pose.x - frame.x, pose.y - frame.y
    return Pose(x * cosine + y * sine, y * cosine - x * sine, pose.theta - frame.theta)


def distance_between(one: Pose, two: Pose) -> tuple[float, float]:
    """
    Return the distance between two poses [m] and the difference of their headings [rad].

    :param one: the first pose
    :param two: the second pose
    :returns: the distance [m], and the heading of the second pose minus the heading of the first
        pose [rad], wrapped to the range from -pi to pi
    """
    return (math.hypot(two.x - one.x, two.y - one.y),
            math.remainder(two.theta - one.theta, math.tau))


#: A turn that is less than this short of half a turn to the right is made to the left [rad].  So
#: rounding does not decide the direction of half a turn.
HALF_TURN_TOLERANCE = 1e-9


def shorter_turn(start: float, end: float) -> float:
    """
    Return the turn from one heading to another, the shorter way [rad].

    :param start: the heading before the turn [rad]
    :param end: the heading after the turn, which may differ by whole turns [rad]
    :returns: the angle, positive to the left; half a turn is to the left
    """
    angle = math.remainder(end - start, math.tau)
    return angle + math.tau if angle <= HALF_TURN_TOLERANCE - math.pi else angle


#: The number of corners of the polygon that is drawn for a circle.
CORNERS = 48


@dataclass(frozen=True)
class Box:
    """
    The outline of a rectangular robot, seen from above.

    The robot turns about the middle of its wheel axle.

    :param length: the length of the robot from back to front [m]
    :param width: the width of the robot from side to side [m]
    :param ahead: the distance from the axle to the middle of the robot [m], positive if the middle
        of the robot is in front of the axle
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
        Return x and y of each corner of the robot [m], counter-clockwise.

        x points ahead and y points to the left, from the middle of the wheel axle.  The first
        corner is at the front right.
        """
        front, back, side = self.front, self.ahead - self.length / 2.0, self.width / 2.0
        return [(front, -side), (front, side), (back, side), (back, -side)]


@dataclass(frozen=True)
class Disc:
    """
    The outline of a round robot, seen from above, with the wheel axle in the middle.

    :param radius: the radius of the robot [m]
    """

    radius: float

    @property
    def front(self) -> float:
        """Return the distance from the wheel axle to the front of the robot [m]."""
        return self.radius

    def corners(self) -> list[Point]:
        """
        Return x and y of points on the outline of the round robot [m], counter-clockwise.

        x points ahead and y points to the left, from the middle of the robot.  The first point is
        at the front.
        """
        angles = (math.tau * corner / CORNERS for corner in range(CORNERS))
        return [(self.radius * math.cos(angle), self.radius * math.sin(angle)) for angle in angles]


Footprint = Box | Disc


def outline(footprint: Footprint, pose: Pose) -> list[Point]:
    """
    Return the corners of the outline of a robot that is at a given pose.

    :param footprint: the outline of the robot, relative to the middle of its wheel axle
    :param pose: the pose of the middle of the wheel axle
    :returns: x and y of each corner [m], counter-clockwise, in the frame in which the pose is
        given
    """
    return [transform_point(corner, pose) for corner in footprint.corners()]


def transform_point(point: Point, pose: Pose) -> Point:
    """
    Return the position of a point that is given relative to a pose.

    :param point: how far the point is ahead of the pose, and how far to the left of it [m]
    :param pose: the pose
    :returns: x and y of the point [m], in the frame in which the pose is given
    """
    transformed = compose(pose, Pose(*point))
    return transformed.x, transformed.y
