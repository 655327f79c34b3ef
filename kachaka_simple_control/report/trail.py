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
"""Where a robot went, as few poses."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

from kachaka_simple_control.motion.kinematics import Pose

#: How far two poses of a way are apart, at least one of both [m], [rad]: what can be seen.
SPACING = 0.01
TURN = math.radians(4.0)


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
