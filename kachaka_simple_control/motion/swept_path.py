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
What a robot sweeps on its planned path, and the first point of a scan that it would touch.

Tested by test/motion/test_swept_path.py.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Iterator
import math
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.motion.chain import ChainPath
from kachaka_simple_control.motion.geometry import (
    Box,
    Footprint,
    integrate,
    ORIGIN,
    Point,
    Pose,
    relative_to,
)
from kachaka_simple_control.motion.plan import Plan

#: The path is looked at after this way [m], or this turn [rad], at the latest.  Between two poses
#: an outline leaves less than 1 mm out at its corners.
SPACING, TURN_SPACING = 0.02, math.radians(3.0)
#: Points are looked up by squares of this size [m].
CELL = 0.1
#: How many poses that are behind the robot are kept.
KEPT_POSES = 2000


class WayPoint(NamedTuple):
    """
    A pose on a way.

    :param time: the plan time [s]
    :param length: driven from the start of the way [m], never negative
    :param angle: turned from there, the sum of all turns without their signs [rad]
    """

    time: float
    pose: Pose
    length: float
    angle: float


class PlannedWay:
    """The poses of a plan by plan time, computed where they are asked for; times mostly grow."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        #: the pose at the start of the segment with the number ``_first``, and of later ones
        self._first, self._poses = 0, [ORIGIN]

    def pose_at(self, time: float) -> Pose:
        """Return the planned pose at a plan time."""
        if not self.plan.segments:
            return ORIGIN
        index = self._index(time)
        segment = self.plan.segments[index]
        return integrate(self._pose(index), segment.velocity, (
            min(max(time, segment.start), segment.end) - segment.start))

    def between(self, start: float, end: float) -> Iterator[WayPoint]:
        """Return poses from one plan time to a later one, both included."""
        point = WayPoint(start, self.pose_at(start), 0.0, 0.0)
        yield point
        since_length = since_angle = length = angle = 0.0
        index = self._index(start) if self.plan.segments else 0
        while index < len(self.plan.segments) and point.time < end:
            segment = self.plan.segments[index]
            index += 1
            begin, stop = max(segment.start, start), min(segment.end, end)
            velocity, pose = segment.velocity, self._pose(index - 1)
            linear, angular = abs(velocity.linear_x), abs(velocity.angular_z)
            count = max(1, math.ceil((stop - begin) * max(
                linear / SPACING, angular / TURN_SPACING)))
            part = (stop - begin) / count
            for number in range(1, count + 1):
                length, angle = length + linear * part, angle + angular * part
                since_length, since_angle = since_length + linear * part, (
                    since_angle + angular * part)
                is_last = stop >= end and number == count
                if is_last or since_length + linear * part > SPACING or (
                        since_angle + angular * part > TURN_SPACING):
                    time = begin + number * part
                    point = WayPoint(
                        time, integrate(pose, velocity, time - segment.start), length, angle)
                    yield point
                    since_length = since_angle = 0.0
            if stop >= end:
                return

    def time_after(self, start: float, length: float, angle: float) -> float:
        """
        Return the plan time at which a length [m] or a turn [rad] is complete, or that of the end.

        In a corner it is the end of the corner at least.
        """
        time = self.plan.duration
        for point in self.between(start, self.plan.duration):
            if point.length >= length or point.angle >= angle:
                time = point.time
                break
        return max(time, self._corner_end(start))

    def _corner_end(self, time: float) -> float:
        if not self.plan.steps:
            return time
        step = self.plan.steps[self.plan.step_index(time)]
        begin = step.start
        for trajectory in step.trajectories:
            end = begin + trajectory.duration
            if begin < time < end and isinstance(trajectory, ChainPath):
                return end
            begin = end
        return time

    def _index(self, time: float) -> int:
        return max(0, bisect_right(
            self.plan.segments, time, key=attrgetter('start')) - 1)

    def _pose(self, index: int) -> Pose:
        """Return the pose at the start of a segment."""
        if index < self._first:
            self._first, self._poses = 0, [ORIGIN]
        while self._first + len(self._poses) <= index:
            segment = self.plan.segments[self._first + len(self._poses) - 1]
            self._poses.append(integrate(
                self._poses[-1], segment.velocity, segment.end - segment.start))
            if len(self._poses) > 2 * KEPT_POSES:
                del self._poses[:KEPT_POSES]
                self._first += KEPT_POSES
        return self._poses[index - self._first]


class Outline:
    """The outline of a robot, and a margin around it [m]."""

    def __init__(self, footprint: Footprint, margin: float = 0.0) -> None:
        self._is_box = isinstance(footprint, Box)
        if isinstance(footprint, Box):
            self._ahead = footprint.ahead
            self._half = footprint.length / 2.0, footprint.width / 2.0
            corner = max(math.hypot(x, y) for x, y in footprint.corners())
            self.margin = margin
        else:
            self._ahead, self._half, corner = 0.0, (0.0, 0.0), footprint.radius
            self.margin = footprint.radius + margin
        #: the largest distance of a point of it from the wheel axle [m]
        self.reach = corner + margin

    def distance(self, point: Point, pose: Pose = ORIGIN) -> float:
        """Return how far a point is from the margin at a pose [m]; 0 inside."""
        seen = relative_to(pose, Pose(*point))
        return max(0.0, math.hypot(
            max(0.0, abs(seen.x - self._ahead) - self._half[0]),
            max(0.0, abs(seen.y) - self._half[1])) - self.margin)

    def contains(self, x: float, y: float) -> bool:
        """Return whether a point in the frame of the robot [m] is nearer than the margin."""
        away_x = abs(x - self._ahead) - self._half[0]
        away_y = abs(y) - self._half[1]
        if away_x <= 0.0 or away_y <= 0.0:
            return away_x <= self.margin and away_y <= self.margin
        return away_x * away_x + away_y * away_y <= self.margin * self.margin


class PointMap:
    """The points of a scan, to be looked up by place."""

    def __init__(self, points: Iterable[Point]) -> None:
        self._cells: dict[tuple[int, int], list[Point]] = defaultdict(list)
        for point in points:
            self._cells[int(point[0] // CELL), int(point[1] // CELL)].append(point)

    def touches(self, outline: Outline, pose: Pose) -> bool:
        """Return whether an outline at a pose contains a point."""
        cells = self._cells
        if not cells:
            return False
        cosine, sine = math.cos(pose.theta), math.sin(pose.theta)
        reach = outline.reach
        rows = range(int((pose.y - reach) // CELL), int((pose.y + reach) // CELL) + 1)
        for column in range(int((pose.x - reach) // CELL), int((pose.x + reach) // CELL) + 1):
            for row in rows:
                for point_x, point_y in cells.get((column, row), ()):
                    x, y = point_x - pose.x, point_y - pose.y
                    if outline.contains(x * cosine + y * sine, y * cosine - x * sine):
                        return True
        return False
