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
"""Convert plans and poses to paths with few points, and to the floor area that they need."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
import math
from typing import Any, TypeAlias

from kachaka_simple_control.motion.chain import ChainPath
from kachaka_simple_control.motion.geometry import (
    advance,
    Area,
    compose,
    distance_between,
    Footprint,
    integrate,
    ORIGIN,
    outlines,
    Point,
    Pose,
)
from kachaka_simple_control.motion.plan import Plan

#: The heading change between two points of a drawn arc [rad].  With 4 degrees, the error is 1/1600
#: of the radius.
BEND = math.radians(4.0)
#: The largest angle of an arc that shows a turn in place [rad].  The ends of a longer arc would
#: touch.
SWEEP = math.radians(330.0)
#: If the heading change of an arc is larger than this [rad], full turns are left out, because they
#: would cover each other.
ROUNDS = 2.0 * math.tau
#: If a path has more points than this, a line that occurs several times is drawn once.
MANY_POINTS = 500
#: The largest number of points that are drawn.
MAX_POINTS = 10_000
#: A point of NaN values, which separates two lines that do not touch.
GAP = (math.nan, math.nan)

Cell = tuple[int, int]


@dataclass(frozen=True)
class ArcSegment:
    """
    A part of a planned path with constant curvature: an arc, a straight line or a turn in place.

    :param distance: the signed length [m], negative backwards; 0 for a turn in place
    :param angle: the heading change [rad], positive to the left; 0 for a straight line
    """

    start: Pose
    distance: float
    angle: float

    @property
    def end(self) -> Pose:
        """Return the pose at the end of the path segment."""
        return advance(self.start, self.distance, self.angle)

    @property
    def middle(self) -> Pose:
        """Return the pose in the middle, for an arrow: its heading is the direction of travel."""
        pose = advance(self.start, self.distance / 2.0, self.angle / 2.0)
        return pose if self.distance >= 0.0 else Pose(pose.x, pose.y, pose.theta + math.pi)

    def sweep(self, radius: float) -> list[Point]:
        """
        Return points on an arc around the robot [m], which shows a turn in place in a plot.

        It has at most the last 330 degrees of the turn, so that its ends do not touch.
        """
        angle = math.copysign(min(abs(self.angle), SWEEP), self.angle)
        first = self.start.theta + self.angle - angle
        count = max(1, math.ceil(abs(angle) / BEND))
        headings = (first + angle * number / count for number in range(count + 1))
        return [(self.start.x + radius * math.cos(heading),
                 self.start.y + radius * math.sin(heading)) for heading in headings]

    def points(self) -> list[Point]:
        """Return points along the segment to draw it as a curve [m], without the start point."""
        if self.distance == 0.0:
            return []
        return [(pose.x, pose.y) for pose in self.poses(self.count)]

    @property
    def count(self) -> int:
        """Return the number of lines that draw the segment as a curve; 0 without movement."""
        if self.distance == self.angle == 0.0:
            return 0
        return max(1, math.ceil(abs(self._visible_angle) / BEND))

    def poses(self, count: int) -> list[Pose]:
        """
        Return poses at equal distances along the segment, without the start pose.

        Of more than two turns, one to two are left (1.25 of 5.25): others would cover them in a
        plot.
        """
        angle = self._visible_angle
        distance = self.distance * (angle / self.angle if self.angle else 1.0)
        return [advance(self.start, distance * number / count, angle * number / count)
                for number in range(1, count + 1)]

    @property
    def _visible_angle(self) -> float:
        if abs(self.angle) <= ROUNDS:
            return self.angle
        # Further full turns cover the first one, so only the end of the last turn is visible.
        return math.copysign(math.tau, self.angle) + math.fmod(self.angle, math.tau)


@dataclass(frozen=True)
class ChainSegment:
    """A part of a planned path whose curvature varies, such as a corner that is cut."""

    start: Pose
    chain: ChainPath

    @property
    def distance(self) -> float:
        """Return the signed length [m], negative backwards."""
        return self.chain.length

    @property
    def angle(self) -> float:
        """Return the heading change [rad], positive to the left."""
        return self.chain.angle

    @property
    def end(self) -> Pose:
        """Return the pose at the end of the path segment."""
        return self.chain.advance(self.start)

    @property
    def middle(self) -> Pose:
        """Return the pose in the middle, for an arrow: its heading is the direction of travel."""
        pose = self.poses(2)[0]
        return pose if self.distance >= 0.0 else Pose(pose.x, pose.y, pose.theta + math.pi)

    def points(self) -> list[Point]:
        """Return points along the segment to draw it as a curve [m], without the start point."""
        return [(pose.x, pose.y) for pose in self.poses(self.count)]

    @property
    def count(self) -> int:
        """Return the number of straight lines that are needed to draw the segment as a curve."""
        # The angular velocity of a turn with limited jerk is at most twice its mean.
        return max(1, math.ceil(2.0 * abs(self.angle) / BEND))

    def poses(self, count: int) -> list[Pose]:
        """Return poses at equal intervals of planned time, without the start pose."""
        arcs, tick = len(self.chain.sent), self.chain.tick
        poses = []
        for number in range(1, count + 1):
            index, part = divmod(number * arcs, count)
            pose = self._arc_ends[index]
            if part:
                pose = integrate(pose, self.chain.sent[index], tick * part / count)
            poses.append(pose)
        return poses

    @cached_property
    def _arc_ends(self) -> list[Pose]:
        poses = [self.start]
        for velocity in self.chain.sent:
            poses.append(integrate(poses[-1], velocity, self.chain.tick))
        return poses


#: A part of a planned path: with constant curvature, or a chain of short arcs.
PathPart: TypeAlias = ArcSegment | ChainSegment


def step_segments(plan: Plan, start: Pose = ORIGIN) -> list[list[PathPart]]:
    """Return the planned path of each step of a plan; in a flow, with cut corners."""
    steps = []
    pose = start
    for planned in plan.steps:
        segments: list[PathPart] = []
        for path in planned.trajectories:
            segments.append(ChainSegment(pose, path) if isinstance(path, ChainPath)
                            else ArcSegment(pose, path.length, path.angle))
            pose = segments[-1].end
        steps.append(segments)
        pose = compose(start, planned.pose)  # the same pose, without accumulated rounding errors
    return steps


def arc_segments(plan: Plan) -> list[PathPart]:
    """Return the planned path of a plan, from the origin, as a list of parts in driving order."""
    return [segment for segments in step_segments(plan) for segment in segments]


def uncut_path(plan: Plan) -> list[ArcSegment]:
    """Return the path of a plan with a stop at each step, so without cut corners."""
    segments: list[ArcSegment] = []
    for planned in plan.steps:
        for segment in planned.step.path():
            pose = segments[-1].end if segments else ORIGIN
            segments.append(ArcSegment(pose, segment.length, segment.angle))
    return segments


def polyline(segments: Iterable[PathPart], grain: float) -> list[Point]:
    """
    Return the points of a polyline that shows consecutive path segments in a plot [m].

    Of more than 500 points, a line that would cover an earlier one is left out, but for the last.

    :param grain: the smallest distance that is visible in the plot [m]
    :returns: a point of NaN values marks each gap
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
    """
    Leave out the lines of a path that cover an earlier line, but keep the last one.

    Lines cover each other if their end points are equal after rounding to ``grain``: of the same
    square driven ten times, one is left.

    :returns: the points [m]; a point of NaN values marks each gap
    """
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
    # Keep the last line even if it is a repeat, so that the result ends at the end of the path.
    return kept if last == len(points) - 1 else [*kept, GAP, *points[-2:]]


def distinct(poses: Iterable[Pose], grain: float, most: int) -> list[Pose]:
    """
    Return poses without those that look the same as an earlier one in a plot.

    Their positions are equal after rounding to ``grain`` [m], their headings to a degree.

    :param most: if more are left, so many are selected evenly
    """
    kinds: dict[tuple[int, int, int], Pose] = {}
    for pose in poses:
        heading = round(math.degrees(pose.theta)) % 360
        kinds.setdefault((round(pose.x / grain), round(pose.y / grain), heading), pose)
    return _evenly(list(kinds.values()), most)


#: Two consecutive poses of a history differ by at least this distance [m] or this angle [rad].
SPACING = 0.01
TURN = math.radians(4.0)


class PoseHistory:
    """
    Past poses of a robot, thinned out when there are too many.

    A pose is stored if it is far enough from the last one.  At ``most`` poses every second one
    goes, and the required distance and heading change are doubled.

    :param most: the largest number of stored poses, at least two
    :param convert: converts a pose to the object to store, once
    """

    def __init__(self, most: int, convert: Callable[[Pose], Any]) -> None:
        self._most = most
        self._convert = convert
        self._last: Pose | None = None
        self._spacing, self._turn = SPACING, TURN
        #: the stored objects, in order
        self.kept: list[Any] = []

    def add(self, pose: Pose) -> bool:
        """Store a finite pose that is far enough from the last one; return whether it was."""
        if not math.isfinite(pose.x + pose.y + pose.theta) or (
                self._last is not None and not self._is_apart(self._last, pose)):
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


#: The default of the largest number of poses of a sampled path.
MAX_POSES = 2000


def sample_path(plan: Plan, start: Pose = ORIGIN, most: int = MAX_POSES) -> list[Pose]:
    """
    Return poses along a plan, from the start to the end, close enough to draw curves.

    :param most: the largest number of poses, at least two; with more they would be farther apart
    """
    if len(plan.steps) >= most:
        ends = [ORIGIN, *(step.pose for step in plan.steps)]
        return [compose(start, pose) for pose in _evenly(ends, most)]
    segments = arc_segments(plan)
    # Round up for each segment, so that the end of each segment is included.
    coarseness = max(1.0, sum(segment.count for segment in segments) / most)
    poses = [ORIGIN]
    for segment in segments:
        poses += segment.poses(math.ceil(segment.count / coarseness))
    return [compose(start, pose) for pose in _evenly(poses, most)]


#: The largest number of poses of a plan that are used to compute its floor area.
MAX_FLOOR_POSES = 20_000


def floor_area(plan: Plan, footprint: Footprint | None) -> Area:
    """
    Return the floor area that a robot needs for a plan from the origin, or else its path.

    On curves and turns the outline is computed every few degrees; the error is below a thousandth
    of the robot's size.
    """
    xs, ys = zip(*outlines(footprint, sample_path(plan, most=MAX_FLOOR_POSES)))
    return Area(min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys))


def _evenly(poses: list[Pose], most: int) -> list[Pose]:
    """Return at most ``most`` poses from a list: the first, the last, and evenly selected ones."""
    if len(poses) <= most:
        return poses
    return [poses[number * (len(poses) - 1) // (most - 1)] for number in range(most)]


def simplify(points: Sequence[Point], grain: float, most: int) -> list[Point]:
    """
    Reduce each part of a path that is nearly straight to the two end points of this part.

    :param points: the path [m]
    :param grain: the largest distance of a point from the straight line that replaces it [m],
        above 0.  While more than ``most`` points are left, this distance is doubled
    :returns: the kept points, among them the first and the last point [m]
    """
    # Matplotlib's setting path.simplify is similar, but with the same tolerance it keeps 20 times
    # as many points of a drive of one hour.
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
    The directions in which a straight line from a start point passes near all added points.

    Near is at most ``grain`` away.  The cone intersection method of Williams (1978) and of
    Sklansky and Gonzalez (1980) to simplify a path.
    """

    __slots__ = ('_grain', '_high', '_low', '_middle', '_reach', '_start')

    def __init__(self, start: Point, grain: float) -> None:
        self._start, self._grain = start, grain
        self._middle = self._low = self._high = math.nan
        self._reach = 0.0

    def add(self, point: Point) -> bool:
        """
        Add a point if a line passes near it and all others, and the path does not turn back.

        :returns: whether the point was added
        """
        x, y = point[0] - self._start[0], point[1] - self._start[1]
        distance = math.hypot(x, y)
        # If the distance decreases, the path has turned back at an earlier point.
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
