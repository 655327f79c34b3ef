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
"""Re-plan the remaining path from a state in motion: slow down, stop, or speed up again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import math
from typing import NamedTuple

#: A stop counts as a stop at the path's end within this share of its length (rounding).
ROUNDING = 1e-12
#: A cruise shorter than this share of the path's length is left out (rounding).
CRUISE_ROUNDING = 1e-14
#: The number of bisections for the largest velocity: to the last bit, or almost to zero.
BISECTIONS = 120


class PathState(NamedTuple):
    """
    Position, velocity and acceleration along a path, in the path's unit u.

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
    A time interval with a constant jerk.

    :param start: the state at the start of the phase
    :param jerk: the rate of change of the acceleration [u/s^3]
    :param duration: the duration of the phase [s]
    """

    start: PathState
    jerk: float
    duration: float

    def state_at(self, time: float) -> PathState:
        """Return the state at a time since the start of the phase [s]."""
        position, velocity, acceleration = self.start
        return PathState(
            position + time * (velocity + time * (acceleration / 2.0 + time * self.jerk / 6.0)),
            velocity + time * (acceleration + time * self.jerk / 2.0),
            acceleration + time * self.jerk)

    @property
    def end(self) -> PathState:
        """Return the state at the end of the phase."""
        return self.state_at(self.duration)


@dataclass(frozen=True)
class Replanned:
    """
    A re-planned movement along the remaining path, to its end or to a stop before the end.

    :param phases: the phases of constant jerk, in order; the velocity may jump between phases
    :param end: the state at the end of the movement
    """

    phases: tuple[Phase, ...]
    end: PathState

    @property
    def duration(self) -> float:
        """Return the duration of the movement [s]."""
        return math.fsum(phase.duration for phase in self.phases)

    def state_at(self, time: float) -> PathState:
        """
        Return the state at a time.

        :param time: the time since the start [s], not negative; after the end the state is
            ``end``
        """
        for phase in self.phases:
            if time < phase.duration:
                return phase.state_at(time)
            time -= phase.duration
        return self.end


def replan_to_rest(
        state: PathState, distance: float, velocity: float, limits: PathLimits) -> Replanned:
    """
    Re-plan the remaining path: stop at the end of the path, or stop as soon as possible.

    The path is never driven backwards; (15) and (16) in docs/theory.md.

    :param state: the current state; a stop before the end of the path must be possible from it
    :param distance: the length of the path [u]
    :param velocity: the largest velocity wanted [u/s]; a larger current velocity is reduced as
        soon as possible, unless the path is too short for this; 0: stop as soon as possible
    :param limits: the limits of acceleration, deceleration and jerk; its velocity is not used
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
    Return the largest velocity from which a stop on the remaining path is possible (16).

    :param state: the current state
    :param left: the length of the remaining path [u]
    :param velocity: a velocity that is too large [u/s]
    :param limits: the limits of acceleration, deceleration and jerk
    """
    low, high = 0.0, velocity
    # The distance to stop is shortest if the acceleration does not change its sign.
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
    Re-plan the remaining path at a velocity, without a stop at the end of the path.

    :param state: the current state
    :param distance: the length of the path [u]
    :param velocity: the velocity to reach as soon as possible and then hold [u/s]; 0: stop as
        soon as possible, or pass the end if the remaining path is too short to stop
    :param limits: the limits of acceleration, deceleration and jerk; its velocity is not used
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
    """Return the distance needed to change to a velocity and then to stop [u]."""
    start = PathState(0.0, *state[1:])
    for phase in _change_velocity(start, velocity, limits):
        start = phase.end
    start = PathState(start.position, velocity)
    for phase in _change_velocity(start, 0.0, limits):
        start = phase.end
    return start.position


def _velocity_at_zero_acceleration(state: PathState, limits: PathLimits) -> float:
    """Return the velocity reached when the acceleration goes to zero at the largest jerk (15)."""
    if limits.jerk == math.inf:
        return state.velocity
    return state.velocity + state.acceleration * abs(state.acceleration) / (2.0 * limits.jerk)


def _change_velocity(
        state: PathState, velocity: float, limits: PathLimits) -> Iterator[Phase]:
    """
    Yield the phases of the fastest change to a velocity, with zero acceleration at the end (15).

    With unlimited jerk and acceleration, the velocity jumps.  With unlimited jerk alone, the
    acceleration jumps.
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
    """Return the time at which a phase, always moving forwards, reaches a position [s]."""
    low, high = 0.0, phase.duration
    while low < (middle := (low + high) / 2.0) < high:
        if phase.state_at(middle).position < position:
            low = middle
        else:
            high = middle
    return high
