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

``time_optimal_profile()`` plans a path from rest to rest.  ``replan_to_rest()`` and
``replan_through()`` plan the rest of a path again while the robot moves, so that it slows down,
stops or speeds up.

The unit u of a path is the metre, or the radian for a turn in place.  For a step that holds a
velocity for a time, u is the second, and a position is the planned time since the start of the
path.  In comments, a number in round brackets, such as (2), is the number of a formula in
docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError

#: A stop counts as a stop at the end of the path if the remaining part of the path is at most this
#: fraction of its length, because of rounding.
ROUNDING = 1e-12
#: A cruise of at most this fraction of the path's length is left out; it comes from rounding.
CRUISE_ROUNDING = 1e-14
#: How often an interval is halved to find a number in it.  This is enough for the last bit of a
#: float, except for numbers close to zero.
BISECTIONS = 120


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


class Phase(NamedTuple):
    """
    A time interval with a constant jerk.

    The unit u of the path is the metre, or the radian for a turn in place.  For a step that holds
    a velocity for a time, u is the second of planned time.

    :param start: position, velocity and acceleration at the start of the interval
    :param jerk: the rate of change of the acceleration [u/s^3]
    :param duration: the duration of the interval [s]
    """

    start: PathState
    jerk: float
    duration: float

    def state_at(self, time: float) -> PathState:
        """
        Return the position, velocity and acceleration at a time within the phase.

        The phase is a time interval with a constant jerk.

        :param time: the time since the start of the phase [s]
        """
        position, velocity, acceleration = self.start
        return PathState(
            position + time * (velocity + time * (acceleration / 2.0 + time * self.jerk / 6.0)),
            velocity + time * (acceleration + time * self.jerk / 2.0),
            acceleration + time * self.jerk)

    @property
    def end(self) -> PathState:
        """
        Return the position, velocity and acceleration at the end of the phase.

        The phase is a time interval with a constant jerk.
        """
        return self.state_at(self.duration)


@dataclass(frozen=True)
class Replanned:
    """
    A new plan for the rest of a path: to the end of the path, or to a stop before this end.

    :param phases: the time intervals of constant jerk, in order.  If some limits are infinite,
        the velocity can jump from one interval to the next
    :param end: position, velocity and acceleration at the end of the new plan
    """

    phases: tuple[Phase, ...]
    end: PathState

    @cached_property
    def velocity(self) -> float:
        """Return the largest velocity [u/s]."""
        return max((state.velocity for phase in self.phases for state in (phase.start, phase.end)),
                   default=0.0)

    def means(self, count: int) -> list[float]:
        """
        Return the mean velocity in each of several equal time parts [u/s].

        :param count: the number of parts, 1 or more
        """
        part = self.duration / count
        marks = [self.state_at(part * index).position for index in range(count)]
        # Rounding must not raise a mean above the limit, or make it negative.
        return [min(max(0.0, (after - before) / part), self.velocity)
                for before, after in pairwise([*marks, self.end.position])]

    @cached_property
    def duration(self) -> float:
        """Return the duration of the new plan for the rest of the path [s]."""
        return math.fsum(phase.duration for phase in self.phases)

    def state_at(self, time: float) -> PathState:
        """
        Return the position, velocity and acceleration along the path at a time of the new plan.

        :param time: the time since the start of the new plan [s], not negative.  After the end of
            the plan, the result is ``end``
        """
        for phase in self.phases:
            if time < phase.duration:
                return phase.state_at(time)
            time -= phase.duration
        return self.end


def replan_to_rest(
        state: PathState, distance: float, velocity: float, limits: PathLimits) -> Replanned:
    """
    Plan the rest of a path again, so that the robot stops at the end of the path.

    If ``velocity`` is 0, the robot stops as soon as possible instead.  The position along the path
    never decreases.  See formulas (15) and (16) of docs/theory.md.

    :param state: the current position, velocity and acceleration; a stop before the end of the
        path must still be possible
    :param distance: the length of the whole path [u], where u is m or rad
    :param velocity: the wanted velocity [u/s].  It is reached as soon as possible.  If the rest
        of the path is too short for it, a lower velocity is used
    :param limits: the limits of acceleration, deceleration and jerk.  The field ``velocity`` is
        not used
    """
    top = velocity
    left = distance - state.position

    def is_too_fast(top: float) -> bool:
        return _distance_to_rest(state, top, limits) > left

    if velocity and is_too_fast(velocity):
        top = _largest_velocity(state, 0.0, velocity, limits, is_too_fast)
    phases = list(_change_velocity(state, top, limits))
    begin = phases[-1].end.position if phases else state.position
    if top:
        falling = _distance_to_rest(PathState(0.0, top), 0.0, limits)
        cruise = distance - falling - begin
        if cruise > CRUISE_ROUNDING * distance:
            phases.append(Phase(PathState(begin, top), 0.0, cruise / top))
            begin += cruise
        phases += _change_velocity(PathState(begin, top), 0.0, limits)
    is_end = velocity or begin >= distance * (1.0 - ROUNDING)
    return Replanned(tuple(phases), PathState(distance if is_end else begin))


def _largest_velocity(
        state: PathState, low: float, high: float, limits: PathLimits,
        is_too_fast: Callable[[float], bool]) -> float:
    """
    Return the largest velocity from which the robot can still slow down within the path.

    The robot first changes to this velocity, and then stops.  See formula (16) of docs/theory.md.

    :param state: the current position, velocity and acceleration along the path
    :param low: the velocity at the end of the path [m/s or rad/s]
    :param high: a velocity that is too large [m/s or rad/s]
    :param limits: the limits of acceleration, deceleration and jerk; their ``velocity`` is not
        used
    :param is_too_fast: whether the path is too short for a velocity
    """
    # The distance is shortest if the acceleration does not change its sign.
    level = _velocity_at_zero_acceleration(state, limits)
    if low < level < high:
        low, high = (low, level) if is_too_fast(level) else (level, high)
    return bisection(low, high, is_too_fast)[0]


def replan_through(
        state: PathState, distance: float, velocity: float, limits: PathLimits) -> Replanned:
    """
    Plan the rest of a path again: change to a velocity, and keep it until the end of the path.

    :param state: the current position, velocity and acceleration
    :param distance: the length of the whole path [u], where u is the metre, the radian, or the
        second of planned time
    :param velocity: the velocity to reach as soon as possible [u/s]; 0 means a stop.  If the rest
        of the path is too short for the change, the change is not finished at the end of the path
    :param limits: the limits of acceleration, deceleration and jerk.  The field ``velocity`` is
        not used
    """
    phases: list[Phase] = []
    for phase in _change_velocity(state, velocity, limits):
        if phase.end.position >= distance:
            cut = phase._replace(duration=_time_to(phase, distance))
            return Replanned((*phases, cut), cut.end._replace(position=distance))
        phases.append(phase)
    reached = PathState(phases[-1].end.position if phases else state.position, velocity)
    if not velocity:
        return Replanned(tuple(phases), reached)
    phases.append(Phase(reached, 0.0, (distance - reached.position) / velocity))
    return Replanned(tuple(phases), PathState(distance, velocity))


def replan_to_end(
        state: PathState, distance: float, velocity: float, end_velocity: float,
        limits: PathLimits) -> Replanned:
    """
    Plan the rest of a path again: go on to its end, and have a given velocity there.

    If the path is too short to reach the velocity at the end, the velocity there is as near to
    it as possible.

    :param state: the current state
    :param distance: the length of the path [u], where u is m or rad
    :param velocity: the wanted velocity on the way [u/s], above 0
    :param end_velocity: the wanted velocity at the end [u/s], from 0 to ``velocity``
    :param limits: the limits; their ``velocity`` is not used
    """
    left = distance - state.position

    def is_too_fast(top: float) -> bool:
        return _distance_over(state, (top, end_velocity), limits) > left

    if is_too_fast(end_velocity):
        return replan_through(state, distance, end_velocity, limits)
    top = velocity
    if is_too_fast(top):
        top = _largest_velocity(state, end_velocity, velocity, limits, is_too_fast)
    phases = list(_change_velocity(state, top, limits))
    begin = PathState(phases[-1].end.position if phases else state.position, top)
    ease = list(_change_velocity(begin, end_velocity, limits))
    cruise = distance - (ease[-1].end.position if ease else begin.position)
    if cruise > CRUISE_ROUNDING * distance and top:
        phases.append(Phase(begin, 0.0, cruise / top))
        ease = list(_change_velocity(
            begin._replace(position=begin.position + cruise), end_velocity, limits))
    return Replanned((*phases, *ease), PathState(distance, end_velocity))


def _distance_to_rest(state: PathState, velocity: float, limits: PathLimits) -> float:
    """
    Return the distance needed to change to a velocity and then to stop [m or rad].

    Both changes are as fast as the limits allow.

    :param state: the current position, velocity and acceleration; its position is not used
    :param velocity: the velocity to change to before the stop [m/s or rad/s]
    :param limits: the limits of acceleration, deceleration and jerk.  The field ``velocity`` is
        not used
    """
    return _distance_over(state, (velocity, 0.0), limits)


def _distance_over(
        state: PathState, velocities: tuple[float, ...], limits: PathLimits) -> float:
    """Return the distance needed to change to each of some velocities in turn [m or rad]."""
    start = PathState(0.0, *state[1:])
    for wanted in velocities:
        for phase in _change_velocity(start, wanted, limits):
            start = phase.end
        start = PathState(start.position, wanted)
    return start.position


def _velocity_at_zero_acceleration(state: PathState, limits: PathLimits) -> float:
    """
    Return the velocity that is reached when the acceleration goes to zero at the largest jerk.

    See formula (15) of docs/theory.md.

    :param state: the current position, velocity and acceleration
    :param limits: the limits, of which only the jerk is used
    """
    if limits.jerk == math.inf:
        return state.velocity
    return state.velocity + state.acceleration * abs(state.acceleration) / (2.0 * limits.jerk)


def _change_velocity(state: PathState, velocity: float, limits: PathLimits) -> Iterator[Phase]:
    """
    Yield the phases of the fastest change to a velocity.

    A phase is a time interval with a constant jerk.  After the last phase, the acceleration is
    zero.  See formula (15) of docs/theory.md.  If only the jerk is unlimited, the acceleration
    jumps.  If the acceleration is unlimited too, the velocity jumps.

    :param state: the current position, velocity and acceleration
    :param velocity: the velocity at the end of the change
    :param limits: the limits of acceleration, deceleration and jerk.  The field ``velocity`` is
        not used
    """
    rises = velocity >= _velocity_at_zero_acceleration(state, limits)
    sign, bound = (1.0, limits.acceleration) if rises else (-1.0, limits.deceleration)
    change, jerk = sign * (velocity - state.velocity), limits.jerk
    if jerk == math.inf:
        if change > 0.0 and bound < math.inf:
            yield Phase(state._replace(acceleration=sign * bound), 0.0, change / bound)
        return
    before = state.acceleration
    wanted = math.sqrt(max(0.0, jerk * change + before * before / 2.0))
    peak = min(wanted, bound)
    phase = Phase(state, sign * jerk, max(0.0, (peak - sign * before) / jerk))
    yield phase
    if wanted > bound:
        held = (change - (2.0 * peak * peak - before * before) / (2.0 * jerk)) / peak
        phase = Phase(phase.end._replace(acceleration=sign * peak), 0.0, max(0.0, held))
        yield phase
    yield Phase(phase.end, -sign * jerk, peak / jerk)


def _time_to(phase: Phase, position: float) -> float:
    """
    Return the time since the start of a phase at which a position is reached [s].

    A phase is a time interval with a constant jerk.  The velocity must not be negative in the
    phase.
    """
    return bisection(
        0.0, phase.duration, lambda time: phase.state_at(time).position >= position)[1]


def bisection(
        low: float, high: float, is_above: Callable[[float], bool],
        count: int = BISECTIONS) -> tuple[float, float]:
    """
    Find a number in an interval by bisection, which halves the interval repeatedly.

    :param low: the lower end of the interval
    :param high: the upper end of the interval
    :param is_above: a function that returns whether its argument is above the number to find
    :param count: the largest number of times that the interval is halved
    :returns: the lower end and the upper end of the last interval, which contains the number
    """
    for _ in range(count):
        middle = (low + high) / 2.0
        if not low < middle < high:
            break
        if is_above(middle):
            high = middle
        else:
            low = middle
    return low, high
