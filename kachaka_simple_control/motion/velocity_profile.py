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
"""
S-curves: the fastest velocities along a path under limits of velocity, acceleration and jerk.

The unit u is that of the path segment: m, or rad for a turn in place.  Numbers in brackets, such
as (2), are those of formulas in docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError


class PathState(NamedTuple):
    """Position, velocity and acceleration along a path [u, u/s, u/s^2]."""

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


class PathLimits(NamedTuple):
    """The limits along a path segment [u/s, u/s^2, u/s^2, u/s^3]; each is positive or infinite."""

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float


@dataclass(frozen=True)
class Ramp:
    """
    A rise of the velocity from rest to a given velocity.

    The acceleration rises, stays for a time that can be zero, and falls to zero.

    :param acceleration: the largest acceleration [u/s^2]; 0 if the duration is 0
    :param easing: how long the acceleration rises, and also how long it falls [s]
    """

    velocity: float
    acceleration: float
    easing: float
    duration: float

    @property
    def distance(self) -> float:
        """Return the distance that is covered during the ramp [u]: (2)."""
        return self.velocity * self.duration / 2.0

    def state_at(self, time: float) -> PathState:
        """Return the state at a time from 0 to the duration [s]: (3) and (4)."""
        easing, acceleration, position = self.easing, self.acceleration, self.position_at(time)
        if time < easing:
            return PathState(
                position, acceleration * time * time / (2.0 * easing),
                acceleration * (time / easing))
        left = self.duration - time
        if left < easing:
            return PathState(
                position, self.velocity - acceleration * left * left / (2.0 * easing),
                acceleration * (left / easing))
        return PathState(position, acceleration * (time - easing / 2.0), acceleration)

    def position_at(self, time: float) -> float:
        """Return the distance driven at a time from 0 to the duration [s]: (3)."""
        easing, acceleration = self.easing, self.acceleration
        if time < easing:
            return acceleration * time * time * time / (6.0 * easing)
        left = self.duration - time
        if left < easing:
            fading = acceleration * left * left * left / (6.0 * easing)
            return self.velocity * (self.duration / 2.0 - left) + fading
        held = time - easing
        return acceleration * (easing * easing / 6.0 + (easing + held) * held / 2.0)

    def means(self, part: float, count: int) -> list[float]:
        """
        Return the mean velocity in each of some equal time parts, which lie within the ramp [u/s].

        :param part: the duration of each part [s]
        """
        times = [index * part for index in range(count + 1)]
        times[-1] = min(times[-1], self.duration)
        positions = [self.state_at(time).position for time in times]
        return [(after - before) / part for before, after in pairwise(positions)]


def ramp(velocity: float, acceleration: float, jerk: float) -> Ramp:
    """
    Return the fastest rise of the velocity from rest to a given velocity.

    :param acceleration: the largest one [u/s^2]; may be infinite
    :param jerk: the largest one [u/s^3]; may be infinite; without both, the rise takes no time
    """
    peak = min(acceleration, math.sqrt(velocity * jerk) if velocity else 0.0)  # (2)
    if peak in (0.0, math.inf):
        return Ramp(velocity, 0.0, 0.0, 0.0)
    easing = peak / jerk
    return Ramp(velocity, peak, easing, velocity / peak + easing)  # (2)


@dataclass(frozen=True)
class VelocityProfile:
    """
    The velocity over time from rest to rest: a ramp up, a constant velocity, and a ramp down.

    If some limits are infinite, the velocity can jump; ``state_at()`` returns the one after it.

    :param distance: the distance that is covered [u], not negative
    :param cruise: the duration of the part with constant velocity [s]
    :param fall: the ramp down in reverse time order, so that it is a ramp up from rest
    """

    distance: float
    rise: Ramp
    cruise: float
    fall: Ramp

    @property
    def velocity(self) -> float:
        """Return the largest velocity of the velocity profile [m/s or rad/s]."""
        return self.rise.velocity

    @property
    def duration(self) -> float:
        """Return the duration of the velocity profile [s]."""
        return self.rise.duration + self.cruise + self.fall.duration

    def state_at(self, time: float) -> PathState:
        """Return the state at any time since the start of the profile [s]: (5)."""
        left = self.duration - time
        if time < 0.0 or left <= 0.0:
            return PathState(0.0 if time < 0.0 else self.distance)
        if time < self.rise.duration:
            return self.rise.state_at(time)
        if left < self.fall.duration:
            position, velocity, acceleration = self.fall.state_at(left)
            return PathState(self.distance - position, velocity, -acceleration)
        return PathState(
            self.rise.distance + self.velocity * (time - self.rise.duration), self.velocity)

    def means(self, count: int) -> list[float]:
        """
        Return the mean velocity in each of some equal time parts [u/s]: (11) and (12).

        They keep all limits, and their sum times the duration of a part is the distance.
        """
        part = self.duration / count
        rise, fall = self.rise.duration / part, self.fall.duration / part
        # Equal parts are the same when counted from the end: a fall is a rise in reverse order.
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
        """Return the mean velocity in one time part [u/s]: (11)."""
        times = (start, start + part)
        rise, fall, top = self.rise, self.fall, self.rise.duration
        up = [rise.state_at(min(time, top)).position for time in times]
        along = [min(max(0.0, time - top), self.cruise) for time in times]
        left = [min(max(0.0, self.duration - time), fall.duration) for time in times]
        down = [fall.state_at(time).position for time in left]
        return (up[1] - up[0] + self.velocity * (along[1] - along[0]) + down[0] - down[1]) / part


def time_optimal_profile(
        distance: float, velocity: float, acceleration: float = math.inf,
        deceleration: float = math.inf, jerk: float = math.inf) -> VelocityProfile:
    """
    Return the fastest velocity profile that covers a distance [u] from rest to rest.

    :param acceleration: [u/s^2], as the deceleration; any limit may be infinite
    :param jerk: the largest rate of change of acceleration and deceleration [u/s^3]
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
    """
    Return the peak velocity over a distance from rest to rest without a limit of its own.

    See (6) to (10); infinite if all three limits are infinite.
    """
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
