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
"""
The distance between the outlines of two robots.

Tested by test/analysis/test_clearance.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import Disc, Footprint, Point, Pose


@dataclass(frozen=True)
class Hull:
    """
    An outline as a rectangle, grown by a radius: a disc is a point that is grown.

    The rectangle is seen from the wheel axle: x from ``back`` to ``front``, y from minus ``side``
    to ``side`` [m].

    :param radius: by how much the rectangle is grown [m]
    :param corners: of the rectangle [m]
    """

    front: float
    back: float
    side: float
    radius: float
    corners: tuple[Point, ...]

    @classmethod
    def of(cls, footprint: Footprint | None) -> Hull:
        """Return the hull of an outline; that of an unknown one is a point at the axle."""
        if footprint is None or isinstance(footprint, Disc):
            return cls(0.0, 0.0, 0.0, footprint.radius if footprint else 0.0, ((0.0, 0.0),))
        front, side = footprint.front, footprint.width / 2.0
        return cls(front, front - footprint.length, side, 0.0, tuple(footprint.corners()))

    @property
    def reach(self) -> float:
        """Return how far the rectangle's farthest corner is from the wheel axle [m]."""
        return max(math.hypot(x, y) for x, y in self.corners)


class Separation(NamedTuple):
    """
    How far two outlines are apart, and where, seen from the axle of the first robot.

    :param distance: [m]; 0 if they touch or overlap
    :param direction: from the first outline to the second, as a unit vector; 0, 0 if their
        rectangles overlap
    :param place: in the middle between their nearest points, or between their middles if they
        cross [m]
    """

    distance: float
    direction: Point
    place: Point


def gap(one: Hull, two: Hull, pose: Pose) -> Separation:
    """Return how far two outlines are apart, for the pose of the second seen from the first."""
    cosine, sine = math.cos(pose.theta), math.sin(pose.theta)
    # The nearest points of two rectangles that do not overlap: one of them is a corner.
    nearest, foot, end = math.inf, (0.0, 0.0), (0.0, 0.0)
    theirs = [(pose.x + x * cosine - y * sine, pose.y + x * sine + y * cosine)
              for x, y in two.corners]
    for x, y in theirs:
        near_x = min(max(x, one.back), one.front)
        near_y = min(max(y, -one.side), one.side)
        square = (x - near_x) ** 2 + (y - near_y) ** 2
        if square < nearest:
            nearest, foot, end = square, (near_x, near_y), (x, y)
    ours = [((x - pose.x) * cosine + (y - pose.y) * sine,
             (y - pose.y) * cosine - (x - pose.x) * sine) for x, y in one.corners]
    for corner, (x, y) in zip(one.corners, ours):
        near_x = min(max(x, two.back), two.front)
        near_y = min(max(y, -two.side), two.side)
        square = (x - near_x) ** 2 + (y - near_y) ** 2
        if square < nearest:
            nearest, foot = square, corner
            end = (pose.x + near_x * cosine - near_y * sine,
                   pose.y + near_x * sine + near_y * cosine)
    distance = math.sqrt(nearest)
    if not distance:
        return Separation(0.0, (0.0, 0.0), foot)
    if not (_is_beside(theirs, one) or _is_beside(ours, two)):
        # They cross, and no corner of one is in the other.
        return Separation(0.0, (0.0, 0.0), _crossing(one, two, pose, cosine, sine))
    right, up = (end[0] - foot[0]) / distance, (end[1] - foot[1]) / distance
    free = distance - one.radius - two.radius
    middle = one.radius + free / 2.0
    place = foot[0] + right * middle, foot[1] + up * middle
    return Separation(max(0.0, free), (right, up), place)


def _is_beside(corners: Sequence[Point], hull: Hull) -> bool:
    """Return whether a side of a rectangle separates it from the corners of another one."""
    xs, ys = zip(*corners)
    return bool(
        min(xs) > hull.front or max(xs) < hull.back
        or min(ys) > hull.side or max(ys) < -hull.side)


def _crossing(one: Hull, two: Hull, pose: Pose, cosine: float, sine: float) -> Point:
    """Return the middle between the middles of two rectangles that overlap."""
    ahead, other = (one.front + one.back) / 2.0, (two.front + two.back) / 2.0
    return ((ahead + pose.x + other * cosine) / 2.0, (pose.y + other * sine) / 2.0)
