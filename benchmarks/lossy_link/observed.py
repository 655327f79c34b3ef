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
"""What reached the robot and what it did, from what it said of itself; pure."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
import math
from typing import Any, NamedTuple


class Told(NamedTuple):
    """
    A velocity that reached the robot.

    :param time: when [s, steady clock]
    :param linear_x: forward [m/s]
    :param angular_z: to the left [rad/s]
    :param taken: whether manual control was on; if not, the bridge has switched it on
    """

    time: float
    linear_x: float
    angular_z: float
    taken: bool

    @property
    def moves(self) -> bool:
        """Whether it asks for motion."""
        return self.linear_x != 0.0 or self.angular_z != 0.0


class Switched(NamedTuple):
    """
    Manual control was switched.

    :param time: when [s, steady clock]
    :param enabled: on or off
    """

    time: float
    enabled: bool


class Seen(NamedTuple):
    """
    Where the robot was.

    :param time: when [s, steady clock]
    :param x: forward of where it began [m]
    :param y: left of where it began [m]
    :param theta: turned to the left since then [rad], counting whole turns
    """

    time: float
    x: float
    y: float
    theta: float


class Log:
    """All that a robot said, in order of time; another thread may be adding to it."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.told: list[Told] = []
        self.switched: list[Switched] = []
        self.seen: list[Seen] = []
        self.is_ready = False

    def add(self, said: Sequence[Any]) -> None:
        """
        Take note.

        :param said: what it said: the kind, the time, and the rest
        """
        kind, *rest = said
        if kind == 'velocity':
            self.told.append(Told(*rest))
        elif kind == 'manual control':
            self.switched.append(Switched(*rest))
        elif kind == 'pose':
            self.seen.append(Seen(*rest))
        self.is_ready = self.is_ready or kind == 'ready'

    def told_from(self, begin: float) -> list[Told]:
        """
        Return what reached the robot.

        :param begin: from when on [s]
        :returns: the velocities
        """
        return [told for told in self.told if told.time >= begin]

    def motions_from(self, begin: float) -> list[Told]:
        """
        Return the velocities that asked for motion.

        :param begin: from when on [s]
        :returns: the velocities
        """
        return [told for told in self.told_from(begin) if told.moves]

    def enabled_from(self, begin: float) -> list[Switched]:
        """
        Return how often manual control was switched on.

        :param begin: from when on [s]
        :returns: the times
        """
        return [one for one in self.switched if one.time >= begin and one.enabled]

    def at(self, time: float) -> Seen:
        """
        Return where the robot was.

        :param time: when [s]
        :returns: its place, in a straight line between two that it told
        """
        seen = self.seen or [Seen(time, 0.0, 0.0, 0.0)]
        place = bisect_right([one.time for one in seen], time)
        one, two = seen[max(place - 1, 0)], seen[min(place, len(seen) - 1)]
        part = (time - one.time) / (two.time - one.time) if two.time > one.time else 0.0
        return Seen(time, *(a + part * (b - a) for a, b in zip(one[1:], two[1:])))

    def driven(self, begin: float, end: float = math.inf) -> tuple[float, float]:
        """
        Return how far the robot got.

        :param begin: from when on [s]
        :param end: until when [s]
        :returns: how far away it is in the end [m], and by how much it has turned [rad], to the
            left positive
        """
        one = self.at(begin)
        two = self.at(end) if end < math.inf else (self.seen[-1] if self.seen else one)
        return math.hypot(two.x - one.x, two.y - one.y), two.theta - one.theta

    def still_from(self, begin: float, end: float) -> float:
        """
        Return since when the robot stood still.

        :param begin: not before this time [s]
        :param end: when it is looked at [s]
        :returns: when it was last seen in another place before, or ``begin`` [s]
        """
        return max([begin, *(seen.time for seen in self.seen if seen.time <= end)])


def after_stop(log: Log, began: float) -> dict[str, Any]:
    """
    Judge a stop.

    :param log: what the robot said, until now
    :param began: when the program was told to stop [s]
    :returns: how many zeros reached the robot, after how long the first [s], how many motion
        commands came after it, and how far the robot drove since ``began`` [m]
    """
    since = log.told_from(began)
    zeros = [told.time for told in since if not told.moves]
    first = zeros[0] if zeros else math.inf
    return {
        'zeros': len(zeros),
        'first': first - began if zeros else None,
        'motions': sum(told.moves and told.time > first for told in since),
        'driven': log.driven(began)[0]}
