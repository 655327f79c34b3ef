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
from typing import Protocol, runtime_checkable


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


@dataclass(frozen=True)
class Displacement:
    """
    How far a robot goes along its path.

    :param distance: signed length of the path [m], negative backwards
    :param angle: heading change [rad], counter-clockwise positive
    """

    distance: float
    angle: float


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


def compose(frame: Pose, pose: Pose) -> Pose:
    """
    Return a pose that is told as seen from another one.

    :param frame: the other one
    :param pose: the pose, seen from there
    :returns: the pose, seen from where the other one is seen from
    """
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    return Pose(
        frame.x + pose.x * cosine - pose.y * sine,
        frame.y + pose.x * sine + pose.y * cosine,
        frame.theta + pose.theta)


def relative_to(frame: Pose, pose: Pose) -> Pose:
    """
    Return a pose as seen from another one: what ``compose`` undoes.

    :param frame: the other one
    :param pose: the pose
    :returns: the pose, seen from there
    """
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    x, y = pose.x - frame.x, pose.y - frame.y
    return Pose(x * cosine + y * sine, y * cosine - x * sine, pose.theta - frame.theta)


def distance_between(one: Pose, two: Pose) -> tuple[float, float]:
    """
    Return how far two poses are apart.

    :param one: a pose
    :param two: another one
    :returns: the distance [m], and how far the second looks to the left of the first [rad],
        from -pi to pi
    """
    return (math.hypot(two.x - one.x, two.y - one.y),
            math.remainder(two.theta - one.theta, math.tau))


Point = tuple[float, float]

#: Corners that a circle is drawn with.
CORNERS = 48


@runtime_checkable
class RectangularFootprint(Protocol):
    """A robot with four corners; a profile's box is one."""

    @property
    def length(self) -> float:
        """Return its size from back to front [m]."""

    @property
    def width(self) -> float:
        """Return its size from side to side [m]."""

    @property
    def ahead(self) -> float:
        """Return how far its middle is ahead of the axle [m]."""


@runtime_checkable
class CircularFootprint(Protocol):
    """A round robot with its axle in the middle; a profile's disc is one."""

    @property
    def radius(self) -> float:
        """Return its radius [m]."""


Footprint = RectangularFootprint | CircularFootprint


def outline(footprint: Footprint, pose: Pose) -> list[Point]:
    """
    Return the outline of a robot where it stands.

    :param footprint: its shape
    :param pose: where its axle is, and where it looks
    :returns: the corners [m], counter-clockwise, beginning at the front on the right
    """
    return [transform_point(corner, pose) for corner in _corners(footprint)]


def front_point(footprint: Footprint, pose: Pose) -> Point:
    """
    Return the foremost point straight ahead of the axle.

    :param footprint: the robot's shape
    :param pose: where it stands
    :returns: the point [m]
    """
    if isinstance(footprint, CircularFootprint):
        return transform_point((footprint.radius, 0.0), pose)
    return transform_point((footprint.ahead + footprint.length / 2.0, 0.0), pose)


def transform_point(point: Point, pose: Pose) -> Point:
    """
    Return a point of the robot in the frame that its pose is in.

    :param point: the point, ahead and to the left of the axle [m]
    :param pose: where the robot stands
    :returns: the point [m]
    """
    ahead, left = point
    cosine, sine = math.cos(pose.theta), math.sin(pose.theta)
    return (pose.x + ahead * cosine - left * sine, pose.y + ahead * sine + left * cosine)


def _corners(footprint: Footprint) -> list[Point]:
    if isinstance(footprint, CircularFootprint):
        angles = (math.tau * corner / CORNERS for corner in range(CORNERS))
        return [(footprint.radius * math.cos(a), footprint.radius * math.sin(a)) for a in angles]
    half, side = footprint.length / 2.0, footprint.width / 2.0
    front, back = footprint.ahead + half, footprint.ahead - half
    return [(front, -side), (front, side), (back, side), (back, -side)]
