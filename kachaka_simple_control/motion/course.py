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
"""One step under limits: how long it takes, where it goes, and its velocities at a rate."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Protocol

from kachaka_simple_control.motion.kinematics import Velocity
from kachaka_simple_control.motion.profile import Profile
from kachaka_simple_control.motion.way import Way

#: A last tick shorter than this part of a period is rounding, not a tick.
SLIVER = 1e-9


class Course(Protocol):
    """What the planner needs of a step."""

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""

    def ticks(self, rate: float) -> int:
        """
        Return in how many parts of equal length it is sent, each with its own velocity.

        :param rate: how often a velocity is sent [Hz]
        :returns: the number of parts; 0 if it takes no time
        """

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return what is sent.

        :param rate: how often a velocity is sent [Hz]
        :returns: a velocity for each part
        """


@dataclass(frozen=True)
class Held:
    """
    One velocity, held for a time.

    :param velocity: the velocity
    :param duration: how long it is held [s]
    """

    velocity: Velocity
    duration: float

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""
        return self.velocity.linear_x * self.duration

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""
        return self.velocity.angular_z * self.duration

    def ticks(self, rate: float) -> int:  # noqa: ARG002
        """
        Return 1, or 0 if it takes no time: whoever plays it repeats the velocity at the rate.

        :param rate: how often a velocity is sent [Hz]
        :returns: the number of parts
        """
        return 1 if self.duration else 0

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return the velocity, once.

        :param rate: how often a velocity is sent [Hz]
        :returns: a velocity for each part
        """
        return [self.velocity] * self.ticks(rate)


@dataclass(frozen=True)
class Driven:
    """
    A path, from rest to rest, along a profile.

    :param way: the path
    :param profile: how it is driven
    """

    way: Way
    profile: Profile

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""
        return self.profile.duration

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""
        return self.way.length

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""
        return self.way.angle

    def ticks(self, rate: float) -> int:
        """
        Return in how many parts of equal length it is sent: none longer than a period.

        :param rate: how often a velocity is sent [Hz]
        :returns: the number of parts; 0 if it takes no time
        """
        if not self.duration:
            return 0
        return max(1, math.ceil(self.duration * rate * (1.0 - SLIVER)))

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return what is sent: in each part the mean of the profile over it.

        :param rate: how often a velocity is sent [Hz]
        :returns: a velocity for each part
        """
        count = self.ticks(rate)
        if not count:
            return []
        linear, angular, top = self.way.linear, self.way.angular, self.profile.velocity
        # A cruise is one velocity many times over, and one object.
        cruising = Velocity(linear * top, angular * top)
        return [
            cruising if mean == top else Velocity(linear * mean, angular * mean)
            for mean in self.profile.means(count)]
