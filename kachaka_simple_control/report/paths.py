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
"""Paths of plans and poses: for drawing, for topics, for recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
import struct
from typing import Any

from kachaka_simple_control.motion.geometry import advance, compose, ORIGIN, Point, Pose
from kachaka_simple_control.motion.plan import Plan

#: How far a line turns between two of its points [rad]: 4 degrees, off by 1/1600 of the radius.
BEND = math.radians(4.0)
#: More of a turn in place would run into its own beginning [rad].
SWEEP = math.radians(330.0)
#: From here on rounds in place or on a circle are left out [rad]; nobody sees them.
ROUNDS = 2.0 * math.tau
#: From so many points on, lines are drawn but once.
MANY_POINTS = 500
#: So many points at most are drawn.
MAX_POINTS = 10_000
#: Between two lines that do not touch.
GAP = (math.nan, math.nan)

Cell = tuple[int, int]


@dataclass(frozen=True)
class ArcSegment:
    """
    A part of the path of a plan, with the same curvature all along.

    :param start: where it begins
    :param distance: how far it goes [m], negative backwards
    :param angle: how far it turns [rad], positive to the left
    """

    start: Pose
    distance: float
    angle: float

    @property
    def middle(self) -> Pose:
        """Return where it is half-way, looking where it goes to."""
        pose = advance(self.start, self.distance / 2.0, self.angle / 2.0)
        return pose if self.distance >= 0.0 else Pose(pose.x, pose.y, pose.theta + math.pi)

    def sweep(self, radius: float) -> list[Point]:
        """
        Return the points to draw a turn in place through: where something ahead would go.

        :param radius: how far ahead [m]
        :returns: the points [m]; of more than a turn its end
        """
        angle = math.copysign(min(abs(self.angle), SWEEP), self.angle)
        first = self.start.theta + self.angle - angle
        count = max(1, math.ceil(abs(angle) / BEND))
        headings = (first + angle * number / count for number in range(count + 1))
        return [(self.start.x + radius * math.cos(heading),
                 self.start.y + radius * math.sin(heading)) for heading in headings]

    def points(self) -> list[Point]:
        """
        Return the points to draw a line through.

        :returns: the points [m], without the first; none if it stays in its place
        """
        if self.distance == 0.0:
            return []
        return [(pose.x, pose.y) for pose in self.poses(self.count)]

    @property
    def count(self) -> int:
        """Return in how many parts it looks round; none if it stays as it is."""
        if self.distance == self.angle == 0.0:
            return 0
        return max(1, math.ceil(abs(self._seen_angle) / BEND))

    def poses(self, count: int) -> list[Pose]:
        """
        Return some poses on it.

        :param count: how many
        :returns: the poses, evenly from all of it, without the first
        """
        angle = self._seen_angle
        distance = self.distance * (angle / self.angle if self.angle else 1.0)
        return [advance(self.start, distance * number / count, angle * number / count)
                for number in range(1, count + 1)]

    @property
    def _seen_angle(self) -> float:
        if abs(self.angle) <= ROUNDS:
            return self.angle
        # What counts of the rounds after the first is where they end.
        return math.copysign(math.tau, self.angle) + math.fmod(self.angle, math.tau)


def arc_segments(plan: Plan) -> list[ArcSegment]:
    """
    Return the path of a plan in pieces of constant curvature, in order.

    :param plan: the plan
    """
    pieces = []
    start = ORIGIN
    for step in plan.steps:
        for segment in step.step.path():
            pieces.append(ArcSegment(start, segment.length, segment.angle))
            start = advance(start, segment.length, segment.angle)
        start = step.pose  # the same, but for rounding
    return pieces


def polyline(paths: Iterable[ArcSegment], grain: float) -> list[Point]:
    """
    Return the line through all paths.

    :param paths: the paths, one after the other
    :param grain: the smallest thing that can be seen [m]
    :returns: its points, beginning where the first path does; where it was thinned out, with gaps
        of NaN
    """
    points: list[Point] = []
    for path in paths:
        points += [] if points else [(path.start.x, path.start.y)]
        points += path.points()
    if len(points) <= MANY_POINTS:
        return points or [(ORIGIN.x, ORIGIN.y)]
    thinned = _unlike(points, grain)
    while len(thinned) > MAX_POINTS:
        grain *= 2.0
        thinned = _unlike(points, grain)
    return thinned


def _unlike(points: Sequence[Point], grain: float) -> list[Point]:
    # Each line once: an hour of squares looks like one of them.
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
    return kept


def distinct(poses: Iterable[Pose], grain: float, most: int) -> list[Pose]:
    """
    Return the poses that look different.

    :param poses: the poses, in order
    :param grain: the smallest thing that can be seen [m]
    :param most: how many there may be
    :returns: one of each kind, in order; if there are too many, some evenly from all
    """
    kinds: dict[tuple[int, int, int], Pose] = {}
    for pose in poses:
        heading = round(math.degrees(pose.theta)) % 360
        kinds.setdefault((round(pose.x / grain), round(pose.y / grain), heading), pose)
    kept = list(kinds.values())
    if len(kept) <= most:
        return kept
    return [kept[number * (len(kept) - 1) // (most - 1)] for number in range(most)]


#: How far two poses of a way are apart, at least one of both [m], [rad]: what can be seen.
SPACING = 0.01
TURN = math.radians(4.0)


class PoseHistory:
    """
    The way of a robot, in poses that are some way apart; pure, and never longer than it may be.

    When it is full, every second pose goes and the others are twice as far apart from then on.
    """

    def __init__(self, most: int, keep: Callable[[Pose], Any]) -> None:
        """
        Begin nowhere.

        :param most: how many poses it may have, two at least
        :param keep: turns a pose into what is kept of it; called but once for each
        """
        self._most = most
        self._keep = keep
        self._last: Pose | None = None
        self._spacing, self._turn = SPACING, TURN
        #: what is kept, in order
        self.kept: list[Any] = []

    def add(self, pose: Pose) -> bool:
        """
        Take note of where the robot is.

        :param pose: where; a heading may be wrapped
        :returns: whether it was far enough from the pose before to be kept
        """
        if not math.isfinite(pose.x + pose.y + pose.theta):
            return False
        if self._last is not None and not self._is_apart(self._last, pose):
            return False
        if len(self.kept) >= self._most:
            del self.kept[1::2]
            self._spacing, self._turn = 2.0 * self._spacing, 2.0 * self._turn
        self._last = pose
        self.kept.append(self._keep(pose))
        return True

    def _is_apart(self, one: Pose, two: Pose) -> bool:
        turned = abs(math.remainder(two.theta - one.theta, math.tau))
        distance = math.hypot(two.x - one.x, two.y - one.y)
        return distance >= self._spacing or turned >= min(self._turn, math.pi / 2.0)


#: So many poses at most, where nobody says another number.
MAX_POSES = 2000


def sample_path(plan: Plan, start: Pose = ORIGIN, most: int = MAX_POSES) -> list[Pose]:
    """
    Return where a plan goes.

    :param plan: the plan
    :param start: where the robot is at t = 0
    :param most: how many poses there may be, two at least
    :returns: poses from the start to the end; on curves so many that they look round
    """
    if len(plan.steps) >= most:
        ends = [ORIGIN, *(stage.pose for stage in plan.steps)]
        return [compose(start, pose) for pose in _some(ends, most)]
    paths = arc_segments(plan)
    # Were they all of one length, none would be without its end.
    coarseness = max(1.0, sum(path.count for path in paths) / most)
    poses = [ORIGIN]
    for path in paths:
        poses += path.poses(math.ceil(path.count / coarseness))
    return [compose(start, pose) for pose in _some(poses, most)]


def _some(poses: list[Pose], most: int) -> list[Pose]:
    if len(poses) <= most:
        return poses
    return [poses[number * (len(poses) - 1) // (most - 1)] for number in range(most)]


#: Plain CDR, little-endian; what is aligned is so from behind these bytes.
ENCAPSULATION = b'\x00\x01\x00\x00'
#: The position and the orientation of a pose: seven doubles.
NUMBERS = struct.Struct('<7d')
STAMP = struct.Struct('<iI')
LENGTH = struct.Struct('<I')
DOUBLE = 8


class PathSerializer:
    """Packs poses, and paths of packed poses, in one frame."""

    def __init__(self, frame: str) -> None:
        """
        Pack nothing yet.

        :param frame: the frame of all poses
        """
        name = frame.encode() + b'\x00'
        self._frame = LENGTH.pack(len(name)) + name
        #: from the start of a pose that is aligned like a double to its numbers
        self._gap = _padding(STAMP.size + len(self._frame), DOUBLE)

    def pose(self, pose: Pose, time: int = 0) -> bytes:
        """
        Pack a pose.

        :param pose: the pose
        :param time: when the robot is there [ns of ROS time]; 0 where that is not known
        :returns: it, as a path takes it
        """
        half = pose.theta / 2.0
        numbers = NUMBERS.pack(pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))
        return _stamp(time) + self._frame + self._gap + numbers

    def path(self, poses: Sequence[bytes], time: int) -> bytes:
        """
        Pack a path.

        :param poses: its poses, packed
        :param time: when it was so [ns of ROS time]
        :returns: the message
        """
        head = _stamp(time) + self._frame
        head += _padding(len(head), LENGTH.size) + LENGTH.pack(len(poses))
        if not poses:
            return ENCAPSULATION + head
        # The first pose may begin elsewhere than the others, between two places for doubles.
        head += _stamp_of(poses[0]) + self._frame
        head += _padding(len(head), DOUBLE) + poses[0][-NUMBERS.size:]
        return b''.join((ENCAPSULATION, head, *poses[1:]))


def _stamp(time: int) -> bytes:
    return STAMP.pack(*divmod(time, 1_000_000_000))


def _stamp_of(pose: bytes) -> bytes:
    return pose[:STAMP.size]


def _padding(length: int, alignment: int) -> bytes:
    return b'\x00' * (-length % alignment)
