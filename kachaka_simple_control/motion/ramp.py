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
"""From rest to a velocity, as quickly as acceleration and jerk allow."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
import math


@dataclass(frozen=True)
class Ramp:
    """
    A rise from rest to a velocity: the acceleration grows, may be held, and fades.

    Units are those of the path, here called u: metres or radians.  The numbers in brackets are
    those of the formulas in docs/theory.md.

    :param velocity: what it rises to [u/s]
    :param acceleration: the largest acceleration on the way [u/s^2]; 0 if there is no way
    :param easing: how long the acceleration takes to grow, and again to fade [s]
    :param duration: how long all of it takes [s]
    """

    velocity: float
    acceleration: float
    easing: float
    duration: float

    @property
    def distance(self) -> float:
        """Return how far it goes [u] (2)."""
        return self.velocity * self.duration / 2.0

    def position_at(self, time: float) -> float:
        """
        Return how far it has gone.

        :param time: since it began [s], from 0 to its duration
        :returns: the distance [u] (3)
        """
        easing, acceleration = self.easing, self.acceleration
        if time < easing:
            return acceleration * time * time * time / (6.0 * easing)
        left = self.duration - time
        if left < easing:
            fading = acceleration * left * left * left / (6.0 * easing)
            return self.velocity * (self.duration / 2.0 - left) + fading
        held = time - easing
        return acceleration * (easing * easing / 6.0 + (easing + held) * held / 2.0)

    def velocity_at(self, time: float) -> float:
        """
        Return how fast it is.

        :param time: since it began [s], from 0 to its duration
        :returns: the velocity [u/s] (4)
        """
        if time < self.easing:
            return self.acceleration * time * time / (2.0 * self.easing)
        left = self.duration - time
        if left < self.easing:
            return self.velocity - self.acceleration * left * left / (2.0 * self.easing)
        return self.acceleration * (time - self.easing / 2.0)

    def acceleration_at(self, time: float) -> float:
        """
        Return how quickly it gets faster.

        :param time: since it began [s], from 0 to its duration
        :returns: the acceleration [u/s^2] (4)
        """
        nearest = min(time, self.duration - time)
        return self.acceleration * (nearest / self.easing if nearest < self.easing else 1.0)

    def means(self, part: float, count: int) -> list[float]:
        """
        Return the mean velocity in each of some equal parts of the time, from the beginning.

        :param part: how long each is [s]
        :param count: how many of them; they end within the ramp, but for rounding
        :returns: the means [u/s]
        """
        times = [index * part for index in range(count + 1)]
        times[-1] = min(times[-1], self.duration)
        places = [self.position_at(time) for time in times]
        return [(after - before) / part for before, after in pairwise(places)]


def ramp(velocity: float, acceleration: float, jerk: float) -> Ramp:
    """
    Return the quickest ramp to a velocity.

    :param velocity: what to rise to [u/s], finite, not negative
    :param acceleration: the largest acceleration [u/s^2], positive; may be infinite
    :param jerk: the largest change of the acceleration [u/s^3], positive; may be infinite
    :returns: the ramp; with neither limit it takes no time
    """
    peak = min(acceleration, math.sqrt(velocity * jerk) if velocity else 0.0)  # (2)
    if peak in (0.0, math.inf):
        return Ramp(velocity, 0.0, 0.0, 0.0)
    easing = peak / jerk
    return Ramp(velocity, peak, easing, velocity / peak + easing)  # (2)
