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
"""The outline of a robot, seen from above, at a pose."""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

from kachaka_simple_control.motion.kinematics import Pose

Point = tuple[float, float]

#: Corners that a circle is drawn with.
CORNERS = 48


@runtime_checkable
class Cornered(Protocol):
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
class Round(Protocol):
    """A round robot with its axle in the middle; a profile's disc is one."""

    @property
    def radius(self) -> float:
        """Return its radius [m]."""


Footprint = Cornered | Round


def outline(footprint: Footprint, pose: Pose) -> list[Point]:
    """
    Return the outline of a robot where it stands.

    :param footprint: its shape
    :param pose: where its axle is, and where it looks
    :returns: the corners [m], counter-clockwise, beginning at the front on the right
    """
    return [place(corner, pose) for corner in _corners(footprint)]


def nose(footprint: Footprint, pose: Pose) -> Point:
    """
    Return the foremost point straight ahead of the axle.

    :param footprint: the robot's shape
    :param pose: where it stands
    :returns: the point [m]
    """
    if isinstance(footprint, Round):
        return place((footprint.radius, 0.0), pose)
    return place((footprint.ahead + footprint.length / 2.0, 0.0), pose)


def place(point: Point, pose: Pose) -> Point:
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
    if isinstance(footprint, Round):
        angles = (math.tau * corner / CORNERS for corner in range(CORNERS))
        return [(footprint.radius * math.cos(a), footprint.radius * math.sin(a)) for a in angles]
    half, side = footprint.length / 2.0, footprint.width / 2.0
    front, back = footprint.ahead + half, footprint.ahead - half
    return [(front, -side), (front, side), (back, side), (back, -side)]
