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

    The unit u is the unit of the path: metre or radian.  The numbers in round brackets refer to
    the formulas in docs/theory.md.

    :param velocity: the velocity at the end [u/s]
    :param acceleration: the largest acceleration [u/s^2]; 0 for a duration of zero
    :param easing: the time in which the acceleration rises, and also the time in which it falls
        [s]
    :param duration: the duration of the whole ramp [s]
    """

    velocity: float
    acceleration: float
    easing: float
    duration: float

    @property
    def distance(self) -> float:
        """Return the distance covered by the whole ramp [u] (2)."""
        return self.velocity * self.duration / 2.0

    def position_at(self, time: float) -> float:
        """
        Return the distance covered at a time [u] (3).

        :param time: the time since the start of the ramp [s], from 0 to the duration
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

        :param time: the time since the start of the ramp [s], from 0 to the duration
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

        :param time: the time since the start of the ramp [s], from 0 to the duration
        """
        nearest = min(time, self.duration - time)
        return self.acceleration * (nearest / self.easing if nearest < self.easing else 1.0)

    def means(self, part: float, count: int) -> list[float]:
        """
        Return the mean velocity in each of several equal time parts from the start [u/s].

        :param part: the duration of each part [s]
        :param count: the number of parts; together they end within the ramp, except for rounding
        """
        times = [index * part for index in range(count + 1)]
        times[-1] = min(times[-1], self.duration)
        positions = [self.position_at(time) for time in times]
        return [(after - before) / part for before, after in pairwise(positions)]


def ramp(velocity: float, acceleration: float, jerk: float) -> Ramp:
    """
    Return the fastest ramp to a velocity; with infinite limits its duration is zero.

    :param velocity: the velocity at the end [u/s], finite, not negative
    :param acceleration: the largest acceleration [u/s^2], positive; may be infinite
    :param jerk: the largest rate of change of the acceleration [u/s^3], positive; may be infinite
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

    The velocity is zero before and after the profile.  At a jump, the velocity has the value
    after the jump.  The unit u is the unit of the path: metre or radian.  The numbers in round
    brackets refer to the formulas in docs/theory.md.

    :param distance: the distance [u], not negative
    :param rise: the ramp up
    :param cruise: the time of constant velocity [s]
    :param fall: the ramp down, given as a ramp up with the time reversed
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
        """Return the duration of the profile [s]."""
        return self.rise.duration + self.cruise + self.fall.duration

    def position_at(self, time: float) -> float:
        """
        Return the distance covered at a time [u] (5).

        :param time: the time since the start [s]; before the start and after the end are allowed
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

        :param time: the time since the start [s]; before the start and after the end are allowed
        """
        left = self.duration - time
        if time < 0.0 or left <= 0.0:
            return 0.0
        if time < self.rise.duration:
            return self.rise.velocity_at(time)
        return self.fall.velocity_at(left) if left < self.fall.duration else self.velocity

    def acceleration_at(self, time: float) -> float:
        """
        Return the acceleration at a time [u/s^2]; jumps of the velocity are ignored.

        :param time: the time since the start [s]; before the start and after the end are allowed
        """
        left = self.duration - time
        if time < 0.0 or left <= 0.0:
            return 0.0
        if time < self.rise.duration:
            return self.rise.acceleration_at(time)
        return -self.fall.acceleration_at(left) if left < self.fall.duration else 0.0

    def means(self, count: int) -> list[float]:
        """
        Return the mean velocity in each of several equal time parts.

        :param count: the number of parts, 1 or more
        :returns: the means [u/s] (11); they keep the limits (12), and their sum times the
            duration of a part is the distance
        """
        part = self.duration / count
        rise, fall = self.rise.duration / part, self.fall.duration / part
        # Equal parts are the same counted from the end, so a fall is a rise in reverse order.
        rising, falling = math.floor(rise), math.floor(fall)
        first, last = math.ceil(rise), count - math.ceil(fall)
        if first >= last:  # no part lies within the cruise
            first = last = rising
        means = [
            *self.rise.means(part, rising),
            *(self._mean(index * part, part) for index in range(rising, first)),
            # The cruise velocity is copied, not computed, so there is no rounding.
            *[self.velocity] * (last - first),
            *(self._mean(index * part, part) for index in range(last, count - falling)),
            *reversed(self.fall.means(part, falling))]
        # Rounding must not raise a mean above the limit.
        return [min(mean, self.velocity) for mean in means]

    def _mean(self, start: float, part: float) -> float:
        """Return the mean velocity in one time part that starts at a time (11)."""
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
    Return the fastest profile over a distance; each limit is positive and may be infinite.

    :param distance: the distance [u], finite, not negative
    :param velocity: the largest velocity [u/s]
    :param acceleration: the largest acceleration [u/s^2]
    :param deceleration: the largest deceleration [u/s^2]
    :param jerk: the largest rate of change of acceleration and deceleration [u/s^3]
    :returns: the profile; over a distance of zero its duration is zero
    :raises InvalidMotionError: if all four limits are infinite: the profile would take no time
    """
    peak = min(velocity, _unlimited_peak(distance, acceleration, deceleration, jerk))
    if peak == math.inf:
        raise InvalidMotionError('nothing limits the velocity; set a speed or a limit')
    rise, fall = ramp(peak, acceleration, jerk), ramp(peak, deceleration, jerk)
    # Over a distance of zero the peak is zero too, unless the velocity may jump.
    cruise = (distance - rise.distance - fall.distance) / peak if peak else 0.0
    return VelocityProfile(distance, rise, max(0.0, cruise), fall)


def _unlimited_peak(
        distance: float, acceleration: float, deceleration: float, jerk: float) -> float:
    """Return the peak velocity of a profile with two ramps and no cruise (6)."""
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
