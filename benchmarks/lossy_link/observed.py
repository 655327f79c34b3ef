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
"""Evaluate the reports of a robot: the received velocities, and the driven path."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
import math
from typing import Any, NamedTuple


class ReceivedVelocity(NamedTuple):
    """
    A velocity that reached the robot.

    :param time: the time of arrival [s, steady clock]
    :param linear_x: the forward velocity [m/s]
    :param angular_z: the turning velocity, positive to the left [rad/s]
    :param enabled: whether manual control was enabled before; if not, the bridge enabled it
    """

    time: float
    linear_x: float
    angular_z: float
    enabled: bool

    @property
    def moves(self) -> bool:
        """Return whether the velocity is not zero."""
        return self.linear_x != 0.0 or self.angular_z != 0.0


class ManualControlChange(NamedTuple):
    """A change of manual control, enabled or disabled, at a time [s, steady clock]."""

    time: float
    enabled: bool


class PoseSample(NamedTuple):
    """
    A pose relative to the first one.

    :param time: the time [s, steady clock]
    :param x: the position forward [m]
    :param y: the position to the left [m]
    :param theta: the heading, positive to the left [rad], not wrapped
    """

    time: float
    x: float
    y: float
    theta: float


class RobotLog:
    """All reports of a robot, in order of time; another thread may add reports."""

    def __init__(self) -> None:
        self._velocities: list[ReceivedVelocity] = []
        self._changes: list[ManualControlChange] = []
        self._poses: list[PoseSample] = []
        self.is_ready = False

    def add(self, report: Sequence[Any]) -> None:
        """Add a report: its kind, the time, and the rest."""
        kind, *rest = report
        if kind == 'velocity':
            self._velocities.append(ReceivedVelocity(*rest))
        elif kind == 'manual control':
            self._changes.append(ManualControlChange(*rest))
        elif kind == 'pose':
            self._poses.append(PoseSample(*rest))
        self.is_ready = self.is_ready or kind == 'ready'

    def velocities_since(self, begin: float) -> list[ReceivedVelocity]:
        """Return the velocities that reached the robot at or after a time [s]."""
        return [velocity for velocity in self._velocities if velocity.time >= begin]

    def motions_since(self, begin: float) -> list[ReceivedVelocity]:
        """Return the nonzero velocities that reached the robot at or after a time [s]."""
        return [velocity for velocity in self.velocities_since(begin) if velocity.moves]

    def enabled_since(self, begin: float) -> list[ManualControlChange]:
        """Return the events at or after a time [s] that enabled manual control."""
        return [change for change in self._changes if change.time >= begin and change.enabled]

    def pose_at(self, time: float) -> PoseSample:
        """Return the interpolated pose at a time [s]."""
        poses = self._poses or [PoseSample(time, 0.0, 0.0, 0.0)]
        index = bisect_right([pose.time for pose in poses], time)
        one, two = poses[max(index - 1, 0)], poses[min(index, len(poses) - 1)]
        part = (time - one.time) / (two.time - one.time) if two.time > one.time else 0.0
        return PoseSample(time, *(a + part * (b - a) for a, b in zip(one[1:], two[1:])))

    def driven(self, begin: float, end: float = math.inf) -> tuple[float, float]:
        """Return the distance [m] and the angle [rad, left positive] between two times."""
        one = self.pose_at(begin)
        two = self.pose_at(end) if end < math.inf else (self._poses[-1] if self._poses else one)
        return math.hypot(two.x - one.x, two.y - one.y), two.theta - one.theta

    def at_rest_since(self, begin: float, end: float) -> float:
        """
        Return the time since which the robot is at rest.

        :param begin: the earliest result [s]
        :param end: the time of the check [s]
        :returns: the time of the last new pose before ``end``, or ``begin`` [s]
        """
        return max([begin, *(pose.time for pose in self._poses if pose.time <= end)])


def evaluate_stop(log: RobotLog, begin: float) -> dict[str, Any]:
    """
    Return the results of a stop.

    :param log: the robot's reports
    :param begin: the time of the stop request [s]
    :returns: the number of zeros that reached the robot, the time to the first zero [s], the
        number of motion commands after it, and the distance driven since ``begin`` [m]
    """
    velocities = log.velocities_since(begin)
    zeros = [velocity.time for velocity in velocities if not velocity.moves]
    first = zeros[0] if zeros else math.inf
    return {
        'zeros': len(zeros),
        'first': first - begin if zeros else None,
        'motions': sum(velocity.moves and velocity.time > first for velocity in velocities),
        'driven': log.driven(begin)[0]}
