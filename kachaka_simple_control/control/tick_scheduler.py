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
Find the velocity of a plan that is due at a given time.

A speed factor, which may change at any time, slows the plan down.  This module reads no clock: the
caller passes the time.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
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

    Times are counted from t = 0, when the first velocity is due.

    :param velocity: the velocity
    :param start: when the velocity is due [s after t = 0]
    :param deadline: when the next velocity is due [s after t = 0]
    :param rest: how long the robot stays at rest from ``start`` on [s]; 0 while it moves, infinite
        while a speed factor of 0 holds it at rest
    :param plan_time: the point in the plan to which the velocity belongs [s after the start of the
        plan].  It is equal to ``start`` unless a speed factor below 1 has delayed the plan.  None
        without a plan
    """

    velocity: Velocity
    start: float
    deadline: float
    rest: float
    plan_time: float | None = None


class VelocitySource(Protocol):
    """
    An interface for an object that returns the velocities to send, for one drive of a robot.

    The velocities come from a plan, or from direct commands without a plan.

    :ivar kind: the purpose of the velocities, for example to drive a plan; for logs and displays
    :ivar skipped: how many velocities the newest call of ``due`` left out, because they were too
        late
    :ivar plan_duration: the duration of the plan at full speed [s]; None without a plan
    """

    kind: VelocityKind
    skipped: int
    plan_duration: float | None

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """
        Return the velocity that is due at a time, and the time when the next velocity is due.

        Call this first with ``elapsed`` 0.  Then call it at the deadline of the returned tick, or
        earlier.

        :param elapsed: the time since the first velocity was due [s]; it must not decrease between
            calls
        :param factor: the speed relative to the plan, from 0 to 1; it applies from the start of
            the returned tick on
        :returns: the tick, which is a velocity with its times; None if no more velocities follow
        """


class TickScheduler:
    """
    Returns the velocity of a plan that is due at a given time.

    A late call does not delay the velocities that follow.  It returns the velocity that is due at
    the time of the call.  The times at which velocities are due depend only on the plan and on the
    changes of the speed factor, which is the speed relative to the plan.

    While the speed factor is 1, the velocities are exactly those of the plan.  A plan is a
    sequence of trajectories, each with its own velocity profile.  When the speed factor changes,
    the rest of the current trajectory is planned again, from the position and velocity that the
    robot has reached in the plan.  Each later trajectory is planned again when it begins, until
    one of them can be driven exactly as in the plan.

    :param plan: the plan
    """

    kind = VelocityKind.PLAN

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        #: the duration of the plan at a speed factor of 1 [s]
        self.plan_duration: float | None = plan.duration
        #: how many ticks the newest call of ``due`` left out, because they were too late
        self.skipped = 0
        self._factor = 1.0
        #: the current trajectory if it is not driven as planned; None otherwise
        self._replanned: _ReplannedTrajectory | None = None
        #: the velocity before the current tick
        self._before = Sent(ZERO, plan.period)
        self._ticks = self._as_planned(0, 0.0)
        self._tick = next(self._ticks, None)

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """
        Return the velocity that is due at a time, and the time when the next velocity is due.

        Call this first with ``elapsed`` 0.  Then call it at the deadline of the returned tick.

        :param elapsed: the time since the first velocity was due [s]; it must not decrease between
            calls
        :param factor: the speed relative to the plan, from 0 to 1; it applies from the start of
            the returned tick on
        :returns: the tick, which is a velocity with its times; None when the plan is over
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
        self._before = Sent(tick.velocity, tick.deadline - tick.start)
        self._tick = next(self._ticks, None)
        if self._tick is None and self._replanned is not None:
            self._begin(self._replanned.following(), tick.deadline)

    def _change_factor(self, tick: Tick, factor: float) -> None:
        """
        Plan the current trajectory again, because the speed factor has changed.

        A trajectory is a part of the plan.

        :param tick: the velocity that is due; the new speed factor applies from its start on
        :param factor: the new speed relative to the plan, from 0 to 1
        """
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
        Begin a trajectory of the plan; if it cannot be driven as planned, plan it again.

        It can be driven as planned if the speed factor is 1 and the robot has the planned
        velocity.

        :param trajectory: the trajectory, which is a part of the path; None after the last
            trajectory
        :param now: when the trajectory begins [s after the start of the drive]
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
        """
        Yield the velocities of the plan, all with the same delay.

        :param first: the index of the segment of the plan with which to begin; a segment is a time
            interval with one velocity
        :param delay: how much later than in the plan the velocities are due [s]
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
    A trajectory of a plan that is planned again, because the speed factor has changed.

    A plan is a list of steps.  Each step is a list of trajectories, which are parts of the path
    with their timing.

    The unit of ``reached`` is m/s, or rad/s for a turn in place.  For a step that holds a constant
    velocity for a time, the unit is plan seconds per second: 1 as planned, 0.5 at half the speed.

    :param plan: the plan
    :param step: the index of the step that contains the trajectory
    :param number: the index of the trajectory in this step
    :param plan_start: when the trajectory begins in the plan [s after the start of the plan]
    :param reached: the velocity along the path at the end of the previous trajectory; 0 if the
        robot stood still
    :param state: the position and velocity that are reached in the trajectory; None if the
        trajectory has not begun
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

    def begin(self, factor: float) -> bool:
        """
        Begin the trajectory, and check whether it can be driven exactly as in the plan.

        A trajectory is a part of the plan.

        :param factor: the speed relative to the plan, from 0 to 1
        :returns: True if the factor is 1 and the trajectory starts with its planned velocity
        """
        self._state = self.trajectory.first_state(factor, self._reached)
        return factor == 1.0 and self._state == self.trajectory.planned_start

    def ticks(self, factor: float, now: float, before: Sent) -> Iterator[Tick]:
        """
        Yield the velocities of the trajectory, from its current position to its end.

        A trajectory is a part of the plan.  If the speed factor stops the robot on the way, yield
        zero velocities for ever.

        :param factor: the speed relative to the plan, from 0 to 1
        :param now: when the first of these velocities is due [s after the start of the drive]
        :param before: the velocity before these, and its duration
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
        """
        Return the next trajectory, which is a part of the plan; None if this one is the last.

        Trajectories with a duration of 0 are skipped.
        """
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
    """
    Return the trajectory, a part of the path, that is driven at a given time of a plan.

    The returned object contains the planned position and velocity at this time.  So the rest of
    the trajectory can be planned again.

    :param plan: the plan
    :param time: the time [s after the start of the plan]
    """
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
    """
    Return the planned velocity at the end of the trajectory that precedes a given trajectory.

    Trajectories with a duration of 0 are skipped.

    The unit of the velocity is m/s, or rad/s for a turn in place.  For a step that holds a
    constant velocity for a time, the unit is plan seconds per second: 1 as planned, 0.5 at half
    the speed.

    :param plan: the plan
    :param step: the index of the step that contains the given trajectory
    :param number: the index of the given trajectory in this step
    :returns: the velocity along the path; 0 if the robot stands still then
    """
    before = [*plan.steps[step].trajectories[:number]]
    while step and not any(trajectory.duration for trajectory in before):
        step -= 1
        before = [*plan.steps[step].trajectories]
    for trajectory in reversed(before):
        if trajectory.duration:
            return trajectory.exit_velocity(trajectory.state_at(trajectory.duration))
    return 0.0
