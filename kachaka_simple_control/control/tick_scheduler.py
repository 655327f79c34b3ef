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
"""Find the velocity of a plan that is due at a given time, slowed down by a speed factor."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from functools import cached_property
import math
from operator import attrgetter
from typing import NamedTuple, Protocol

from kachaka_simple_control.control.events import VelocityKind
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.trajectory import Sent, Trajectory
from kachaka_simple_control.motion.velocity_profile import PathState

#: A last tick shorter than this fraction of a period is a rounding error, not a tick.
TIME_TOLERANCE = 1e-6


class Tick(NamedTuple):
    """
    A velocity to send, and the time when it is due.

    Times are counted from t = 0, when the first velocity is due [s].

    :param start: when the velocity is due
    :param deadline: when the next velocity is due
    :param rest: how long the robot stays at rest from ``start`` on; 0 while it moves, infinite
        while a speed factor of 0 holds it
    :param plan_time: the point in the plan; ``start`` unless a speed factor has delayed the plan;
        None without a plan
    """

    velocity: Velocity
    start: float
    deadline: float
    rest: float
    plan_time: float | None = None


class VelocitySource(Protocol):
    """
    Returns the velocities to send, of a plan or of direct commands, for one drive of a robot.

    :ivar skipped: how many velocities the newest call of ``due`` left out, being too late
    :ivar plan_duration: the duration of the plan at full speed [s]; None without a plan
    """

    kind: VelocityKind
    skipped: int
    plan_duration: float | None

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """
        Return the velocity that is due, and until when; None if no more velocities follow.

        Call this first with ``elapsed`` 0, then at the deadline of the returned tick or earlier.

        :param elapsed: the time since t = 0 [s]; it must not decrease between calls
        :param factor: the speed factor from the start of the returned tick on
        """


class TickScheduler:
    """
    Returns the velocity of a plan that is due at a given time.

    A late call does not delay what follows: it returns what is due at its time.  While the speed
    factor is 1, the velocities are exactly those of the plan.  When it changes, the rest of the
    current trajectory is planned again, from the position and velocity reached in the plan; each
    later one when it begins, until one can be driven exactly as in the plan.
    """

    kind = VelocityKind.PLAN

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        #: the duration of the plan at a speed factor of 1 [s]
        self.plan_duration: float | None = plan.duration
        #: how many ticks the newest call of ``due`` left out, because they were too late
        self.skipped = 0
        self._factor = 1.0
        #: by how much the plan is late while it is driven as planned [s]
        self._delay = 0.0
        #: the current trajectory if it is not driven as planned; None otherwise
        self._replanned: _ReplannedTrajectory | None = None
        #: the velocity before the current tick
        self._before = Sent(ZERO, plan.period)
        self._ticks = self._as_planned(0, 0.0)
        self._tick = next(self._ticks, None)

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """Return the velocity that is due, as :meth:`VelocitySource.due` says."""
        passed = 0
        while self._tick is not None and self._tick.deadline <= elapsed:
            self._pass(self._tick)
            passed += 1
        self.skipped = max(0, passed - 1)
        if self._tick is not None and factor != self._factor:
            self._change_factor(self._tick, factor)
        return self._tick

    @property
    def delay(self) -> float | None:
        """
        Return by how much the plan is late [s].

        None while a trajectory is driven that was planned anew: its end says by how much.
        """
        if self._replanned is None:
            return self._delay
        tick, rest = self._tick, self.rest
        return None if tick is None or rest is None else tick.start - rest

    @property
    def rest(self) -> float | None:
        """
        Return the plan time at which the robot, at rest before the current tick, goes on [s].

        None if it moves before it, or is in the middle of a rest.
        """
        if self._replanned is not None:
            return self._replanned.plan_start if self._replanned.begins_at_rest else None
        time = None if self._tick is None else self._tick.plan_time
        return time if time in self._rests else None

    @cached_property
    def _rests(self) -> frozenset[float | None]:
        """Return the plan times at which the robot begins to move from rest."""
        return frozenset(_rests(self._plan))

    def _pass(self, tick: Tick) -> None:
        self._before = Sent(tick.velocity, tick.deadline - tick.start)
        self._tick = next(self._ticks, None)
        if self._tick is None and self._replanned is not None:
            self._begin(self._replanned.following(), tick.deadline)

    def _change_factor(self, tick: Tick, factor: float) -> None:
        """Plan the current trajectory again from a tick on, for another speed factor."""
        self._factor = factor
        assert tick.plan_time is not None
        if self._replanned is None:
            self._replanned = _at_plan_time(self._plan, tick.plan_time)
        if not self._replanned.has_begun:
            self._begin(self._replanned, tick.start)
            return
        self._ticks = self._replanned.ticks(factor, tick.start, self._before)
        self._tick = next(self._ticks, None)
        if self._tick is None:
            self._begin(self._replanned.following(), tick.start)

    def _begin(self, trajectory: _ReplannedTrajectory | None, now: float) -> None:
        """
        Begin a trajectory of the plan, None after the last; if needed, plan it again.

        It is driven as planned if the factor is 1 and the robot has the planned velocity.
        """
        self._replanned = trajectory
        while self._replanned is not None:
            if self._replanned.begin(self._factor):
                plan_start, self._replanned = self._replanned.plan_start, None
                self._ticks = self._as_planned(
                    bisect_left(self._plan.segments, plan_start, key=attrgetter('start')),
                    now - plan_start)
                self._tick = next(self._ticks, None)
                return
            self._ticks = self._replanned.ticks(self._factor, now, self._before)
            self._tick = next(self._ticks, None)
            if self._tick is not None:
                return
            self._replanned = self._replanned.following()

    def _as_planned(self, first: int, delay: float) -> Iterator[Tick]:
        """Yield the velocities of the plan from a segment on, all with the same delay [s]."""
        period, self._delay = self._plan.period, delay
        for index in range(first, len(self._plan.segments)):
            segment = self._plan.segments[index]
            number, start, end = 0, segment.start, segment.end
            while start < end:
                following = segment.start + (number + 1) * period
                if following >= end - TIME_TOLERANCE * period:
                    following = end
                rest = end - segment.start - number * period if segment.velocity.is_zero else 0.0
                # Leave out a tick that is too short for the resolution of the delayed time.
                if delay + following > delay + start:
                    yield Tick(segment.velocity, delay + start, delay + following, rest, start)
                number, start = number + 1, following


class _ReplannedTrajectory:
    """
    A trajectory of a plan that is planned again, because the speed factor has changed.

    :param plan_start: when it begins in the plan [s]
    :param reached: the velocity along the path at the end of the one before; 0 if the robot stood
        still
    :param state: what is reached in it; None if it has not begun
    """

    def __init__(
            self, plan: Plan, step: int, number: int, plan_start: float, reached: float,
            state: PathState | None = None) -> None:
        self._plan, self._step, self._number = plan, step, number
        self._reached = reached
        #: whether a tick of the trajectory has passed
        self.has_begun = state is not None
        self.plan_start = plan_start
        self.trajectory: Trajectory = plan.steps[step].trajectories[number]
        #: the state at the start of the newest tick
        self._state = self._end = state or PathState(0.0)

    @property
    def begins_at_rest(self) -> bool:
        """Whether its first tick is the current one, and the robot stood still before."""
        return not self.has_begun and not self._reached

    def begin(self, factor: float) -> bool:
        """Begin the trajectory; return whether it can be driven exactly as in the plan."""
        self._state = self.trajectory.first_state(factor, self._reached)
        return factor == 1.0 and self._state == self.trajectory.planned_start

    def ticks(self, factor: float, now: float, before: Sent) -> Iterator[Tick]:
        """
        Yield its velocities from its current position to its end.

        If the speed factor stops the robot on the way, yield zero velocities for ever.
        """
        end = 0.0
        pieces = self.trajectory.pieces(self._state, factor, self._plan.period, before)
        for piece in pieces:
            self._state, self._end, end = piece.first, piece.last, piece.end
            # Leave out a tick that is too short for the resolution of the time.
            if now + end > now + piece.begin:
                yield Tick(
                    piece.velocity, now + piece.begin, now + end, piece.rest, self._plan_time())
                self.has_begun = True
        now += end
        self._state = self._end
        while self._end.position < self.trajectory.extent:
            following = now + self._plan.period
            yield Tick(ZERO, now, following, math.inf, self._plan_time())
            self.has_begun = True
            now = following

    def following(self) -> _ReplannedTrajectory | None:
        """Return the next trajectory that takes time; None if this one is the last."""
        reached = self.trajectory.exit_velocity(self._end)
        number = self._number + 1
        for step in range(self._step, len(self._plan.steps)):
            planned = self._plan.steps[step]
            start = planned.start
            for index, trajectory in enumerate(planned.trajectories):
                if trajectory.duration and (step > self._step or index >= number):
                    return _ReplannedTrajectory(self._plan, step, index, start, reached)
                start += trajectory.duration
        return None

    def _plan_time(self) -> float:
        return self.plan_start + self.trajectory.time_at(self._state.position)


def _at_plan_time(plan: Plan, time: float) -> _ReplannedTrajectory:
    """Return the trajectory at a time of a plan, with what is reached in it then."""
    step = plan.step_index(time)
    start = plan.steps[step].start
    trajectories = plan.steps[step].trajectories
    number = 0
    while number + 1 < len(trajectories) and start + trajectories[number].duration <= time:
        start += trajectories[number].duration
        number += 1
    if time > start:
        return _ReplannedTrajectory(
            plan, step, number, start, 0.0, trajectories[number].state_at(time - start))
    return _ReplannedTrajectory(plan, step, number, start, _velocity_before(plan, step, number))


def _rests(plan: Plan) -> Iterator[float]:
    for step, planned in enumerate(plan.steps):
        start = planned.start
        for number, trajectory in enumerate(planned.trajectories):
            if trajectory.duration and not _velocity_before(plan, step, number):
                yield start
            start += trajectory.duration


def _velocity_before(plan: Plan, step: int, number: int) -> float:
    """Return the planned velocity along the path at the end of the trajectory before one."""
    before = [*plan.steps[step].trajectories[:number]]
    while step and not any(trajectory.duration for trajectory in before):
        step -= 1
        before = [*plan.steps[step].trajectories]
    for trajectory in reversed(before):
        if trajectory.duration:
            return trajectory.exit_velocity(trajectory.state_at(trajectory.duration))
    return 0.0
