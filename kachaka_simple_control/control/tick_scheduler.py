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
from collections.abc import Callable, Iterator
from copy import copy
from functools import cached_property
import math
from operator import attrgetter
from typing import NamedTuple, Protocol

from kachaka_simple_control.control.events import VelocityKind
from kachaka_simple_control.control.replanned_trajectory import (
    at_plan_time,
    ReplannedTrajectory,
    velocity_before,
)
from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.trajectory import TimedVelocity

#: A last tick shorter than this fraction of a period is a rounding error, not a tick.
TIME_TOLERANCE = 1e-6


class PlanPoint(NamedTuple):
    """
    How far a plan is, so that another thread can tell where the robot would come to rest.

    :param replanned: None while it is driven as planned
    :param before: the velocity before the tick
    """

    plan: Plan
    tick: Tick
    factor: float
    replanned: ReplannedTrajectory | None
    before: TimedVelocity

    def rest(self, lead: float, period: float) -> float:
        """
        Return the plan time at which the robot rests if it is held some time after the tick [s].

        :param lead: until then it drives on with its speed factor [s]
        :param period: of the steps that compute it [s]; a longer one is quicker
        """
        replanned, before = self.replanned, self.before
        if replanned is None:
            assert self.tick.plan_time is not None
            time = self.tick.plan_time + lead
            if time >= self.plan.duration:
                return self.plan.duration
            before = TimedVelocity(self.plan.velocity_at(time), self.plan.period)
            replanned = at_plan_time(self.plan, time)
        else:
            replanned, before = replanned.driven(self.factor, lead, period, before)
        return replanned.driven(0.0, math.inf, period, before)[0].plan_time


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

    def watch(self) -> Callable[[], PlanPoint | None]:
        """Return what tells any thread how far the plan is; it returns None without a plan."""

    def on_scan(self) -> None:
        """Note that an obstacle watch has compared a scan, or misses one; for any thread."""


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
        self._replanned: ReplannedTrajectory | None = None
        #: the velocity before the current tick
        self._before = TimedVelocity(ZERO, plan.period)
        self._ticks = self._as_planned(0, 0.0)
        self._tick = next(self._ticks, None)
        #: whether ``_point`` is wanted, which takes some time at each tick
        self._is_watched = False
        #: of the newest call of ``due``; None before
        self._point: PlanPoint | None = None

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """Return the velocity that is due, as :meth:`VelocitySource.due` says."""
        passed = 0
        while self._tick is not None and self._tick.deadline <= elapsed:
            self._pass(self._tick)
            passed += 1
        self.skipped = max(0, passed - 1)
        if self._tick is not None and factor != self._factor:
            self._change_factor(self._tick, factor)
        if self._is_watched and self._tick is not None:
            self._point = PlanPoint(
                self._plan, self._tick, factor, copy(self._replanned), self._before)
        return self._tick

    def watch(self) -> Callable[[], PlanPoint | None]:
        """Return what tells how far the plan is, as :meth:`VelocitySource.watch` says."""
        self._is_watched = True
        return lambda: self._point

    def on_scan(self) -> None:
        """Do nothing: the speed factor holds a plan."""

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
        self._before = TimedVelocity(tick.velocity, tick.deadline - tick.start)
        self._tick = next(self._ticks, None)
        if self._tick is None and self._replanned is not None:
            self._begin(self._replanned.following(), tick.deadline)

    def _change_factor(self, tick: Tick, factor: float) -> None:
        """Plan the current trajectory again from a tick on, for another speed factor."""
        self._factor = factor
        assert tick.plan_time is not None
        if self._replanned is None:
            self._replanned = at_plan_time(self._plan, tick.plan_time)
        if not self._replanned.has_begun:
            self._begin(self._replanned, tick.start)
            return
        self._ticks = self._replanned.ticks(factor, tick.start, self._before)
        self._tick = next(self._ticks, None)
        if self._tick is None:
            self._begin(self._replanned.following(), tick.start)

    def _begin(self, trajectory: ReplannedTrajectory | None, now: float) -> None:
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


def _rests(plan: Plan) -> Iterator[float]:
    for step, planned in enumerate(plan.steps):
        start = planned.start
        for number, trajectory in enumerate(planned.trajectories):
            if trajectory.duration and not velocity_before(plan, step, number):
                yield start
            start += trajectory.duration
