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

The unit u is that of the path segment.  Numbers in brackets, such as (15), are those of formulas
in docs/theory.md.
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
    """A time interval with a constant jerk [u/s^3]."""

    start: PathState
    jerk: float
    duration: float

    def state_at(self, time: float) -> PathState:
        """Return the position, velocity and acceleration at a time within the phase."""
        position, velocity, acceleration = self.start
        return PathState(
            position + time * (velocity + time * (acceleration / 2.0 + time * self.jerk / 6.0)),
            velocity + time * (acceleration + time * self.jerk / 2.0),
            acceleration + time * self.jerk)

    @property
    def end(self) -> PathState:
        """Return the position, velocity and acceleration at the end of the phase."""
        return self.state_at(self.duration)


@dataclass(frozen=True)
class Replanned:
    """
    A new plan for the rest of a path: to the end of the path, or to a stop before this end.

    :param phases: in order; with infinite limits, the velocity can jump between them
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
        """Return the mean velocity in each of some equal time parts [u/s]."""
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
        """Return the state at a time of the new plan [s]; after its end, the result is ``end``."""
        for phase in self.phases:
            if time < phase.duration:
                return phase.state_at(time)
            time -= phase.duration
        return self.end


def replan_to_rest(
        state: PathState, distance: float, velocity: float, limits: PathLimits) -> Replanned:
    """
    Plan the rest of a path again, so that the robot stops at its end: (15) and (16).

    With a velocity of 0, it stops as soon as possible.  The position never decreases.

    :param state: a stop before the end of the path must still be possible
    :param distance: the length of the whole path [u]
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
    """Return the largest velocity to which the robot can change and stop in time: (16)."""
    # The distance is shortest if the acceleration does not change its sign.
    level = _velocity_at_zero_acceleration(state, limits)
    if low < level < high:
        low, high = (low, level) if is_too_fast(level) else (level, high)
    return bisection(low, high, is_too_fast)[0]


def replan_through(
        state: PathState, distance: float, velocity: float, limits: PathLimits) -> Replanned:
    """
    Plan the rest of a path again: change to a velocity, and keep it until the end of the path.

    :param distance: the length of the whole path [u]
    :param velocity: to reach as soon as possible [u/s], 0 for a stop; the path may end before
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
    Plan the rest of a path again: go on to its end with a velocity there, or as near as possible.

    :param distance: the length of the path [u]
    :param end_velocity: the wanted velocity at the end [u/s], from 0 to ``velocity``
    :param limits: their ``velocity`` is not used
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
    """Return the distance for the fastest change to a velocity and then to rest [u]."""
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
    """Return the velocity when the acceleration has gone to zero at the largest jerk: (15)."""
    if limits.jerk == math.inf:
        return state.velocity
    return state.velocity + state.acceleration * abs(state.acceleration) / (2.0 * limits.jerk)


def _change_velocity(state: PathState, velocity: float, limits: PathLimits) -> Iterator[Phase]:
    """
    Yield the phases of the fastest change to a velocity, without acceleration at its end: (15).

    Without a limit of jerk the acceleration jumps; without that of acceleration the velocity.
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
    """Return when a position is reached in a phase without negative velocity [s]."""
    return bisection(
        0.0, phase.duration, lambda time: phase.state_at(time).position >= position)[1]
