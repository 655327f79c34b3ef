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

``time_optimal_profile()`` plans a path from rest to rest.

The unit u of a path is the metre, or the radian for a turn in place.  For a step that holds a
velocity for a time, u is the second, and a position is the planned time since the start of the
path.  In comments, a number in round brackets, such as (2), is the number of a formula in
docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError


class PathState(NamedTuple):
    """
    Position, velocity and acceleration along a path.

    The unit u of the path is the metre, or the radian for a turn in place.  For a step that holds
    a velocity for a time, u is the second.  The position is then the planned time since the start
    of the path.  The velocity is the planned time that passes in each second: 1 as planned, and
    0.5 if the motion is slowed down to half its speed.

    :param position: the distance from the start of the path [u]
    :param velocity: the velocity along the path [u/s], not negative
    :param acceleration: the acceleration along the path [u/s^2]
    """

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


class PathLimits(NamedTuple):
    """
    The limits along a path segment; each is positive or infinite.

    The unit u of the segment is the metre, or the radian for a turn in place.  For a step that
    holds a velocity for a time, u is the second, and the velocity is the planned time that passes
    in each second.

    :param velocity: largest velocity [u/s]
    :param acceleration: largest acceleration [u/s^2]
    :param deceleration: largest deceleration [u/s^2]
    :param jerk: largest jerk [u/s^3]
    """

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float


@dataclass(frozen=True)
class Ramp:
    """
    A rise of the velocity from rest to a given velocity.

    The acceleration rises to its largest value, stays there for a time that can be zero, and falls
    to zero.  The unit u is m or rad.

    :param velocity: the velocity at the end [u/s]
    :param acceleration: the largest acceleration [u/s^2]; 0 if the duration is 0
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
        """
        Return the distance that is covered during the velocity ramp [m or rad].

        See formula (2) of docs/theory.md.
        """
        return self.velocity * self.duration / 2.0

    def state_at(self, time: float) -> PathState:
        """
        Return the position, velocity and acceleration at a time of the velocity ramp.

        See formulas (3) and (4) of docs/theory.md.

        :param time: the time since the start of the ramp [s], from 0 to the duration
        """
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
        """
        Return the distance driven at a time of the velocity ramp [m or rad].

        See formula (3) of docs/theory.md.

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

    def means(self, part: float, count: int) -> list[float]:
        """
        Return the mean velocity in each of several equal time parts of a ramp [m/s or rad/s].

        The ramp is a rise of the velocity from rest.

        :param part: the duration of each part [s]; the first part starts with the ramp
        :param count: the number of parts; together they must not be longer than the ramp, except
            for rounding
        """
        times = [index * part for index in range(count + 1)]
        times[-1] = min(times[-1], self.duration)
        positions = [self.state_at(time).position for time in times]
        return [(after - before) / part for before, after in pairwise(positions)]


def ramp(velocity: float, acceleration: float, jerk: float) -> Ramp:
    """
    Return the fastest rise of the velocity from rest to a given velocity.

    If ``acceleration`` and ``jerk`` are both infinite, the duration of the rise is 0.  The unit u
    is m or rad.

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
    The velocity over time from rest to rest: a ramp up, a constant velocity, and a ramp down.

    The two ramps can differ.  The velocity is zero before and after the profile.  If some
    limits are infinite, the velocity can jump.  At the time of a jump, ``state_at()`` returns the
    velocity after the jump.  The unit u is m or rad.

    :param distance: the distance that is covered [u], not negative
    :param rise: the ramp up
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
        """
        Return the position, velocity and acceleration at a time of the velocity profile.

        See formula (5) of docs/theory.md.

        :param time: the time since the start of the profile [s].  It can be negative, and it can
            be after the end of the profile
        """
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
        Return the mean velocity in each of several equal time parts of the velocity profile.

        :param count: the number of parts, 1 or more
        :returns: the mean velocities [m/s or rad/s].  They keep the limits of velocity,
            acceleration and jerk.  Their sum times the duration of one part is the distance of the
            profile.  See formulas (11) and (12) of docs/theory.md
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
        """
        Return the mean velocity in one time part of the velocity profile [m/s or rad/s].

        See formula (11) of docs/theory.md.

        :param start: the start of the time part, since the start of the profile [s]
        :param part: the duration of the time part [s]
        """
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
    Return the fastest velocity profile that covers a distance from rest to rest.

    Each limit is positive and may be infinite.  The unit u is m or rad.

    :param distance: the distance [u], finite, not negative
    :param velocity: the largest velocity [u/s]
    :param acceleration: the largest acceleration [u/s^2]
    :param deceleration: the largest deceleration [u/s^2]
    :param jerk: the largest rate of change of acceleration and deceleration [u/s^3]
    :returns: the profile; if the distance is 0, its duration is 0
    :raises InvalidMotionError: if all four limits are infinite, because the profile would take no
        time
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
    Return the peak velocity when a distance is driven as fast as possible, from rest to rest.

    The velocity itself has no limit.  See formulas (6) to (10) of docs/theory.md.  The unit u is m
    or rad.

    :param distance: the distance [u]
    :param acceleration: the largest acceleration [u/s^2]
    :param deceleration: the largest deceleration [u/s^2]
    :param jerk: the largest rate of change of acceleration and deceleration [u/s^3]
    :returns: the peak velocity [u/s]; infinite if all three limits are infinite
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
