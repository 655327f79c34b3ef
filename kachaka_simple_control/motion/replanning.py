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
"""Re-plan how a path is driven from a state in motion: slow down, stop, speed up again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import math
from typing import NamedTuple

#: A stop this near to the end of a path is its end, as a part of the path's length: rounding.
ROUNDING = 1e-12
#: A cruise shorter than this part of the path's length is rounding.
CRUISE_ROUNDING = 1e-14
#: How often the largest velocity is bisected: to the last bit, or to as good as zero.
BISECTIONS = 120


class PathState(NamedTuple):
    """
    Where on a path something is, and how it moves along it.

    :param position: the distance from the start of the path [u]
    :param velocity: along the path [u/s], not negative
    :param acceleration: along the path [u/s^2]
    """

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


class PathLimits(NamedTuple):
    """
    The limits along a path segment; each is positive or infinite.

    :param velocity: largest velocity [u/s]
    :param acceleration: largest acceleration [u/s^2]
    :param deceleration: largest deceleration [u/s^2]
    :param jerk: largest jerk [u/s^3]
    """

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float


class Phase(NamedTuple):
    """
    A time of constant jerk.

    :param start: the state at its begin
    :param jerk: the change of the acceleration [u/s^3]
    :param duration: how long it takes [s]
    """

    start: PathState
    jerk: float
    duration: float

    def state_at(self, time: float) -> PathState:
        """Return the state at a time since its begin [s]."""
        position, velocity, acceleration = self.start
        return PathState(
            position + time * (velocity + time * (acceleration / 2.0 + time * self.jerk / 6.0)),
            velocity + time * (acceleration + time * self.jerk / 2.0),
            acceleration + time * self.jerk)

    @property
    def end(self) -> PathState:
        """Return the state at its end."""
        return self.state_at(self.duration)


@dataclass(frozen=True)
class Replanned:
    """
    How the rest of a path is driven, or the path to a rest on it.

    :param phases: times of constant jerk, in order; between two of them the velocity may jump
    :param end: the state at its end
    """

    phases: tuple[Phase, ...]
    end: PathState

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""
        return math.fsum(phase.duration for phase in self.phases)

    def state_at(self, time: float) -> PathState:
        """
        Return the state at a time.

        :param time: since the begin [s], not negative; after the end it is the state at the end
        """
        for phase in self.phases:
            if time < phase.duration:
                return phase.state_at(time)
            time -= phase.duration
        return self.end


def replan_to_rest(
        state: PathState, distance: float, velocity: float, limits: PathLimits) -> Replanned:
    """
    Return how to drive the rest of a path to rest at its end, or to rest as soon as possible.

    The path is never driven backwards.  (15) and (16) in docs/theory.md.

    :param state: the state now; from it a stop before the end of the path is possible
    :param distance: the length of the path [u]
    :param velocity: the largest velocity wanted [u/s]; one that is larger now falls to it as soon
        as possible, unless the path is too short for that.  0: to rest as soon as possible
    :param limits: of acceleration, deceleration and jerk; the velocity is not looked at
    """
    if not velocity:
        return _to_standstill(state, distance, limits)
    top = velocity
    left = distance - state.position
    if _distance_to_rest(state, velocity, limits) > left:
        top = _largest_velocity(state, left, velocity, limits)
    phases = list(_change_velocity(state, top, limits))
    begin = phases[-1].end.position if phases else state.position
    if top:
        falling = _distance_to_rest(PathState(0.0, top), 0.0, limits)
        cruise = distance - falling - begin
        if cruise > CRUISE_ROUNDING * distance:
            phases.append(Phase(PathState(begin, top), 0.0, cruise / top))
            begin += cruise
        phases += _change_velocity(PathState(begin, top), 0.0, limits)
    return Replanned(tuple(phases), PathState(distance))


def _largest_velocity(
        state: PathState, left: float, velocity: float, limits: PathLimits) -> float:
    """
    Return the largest velocity after which the rest of the path suffices to stop (16).

    :param left: the rest of the path [u]
    :param velocity: a velocity that is too large [u/s]
    """
    low, high = 0.0, velocity
    # Without a change of the sign of the acceleration the rest of the path suffices best.
    level = _velocity_at_zero_acceleration(state, limits)
    if 0.0 < level < velocity:
        if _distance_to_rest(state, level, limits) <= left:
            low = level
        else:
            high = level
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        if _distance_to_rest(state, middle, limits) <= left:
            low = middle
        else:
            high = middle
    return low


def replan_through(
        state: PathState, distance: float, velocity: float, limits: PathLimits) -> Replanned:
    """
    Return how to drive the rest of a path at a velocity, and to pass its end in motion.

    :param state: the state now
    :param distance: the length of the path [u]
    :param velocity: the velocity to reach as soon as possible, and to hold [u/s]; 0: the rest of
        the path is not driven if it is long enough to stop on it
    :param limits: of acceleration, deceleration and jerk; the velocity is not looked at
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


def _to_standstill(state: PathState, distance: float, limits: PathLimits) -> Replanned:
    phases = tuple(_change_velocity(state, 0.0, limits))
    position = phases[-1].end.position if phases else state.position
    is_end = position >= distance * (1.0 - ROUNDING)
    return Replanned(phases, PathState(distance if is_end else position))


def _distance_to_rest(state: PathState, velocity: float, limits: PathLimits) -> float:
    """Return the distance of a change to a velocity and from there to rest [u]."""
    start = PathState(0.0, *state[1:])
    for phase in _change_velocity(start, velocity, limits):
        start = phase.end
    start = PathState(start.position, velocity)
    for phase in _change_velocity(start, 0.0, limits):
        start = phase.end
    return start.position


def _velocity_at_zero_acceleration(state: PathState, limits: PathLimits) -> float:
    """Return the velocity once the acceleration has gone to zero at the largest jerk (15)."""
    if limits.jerk == math.inf:
        return state.velocity
    return state.velocity + state.acceleration * abs(state.acceleration) / (2.0 * limits.jerk)


def _change_velocity(
        state: PathState, velocity: float, limits: PathLimits) -> Iterator[Phase]:
    """
    Yield the quickest change to a velocity, with no acceleration at its end (15).

    Without limits the velocity jumps; without a limit of the jerk the acceleration does.
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
    """Return when a phase reaches a position [s]; it never goes back."""
    low, high = 0.0, phase.duration
    while low < (middle := (low + high) / 2.0) < high:
        if phase.state_at(middle).position < position:
            low = middle
        else:
            high = middle
    return high
