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
"""Paths of plans and poses, with few points: for drawing, for topics, for recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from typing import Any

from kachaka_simple_control.motion.geometry import (
    advance,
    compose,
    distance_between,
    ORIGIN,
    Point,
    Pose,
)
from kachaka_simple_control.motion.plan import Plan

#: How far an arc turns between two points [rad]: 4 degrees, off by 1/1600 of the radius.
BEND = math.radians(4.0)
#: More of a turn in place would run into its own beginning [rad].
SWEEP = math.radians(330.0)
#: Above this angle further full turns are left out, for they cannot be seen [rad].
ROUNDS = 2.0 * math.tau
#: If a path has more points than this, each of its lines is drawn once.
MANY_POINTS = 500
#: At most this many points are drawn.
MAX_POINTS = 10_000
#: Between two lines that do not touch.
GAP = (math.nan, math.nan)

Cell = tuple[int, int]


@dataclass(frozen=True)
class ArcSegment:
    """
    A part of the path of a plan, with the same curvature all along.

    :param start: the pose at its start
    :param distance: its signed length [m], negative backwards
    :param angle: heading change [rad], positive to the left
    """

    start: Pose
    distance: float
    angle: float

    @property
    def middle(self) -> Pose:
        """Return the pose half-way, with the heading of the movement."""
        pose = advance(self.start, self.distance / 2.0, self.angle / 2.0)
        return pose if self.distance >= 0.0 else Pose(pose.x, pose.y, pose.theta + math.pi)

    def sweep(self, radius: float) -> list[Point]:
        """
        Return the points of an arc that shows a turn in place; of more than a turn its end.

        :param radius: the radius of the arc [m]
        """
        angle = math.copysign(min(abs(self.angle), SWEEP), self.angle)
        first = self.start.theta + self.angle - angle
        count = max(1, math.ceil(abs(angle) / BEND))
        headings = (first + angle * number / count for number in range(count + 1))
        return [(self.start.x + radius * math.cos(heading),
                 self.start.y + radius * math.sin(heading)) for heading in headings]

    def points(self) -> list[Point]:
        """Return the points of a polyline [m], without the first; none for a turn in place."""
        if self.distance == 0.0:
            return []
        return [(pose.x, pose.y) for pose in self.poses(self.count)]

    @property
    def count(self) -> int:
        """Return in how many parts a polyline looks round; 0 if there is no movement."""
        if self.distance == self.angle == 0.0:
            return 0
        return max(1, math.ceil(abs(self._visible_angle) / BEND))

    def poses(self, count: int) -> list[Pose]:
        """Return some poses at equal distances, without the first."""
        angle = self._visible_angle
        distance = self.distance * (angle / self.angle if self.angle else 1.0)
        return [advance(self.start, distance * number / count, angle * number / count)
                for number in range(1, count + 1)]

    @property
    def _visible_angle(self) -> float:
        if abs(self.angle) <= ROUNDS:
            return self.angle
        # Full turns after the first lie on it: only where the last one ends can be seen.
        return math.copysign(math.tau, self.angle) + math.fmod(self.angle, math.tau)


def step_segments(plan: Plan, start: Pose = ORIGIN) -> list[list[ArcSegment]]:
    """
    Return the path of each step of a plan in segments of constant curvature, in order.

    :param plan: the plan
    :param start: the pose at t = 0
    """
    steps = []
    pose = start
    for planned in plan.steps:
        segments = []
        for segment in planned.step.path():
            segments.append(ArcSegment(pose, segment.length, segment.angle))
            pose = advance(pose, segment.length, segment.angle)
        steps.append(segments)
        pose = compose(start, planned.pose)  # the same, but for rounding
    return steps


def arc_segments(plan: Plan) -> list[ArcSegment]:
    """Return the path of a plan in segments of constant curvature, in order."""
    return [segment for segments in step_segments(plan) for segment in segments]


def polyline(segments: Iterable[ArcSegment], grain: float) -> list[Point]:
    """
    Return the polyline of path segments, one after the other.

    :param segments: the segments
    :param grain: the smallest distance that can be seen [m]
    :returns: its points from the start of the first segment on; where some are left out, with gaps
        of NaN
    """
    points: list[Point] = []
    for segment in segments:
        points += [] if points else [(segment.start.x, segment.start.y)]
        points += segment.points()
    if len(points) <= MANY_POINTS:
        return points or [(ORIGIN.x, ORIGIN.y)]
    thinned = _unique_lines(points, grain)
    while len(thinned) > MAX_POINTS:
        grain *= 2.0
        thinned = _unique_lines(points, grain)
    return thinned


def _unique_lines(points: Sequence[Point], grain: float) -> list[Point]:
    """Return each line once: a square driven for an hour gives one square."""
    cells = [(round(x / grain), round(y / grain)) for x, y in points]
    seen: set[tuple[Cell, Cell]] = set()
    kept = [points[0]]
    last = 0
    for one, two in pairwise(range(len(points))):
        ends = (cells[one], cells[two])
        if ends[0] == ends[1] or ends in seen:
            continue
        seen.update((ends, ends[::-1]))
        kept += [points[two]] if cells[last] == ends[0] else [GAP, points[one], points[two]]
        last = two
    # It ends where the path does, also where that line is drawn already.
    return kept if last == len(points) - 1 else [*kept, GAP, *points[-2:]]


def distinct(poses: Iterable[Pose], grain: float, most: int) -> list[Pose]:
    """
    Return poses of which no two look the same.

    :param poses: the poses, in order
    :param grain: the smallest distance that can be seen [m]
    :param most: how many there may be; if there are more, they are chosen evenly
    """
    kinds: dict[tuple[int, int, int], Pose] = {}
    for pose in poses:
        heading = round(math.degrees(pose.theta)) % 360
        kinds.setdefault((round(pose.x / grain), round(pose.y / grain), heading), pose)
    return _evenly(list(kinds.values()), most)


#: Two poses of a history differ by one of these at least [m], [rad]: what can be seen.
SPACING = 0.01
TURN = math.radians(4.0)


class PoseHistory:
    """
    Past poses of a robot, at least some distance or angle apart; of bounded length.

    If it is full, every second pose is removed, and the distance and angle are doubled.

    :param most: how many poses it may have, two at least
    :param convert: converts a pose to what is stored; called once for each
    """

    def __init__(self, most: int, convert: Callable[[Pose], Any]) -> None:
        self._most = most
        self._convert = convert
        self._last: Pose | None = None
        self._spacing, self._turn = SPACING, TURN
        #: what is stored, in order
        self.kept: list[Any] = []

    def add(self, pose: Pose) -> bool:
        """Add a pose if it is far enough from the last one, and return whether it is."""
        if not math.isfinite(pose.x + pose.y + pose.theta):
            return False
        if self._last is not None and not self._is_apart(self._last, pose):
            return False
        if len(self.kept) >= self._most:
            del self.kept[1::2]
            self._spacing, self._turn = 2.0 * self._spacing, 2.0 * self._turn
        self._last = pose
        self.kept.append(self._convert(pose))
        return True

    def _is_apart(self, one: Pose, two: Pose) -> bool:
        distance, angle = distance_between(one, two)
        return distance >= self._spacing or abs(angle) >= min(self._turn, math.pi / 2.0)


#: The largest number of poses, by default.
MAX_POSES = 2000


def sample_path(plan: Plan, start: Pose = ORIGIN, most: int = MAX_POSES) -> list[Pose]:
    """
    Return poses of a plan from its start to its end, enough of them to make curves look round.

    :param plan: the plan
    :param start: the pose at t = 0
    :param most: how many poses there may be, two at least
    """
    if len(plan.steps) >= most:
        ends = [ORIGIN, *(step.pose for step in plan.steps)]
        return [compose(start, pose) for pose in _evenly(ends, most)]
    segments = arc_segments(plan)
    # Rounded up for each step, so that each has its end.
    coarseness = max(1.0, sum(segment.count for segment in segments) / most)
    poses = [ORIGIN]
    for segment in segments:
        poses += segment.poses(math.ceil(segment.count / coarseness))
    return [compose(start, pose) for pose in _evenly(poses, most)]


def _evenly(poses: list[Pose], most: int) -> list[Pose]:
    """Return at most ``most`` poses, taken evenly, with the first and the last."""
    if len(poses) <= most:
        return poses
    return [poses[number * (len(poses) - 1) // (most - 1)] for number in range(most)]


def simplify(points: Sequence[Point], grain: float, most: int) -> list[Point]:
    """
    Return a path without the points that lie on the line from one that stays to the next.

    Matplotlib's path.simplify leaves 20 times as much of an hour's drive at the same tolerance.

    :param points: the path [m]
    :param grain: how far beside the line a point may lie [m], above 0; doubled until few stay
    :param most: how many points may stay
    :returns: the points that stay, the first and the last among them
    """
    kept = _straighten(points, grain)
    while len(kept) > most:
        grain *= 2.0
        kept = _straighten(kept, grain)
    return kept


def _straighten(points: Sequence[Point], grain: float) -> list[Point]:
    if len(points) < 3:
        return list(points)
    kept = [points[0]]
    cone = _Cone(points[0], grain)
    before = points[0]
    for point in points[1:]:
        if point == before:
            continue
        if not cone.add(point):
            kept.append(before)
            cone = _Cone(before, grain)
            cone.add(point)
        before = point
    return [*kept, before]


class _Cone:
    """
    The directions of lines from a point that pass all points so far, as far as they reach.

    The cone intersection method of Williams (1978) and of Sklansky and Gonzalez (1980).
    """

    __slots__ = ('_grain', '_high', '_low', '_middle', '_reach', '_start')

    def __init__(self, start: Point, grain: float) -> None:
        self._start, self._grain = start, grain
        self._middle = self._low = self._high = math.nan
        self._reach = 0.0

    def add(self, point: Point) -> bool:
        """Return whether a line passes this point too; if so, keep the lines that do."""
        x, y = point[0] - self._start[0], point[1] - self._start[1]
        distance = math.hypot(x, y)
        # A path that comes back has turned at a point before.
        if distance < self._reach - self._grain:
            return False
        if distance <= self._grain:
            return True
        half = math.asin(self._grain / distance)
        direction = math.atan2(y, x)
        if self._reach == 0.0:
            self._middle, self._low, self._high = direction, -half, half
        else:
            off = math.remainder(direction - self._middle, math.tau)
            if not self._low <= off <= self._high:
                return False
            self._low, self._high = max(self._low, off - half), min(self._high, off + half)
        self._reach = max(self._reach, distance)
        return True
