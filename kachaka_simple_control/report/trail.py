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
"""Ways as few poses: where a plan goes, and where a robot went."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

from kachaka_simple_control.motion.kinematics import advance, ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.report.track import BEND, Stretch, stretches

#: How far two poses of a way are apart, at least one of both [m], [rad]: what can be seen.
SPACING = 0.01
TURN = math.radians(4.0)
#: From here on rounds in place or on a circle are left out [rad]; nobody sees them.
ROUNDS = 2.0 * math.tau


class Trail:
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


def planned_way(plan: Plan, start: Pose = ORIGIN, most: int = 2000) -> list[Pose]:
    """
    Return where a plan goes.

    :param plan: the plan
    :param start: where the robot is at t = 0
    :param most: how many poses there may be, two at least
    :returns: poses from the start to the end; on curves so many that they look round
    """
    if len(plan.stages) >= most:
        ends = [ORIGIN, *(stage.pose for stage in plan.stages)]
        return [_placed(start, pose) for pose in _some(ends, most)]
    paths = stretches(plan)
    # Were they all of one length, none would be without its end.
    coarseness = max(1.0, sum(map(_count, paths)) / most)
    poses = [ORIGIN]
    for path in paths:
        poses += _along(path, math.ceil(_count(path) / coarseness))
    return [_placed(start, pose) for pose in _some(poses, most)]


def _angle(path: Stretch) -> float:
    if abs(path.angle) <= ROUNDS:
        return path.angle
    return math.copysign(math.tau, path.angle) + math.fmod(path.angle, math.tau)


def _count(path: Stretch) -> int:
    if path.distance == 0.0 and path.angle == 0.0:
        return 0
    return max(1, math.ceil(abs(_angle(path)) / BEND))


def _along(path: Stretch, count: int) -> list[Pose]:
    angle = _angle(path)
    distance = path.distance * (angle / path.angle if path.angle else 1.0)
    return [advance(path.start, distance * number / count, angle * number / count)
            for number in range(1, count + 1)]


def _some(poses: list[Pose], most: int) -> list[Pose]:
    if len(poses) <= most:
        return poses
    return [poses[number * (len(poses) - 1) // (most - 1)] for number in range(most)]


def _placed(start: Pose, pose: Pose) -> Pose:
    """Return a pose as seen from a start as it is seen from where that start is seen from."""
    cos, sin = math.cos(start.theta), math.sin(start.theta)
    return Pose(
        start.x + cos * pose.x - sin * pose.y,
        start.y + sin * pose.x + cos * pose.y,
        start.theta + pose.theta)
