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
"""Which velocity of a plan is due when, under a speed factor that may change.  No clock."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
import math
from operator import attrgetter
from typing import Protocol

from kachaka_simple_control.control.events import VelocityKind
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.replanning import PathState, Replanned
from kachaka_simple_control.motion.trajectory import Trajectory

#: A last tick shorter than this part of a period is a rounding error, not a tick.
TIME_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True)
class Tick:
    """
    What is due at a time.

    :param velocity: the velocity to send now
    :param start: when it is due [s after t = 0]
    :param deadline: when the next tick is due [s after t = 0]
    :param rest: how long the robot stays at rest from the start of this tick [s]; 0 while moving
    :param plan_time: where on the plan it begins [s of the plan]; the start, if nothing has
        delayed the plan; None if it is of no plan
    """

    velocity: Velocity
    start: float
    deadline: float
    rest: float
    plan_time: float | None = None


class VelocitySource(Protocol):
    """
    Tells which velocity is due: a plan, or what somebody wants now.

    :ivar kind: what its velocities are sent for
    :ivar skipped: how many velocities the newest call of ``due`` left out, for their time had
        passed
    :ivar plan_duration: where on its plan it ends [s of the plan]; None without a plan
    """

    kind: VelocityKind
    skipped: int
    plan_duration: float | None

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """
        Return the tick that is due; called at 0 first, then at each deadline, or earlier.

        :param elapsed: time since t = 0 [s], never less than before
        :param factor: the speed factor from the start of the returned tick on, from 0 to 1
        :returns: the tick; None when the source has ended
        """


class TickScheduler:
    """
    Walks a plan once: told the time, it returns the velocity due.

    Deadlines are absolute: they follow from the plan and the changes of the speed factor alone.
    A late call returns what is due by then and moves no later deadline.

    While the speed factor is 1 the velocities are those of the plan, bit for bit.  When it
    changes, the trajectory under way is planned anew from the state at the tick, and each one
    after it when it begins, until one can be driven as planned again.

    :param plan: the plan to walk
    """

    kind = VelocityKind.PLAN

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        #: where the plan ends [s of the plan]
        self.plan_duration: float | None = plan.duration
        #: how many ticks the newest call of ``due`` left out, for their time had passed
        self.skipped = 0
        self._factor = 1.0
        #: the trajectory under way while it is not driven as planned; None otherwise
        self._replanned: _ReplannedTrajectory | None = None
        self._ticks = self._as_planned(0, 0.0)
        self._tick = next(self._ticks, None)

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """
        Return the tick that is due; call it at 0 first, then at each deadline.

        :param elapsed: time since t = 0 [s], never less than before
        :param factor: the speed factor from the start of the returned tick on, from 0 to 1
        :returns: the tick; None when the plan is over
        """
        passed = 0
        while self._tick is not None and self._tick.deadline <= elapsed:
            self._pass(self._tick)
            passed += 1
        self.skipped = max(0, passed - 1)
        if self._tick is not None and factor != self._factor:
            self._change_factor(self._tick, factor)
        return self._tick

    def _pass(self, tick: Tick) -> None:
        self._tick = next(self._ticks, None)
        if self._tick is None and self._replanned is not None:
            self._begin(self._replanned.following(), tick.deadline)

    def _change_factor(self, tick: Tick, factor: float) -> None:
        """Plan the trajectory under way anew, from the start of a tick."""
        self._factor = factor
        assert tick.plan_time is not None
        if self._replanned is None:
            self._replanned = _at_plan_time(self._plan, tick.plan_time)
        if not self._replanned.has_begun:
            self._begin(self._replanned, tick.start)
            return
        self._ticks = self._replanned.ticks(factor, tick.start)
        self._tick = next(self._ticks, None)
        if self._tick is None:
            self._begin(self._replanned.following(), tick.start)

    def _begin(self, trajectory: _ReplannedTrajectory | None, now: float) -> None:
        """
        Begin a trajectory, as planned if it can be driven so.

        :param trajectory: the trajectory; None after the last
        :param now: when it begins [s after t = 0]
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
            self._ticks = self._replanned.ticks(self._factor, now)
            self._tick = next(self._ticks, None)
            if self._tick is not None:
                return
            self._replanned = self._replanned.following()

    def _as_planned(self, first: int, delay: float) -> Iterator[Tick]:
        """
        Yield the ticks of the plan.

        :param first: the index of the segment to begin with
        :param delay: by how much all is later than planned [s]
        """
        period = self._plan.period
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
    A trajectory of a plan that is driven under a speed factor.

    :param plan: the plan
    :param step: the index of its step
    :param number: its index in the step
    :param plan_start: when it begins by the plan [s of the plan]
    :param reached: the velocity of the trajectory before at its end, in its own unit [u/s]; 0 at
        rest
    :param state: the state in which it is taken over; None before its begin
    """

    def __init__(
            self, plan: Plan, step: int, number: int, plan_start: float, reached: float,
            state: PathState | None = None) -> None:
        self._plan, self._step, self._number = plan, step, number
        self._reached = reached
        #: whether a tick of it has passed
        self.has_begun = state is not None
        self.plan_start = plan_start
        self.trajectory: Trajectory = plan.steps[step].trajectories[number]
        #: the state at the start of the newest tick
        self._state = self._end = state or PathState(0.0)

    def begin(self, factor: float) -> bool:
        """Begin at the start of the path; return whether it can be driven as planned."""
        self._state = self.trajectory.first_state(factor, self._reached)
        return factor == 1.0 and self._state == self.trajectory.first_state(1.0, 0.0)

    def ticks(self, factor: float, now: float) -> Iterator[Tick]:
        """
        Yield the ticks from the newest state on; without end if it rests before its end.

        :param factor: the speed factor
        :param now: when the first begins [s after t = 0]
        """
        replanned = self.trajectory.replanned(self._state, factor)
        self._end = replanned.end
        for tick in self._driven(replanned, now):
            yield tick
            self.has_begun = True
        now += replanned.duration
        self._state = self._end
        while self._end.position < self.trajectory.segment.distance:
            following = now + self._plan.period
            yield Tick(ZERO, now, following, math.inf, self._plan_time())
            self.has_begun = True
            now = following

    def following(self) -> _ReplannedTrajectory | None:
        """Return the next trajectory that takes time, before its begin; None after the last."""
        reached = 0.0 if self.trajectory.segment.is_rest else self._end.velocity
        number = self._number + 1
        for step in range(self._step, len(self._plan.steps)):
            planned = self._plan.steps[step]
            start = planned.start
            for index, trajectory in enumerate(planned.trajectories):
                if trajectory.duration and (step > self._step or index >= number):
                    return _ReplannedTrajectory(self._plan, step, index, start, reached)
                start += trajectory.duration
        return None

    def _driven(self, replanned: Replanned, now: float) -> Iterator[Tick]:
        duration = replanned.duration
        count = math.ceil(duration / self._plan.period * (1.0 - TIME_TOLERANCE))
        is_rest = self.trajectory.segment.is_rest
        for index in range(count):
            begin, end = duration * (index / count), duration * ((index + 1) / count)
            self._state = replanned.state_at(begin)
            if now + end <= now + begin:  # too short for the resolution of the time
                continue
            reached = replanned.end if index + 1 == count else replanned.state_at(end)
            yield Tick(
                self.trajectory.mean_velocity(
                    reached.position - self._state.position, end - begin),
                now + begin, now + end, duration - begin if is_rest else 0.0, self._plan_time())

    def _plan_time(self) -> float:
        return self.plan_start + self.trajectory.time_at(self._state.position)


def _at_plan_time(plan: Plan, time: float) -> _ReplannedTrajectory:
    """Return the trajectory under way by the plan, in the state at that time [s of the plan]."""
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


def _velocity_before(plan: Plan, step: int, number: int) -> float:
    """Return the velocity by the plan at the end of the trajectory before [u/s]; 0 at rest."""
    before = [*plan.steps[step].trajectories[:number]]
    while step and not any(trajectory.duration for trajectory in before):
        step -= 1
        before = [*plan.steps[step].trajectories]
    for trajectory in reversed(before):
        if trajectory.duration:
            is_rest = trajectory.segment.is_rest
            return 0.0 if is_rest else trajectory.state_at(trajectory.duration).velocity
    return 0.0
