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
Plan the rest of a path again, from a state in motion: slow down, stop, or speed up again.

The unit u is the unit of the path: metre, radian, or second for a step with given velocities.
A number in round brackets, such as (15), is the number of a formula in docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.motion.roots import bisection
from kachaka_simple_control.motion.velocity_profile import PathLimits, PathState

#: A stop counts as a stop at the end of the path if the remaining part of the path is at most this
#: fraction of its length, because of rounding.
ROUNDING = 1e-12
#: A cruise of at most this fraction of the path's length is left out; it comes from rounding.
CRUISE_ROUNDING = 1e-14


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
