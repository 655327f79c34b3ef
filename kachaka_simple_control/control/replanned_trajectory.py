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
A trajectory of a plan that is planned again under a speed factor.

Tested by test/control/test_tick_scheduler.py.
"""

from __future__ import annotations

from collections.abc import Iterator
import math

from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.trajectory import TimedVelocity, Trajectory
from kachaka_simple_control.motion.velocity_profile import PathState


class ReplannedTrajectory:
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

    def ticks(self, factor: float, now: float, before: TimedVelocity) -> Iterator[Tick]:
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
                    piece.velocity, now + piece.begin, now + end, piece.rest, self.plan_time)
                self.has_begun = True
        now += end
        self._state = self._end
        while self._end.position < self.trajectory.extent:
            following = now + self._plan.period
            yield Tick(ZERO, now, following, math.inf, self.plan_time)
            self.has_begun = True
            now = following

    def driven(
            self, factor: float, duration: float, period: float,
            before: TimedVelocity) -> tuple[ReplannedTrajectory, TimedVelocity]:
        """
        Return what is reached after a duration [s], or at rest, without the times of the ticks.

        :param period: of the steps that compute it [s]
        """
        state, passed = self._state, 0.0
        for piece in self.trajectory.pieces(state, factor, period, before):
            state, passed = piece.last, piece.end
            if piece.end > piece.begin:
                before = TimedVelocity(piece.velocity, piece.end - piece.begin)
            if passed >= duration:
                break
        here = ReplannedTrajectory(
            self._plan, self._step, self._number, self.plan_start, self._reached, state)
        is_over = state.position >= self.trajectory.extent and passed < duration
        following = here.following() if is_over else None
        if following is None:
            return here, before
        following.begin(factor)
        return following.driven(factor, duration - passed, period, before)

    @property
    def plan_time(self) -> float:
        """Return the plan time that is reached at the start of the newest tick [s]."""
        return self.plan_start + self.trajectory.time_at(self._state.position)

    def following(self) -> ReplannedTrajectory | None:
        """Return the next trajectory that takes time; None if this one is the last."""
        reached = self.trajectory.exit_velocity(self._end)
        number = self._number + 1
        for step in range(self._step, len(self._plan.steps)):
            planned = self._plan.steps[step]
            start = planned.start
            for index, trajectory in enumerate(planned.trajectories):
                if trajectory.duration and (step > self._step or index >= number):
                    return ReplannedTrajectory(self._plan, step, index, start, reached)
                start += trajectory.duration
        return None


def at_plan_time(plan: Plan, time: float) -> ReplannedTrajectory:
    """Return the trajectory at a time of a plan, with what is reached in it then."""
    step = plan.step_index(time)
    start = plan.steps[step].start
    trajectories = plan.steps[step].trajectories
    number = 0
    while number + 1 < len(trajectories) and start + trajectories[number].duration <= time:
        start += trajectories[number].duration
        number += 1
    if time > start:
        return ReplannedTrajectory(
            plan, step, number, start, 0.0, trajectories[number].state_at(time - start))
    return ReplannedTrajectory(plan, step, number, start, velocity_before(plan, step, number))


def velocity_before(plan: Plan, step: int, number: int) -> float:
    """Return the planned velocity along the path at the end of the trajectory before one."""
    before = [*plan.steps[step].trajectories[:number]]
    while step and not any(trajectory.duration for trajectory in before):
        step -= 1
        before = [*plan.steps[step].trajectories]
    for trajectory in reversed(before):
        if trajectory.duration:
            return trajectory.exit_velocity(trajectory.state_at(trajectory.duration))
    return 0.0
