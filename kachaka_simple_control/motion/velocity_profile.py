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
"""Time-optimal S-curve from rest to rest under velocity, acceleration and jerk limits."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
import math

from kachaka_simple_control.errors import InvalidMotionError


@dataclass(frozen=True)
class Ramp:
    """
    A rise from rest to a velocity: the acceleration rises, may be held, and falls.

    Units are those of the path, here called u: metres or radians.  The numbers in brackets are
    those of the formulas in docs/theory.md.

    :param velocity: the velocity at its end [u/s]
    :param acceleration: the largest acceleration [u/s^2]; 0 if it takes no time
    :param easing: how long the acceleration takes to rise, and again to fall [s]
    :param duration: how long the whole takes [s]
    """

    velocity: float
    acceleration: float
    easing: float
    duration: float

    @property
    def distance(self) -> float:
        """Return the distance [u] (2)."""
        return self.velocity * self.duration / 2.0

    def position_at(self, time: float) -> float:
        """
        Return the distance at a time [u] (3).

        :param time: since it began [s], from 0 to its duration
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
        Return the velocity at a time [u/s] (4).

        :param time: since it began [s], from 0 to its duration
        """
        if time < self.easing:
            return self.acceleration * time * time / (2.0 * self.easing)
        left = self.duration - time
        if left < self.easing:
            return self.velocity - self.acceleration * left * left / (2.0 * self.easing)
        return self.acceleration * (time - self.easing / 2.0)

    def acceleration_at(self, time: float) -> float:
        """
        Return the acceleration at a time [u/s^2] (4).

        :param time: since it began [s], from 0 to its duration
        """
        nearest = min(time, self.duration - time)
        return self.acceleration * (nearest / self.easing if nearest < self.easing else 1.0)

    def means(self, part: float, count: int) -> list[float]:
        """
        Return the mean velocity in each of some equal parts of the time, from the beginning [u/s].

        :param part: how long each is [s]
        :param count: how many of them; they end within the ramp, but for rounding
        """
        times = [index * part for index in range(count + 1)]
        times[-1] = min(times[-1], self.duration)
        positions = [self.position_at(time) for time in times]
        return [(after - before) / part for before, after in pairwise(positions)]


def ramp(velocity: float, acceleration: float, jerk: float) -> Ramp:
    """
    Return the quickest ramp to a velocity; without a limit it takes no time.

    :param velocity: at its end [u/s], finite, not negative
    :param acceleration: the largest acceleration [u/s^2], positive; may be infinite
    :param jerk: the largest change of the acceleration [u/s^3], positive; may be infinite
    """
    peak = min(acceleration, math.sqrt(velocity * jerk) if velocity else 0.0)  # (2)
    if peak in (0.0, math.inf):
        return Ramp(velocity, 0.0, 0.0, 0.0)
    easing = peak / jerk
    return Ramp(velocity, peak, easing, velocity / peak + easing)  # (2)


@dataclass(frozen=True)
class VelocityProfile:
    """
    A ramp up, a cruise at constant velocity, and a ramp down that may differ from the first.

    The velocity is zero before and after it; where it jumps, its value is the later one.
    Units are those of the path, here called u: metres or radians.  The numbers in brackets are
    those of the formulas in docs/theory.md.

    :param distance: the distance [u], not negative
    :param rise: the ramp up
    :param cruise: how long the velocity is constant [s]
    :param fall: the ramp down: a rise backwards in time
    """

    distance: float
    rise: Ramp
    cruise: float
    fall: Ramp

    @property
    def velocity(self) -> float:
        """Return the largest velocity [u/s]."""
        return self.rise.velocity

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""
        return self.rise.duration + self.cruise + self.fall.duration

    def position_at(self, time: float) -> float:
        """
        Return the distance at a time [u] (5).

        :param time: since it began [s]; before it and after it are allowed
        """
        if time <= 0.0:
            return 0.0
        left = max(0.0, self.duration - time)
        if left <= self.fall.duration:
            return self.distance - self.fall.position_at(left)
        if time < self.rise.duration:
            return self.rise.position_at(time)
        return self.rise.distance + self.velocity * (time - self.rise.duration)

    def velocity_at(self, time: float) -> float:
        """
        Return the velocity at a time [u/s].

        :param time: since it began [s]; before it and after it are allowed
        """
        left = self.duration - time
        if time < 0.0 or left <= 0.0:
            return 0.0
        if time < self.rise.duration:
            return self.rise.velocity_at(time)
        return self.fall.velocity_at(left) if left < self.fall.duration else self.velocity

    def acceleration_at(self, time: float) -> float:
        """
        Return the acceleration at a time [u/s^2], without jumps of the velocity.

        :param time: since it began [s]; before it and after it are allowed
        """
        left = self.duration - time
        if time < 0.0 or left <= 0.0:
            return 0.0
        if time < self.rise.duration:
            return self.rise.acceleration_at(time)
        return -self.fall.acceleration_at(left) if left < self.fall.duration else 0.0

    def means(self, count: int) -> list[float]:
        """
        Return the mean velocity of each of some equal parts of the time.

        :param count: how many parts, 1 or more
        :returns: the means [u/s] (11); they keep the limits (12), and times the length of a part
            they add up to the distance
        """
        part = self.duration / count
        rise, fall = self.rise.duration / part, self.fall.duration / part
        # Equal parts are the same from the end: a fall is a rise in them, backwards.
        rising, falling = math.floor(rise), math.floor(fall)
        first, last = math.ceil(rise), count - math.ceil(fall)
        if first >= last:  # no part lies within the cruise
            first = last = rising
        means = [
            *self.rise.means(part, rising),
            *(self._mean(index * part, part) for index in range(rising, first)),
            # Nothing is computed here, so there is no rounding.
            *[self.velocity] * (last - first),
            *(self._mean(index * part, part) for index in range(last, count - falling)),
            *reversed(self.fall.means(part, falling))]
        # Rounding must not carry a mean beyond the limit.
        return [min(mean, self.velocity) for mean in means]

    def _mean(self, start: float, part: float) -> float:
        """Return one mean, from the distances of rise, cruise and fall in its time (11)."""
        times = (start, start + part)
        rise, fall, top = self.rise, self.fall, self.rise.duration
        up = [rise.position_at(min(time, top)) for time in times]
        along = [min(max(0.0, time - top), self.cruise) for time in times]
        left = [min(max(0.0, self.duration - time), fall.duration) for time in times]
        down = [fall.position_at(time) for time in left]
        return (up[1] - up[0] + self.velocity * (along[1] - along[0]) + down[0] - down[1]) / part


def time_optimal_profile(
        distance: float, velocity: float, acceleration: float = math.inf,
        deceleration: float = math.inf, jerk: float = math.inf) -> VelocityProfile:
    """
    Return the quickest profile over a distance; each limit is positive and may be infinite.

    :param distance: the distance [u], finite, not negative
    :param velocity: the largest velocity [u/s]
    :param acceleration: the largest acceleration [u/s^2]
    :param deceleration: the largest deceleration [u/s^2]
    :param jerk: the largest change of either [u/s^3]
    :returns: the profile; over no distance it takes no time
    :raises InvalidMotionError: if all four limits are infinite, so that it would take no time
    """
    peak = min(velocity, _unlimited_peak(distance, acceleration, deceleration, jerk))
    if peak == math.inf:
        raise InvalidMotionError('nothing limits the velocity; set a speed or a limit')
    rise, fall = ramp(peak, acceleration, jerk), ramp(peak, deceleration, jerk)
    # Over no distance there is no peak either, unless the velocity may jump.
    cruise = (distance - rise.distance - fall.distance) / peak if peak else 0.0
    return VelocityProfile(distance, rise, max(0.0, cruise), fall)


def _unlimited_peak(
        distance: float, acceleration: float, deceleration: float, jerk: float) -> float:
    """Return the velocity at which the two ramps alone make up the distance (6)."""
    if jerk == math.inf:
        slowness = 1.0 / acceleration + 1.0 / deceleration
        return math.sqrt(2.0 * distance / slowness) if slowness else math.inf  # (7)
    low, high = sorted((acceleration, deceleration))
    peak = math.pow(distance, 2.0 / 3.0) * math.pow(jerk / 4.0, 1.0 / 3.0)  # (8)
    if peak * jerk <= low * low:
        return peak
    ease = (low + high) / jerk
    slowness = 1.0 / low + 1.0 / high
    peak = 4.0 * distance / (ease + math.sqrt(ease * ease + 8.0 * slowness * distance))  # (9)
    if peak * jerk >= high * high:
        return peak
    ratio = math.sqrt(2.0 * distance / low) * (jerk / low)
    growth = 2.0 * low * ratio / (1.0 + math.sqrt(1.0 + 4.0 * ratio))
    return growth * growth / jerk  # (10)
