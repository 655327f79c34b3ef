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
Keep robots in step that each drive a plan of their own, also after a pause.

A pause brakes each robot within its own limits, so the plans are late by different times.  At its
next rest each robot waits until all are equally late.  Tested by test/control/test_in_step.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math

from kachaka_simple_control.control.events import RobotsApart, VelocityKind
from kachaka_simple_control.control.speed_factor import is_hold
from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.control.tick_scheduler import PlanPoint, TickScheduler
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.motion.plan import Plan

#: Delays that differ by less come from rounding [s].
ROUNDING = 1e-6


class InStep:
    """
    Has a velocity source for each robot of a drive; one thread calls them all.

    :param publish: called when robots that were apart have agreed when to go on
    """

    def __init__(
            self, plans: Sequence[Plan],
            publish: Callable[[RobotsApart], None] = lambda _: None) -> None:
        self._publish = publish
        self.sources = [PlanInStep(self, plan) for plan in plans]
        #: by how much all plans are late [s]; None while that is open
        self._delay: float | None = 0.0

    def reopen(self) -> None:
        """Agree anew, because the speed factor of a robot has changed."""
        self._delay = None

    def is_agreed(self, delay: float | None) -> bool:
        """Return whether a plan that is late by a time is as late as all are to be [s]."""
        return delay is not None and self._delay is not None and (
            abs(delay - self._delay) <= ROUNDING)

    def agreed(self, now: float) -> float | None:
        """
        Return by how much all plans are to be late [s]; None while one is on its way to a rest.

        :param now: [s after t = 0]
        """
        if self._delay is None:
            under_way = [source for source in self.sources if not source.is_over]
            delays = [delay for source in under_way if (delay := source.delay) is not None]
            if len(delays) < len(under_way):
                return None
            self._delay = max(source.earliest_delay for source in under_way)
            if (apart := max(delays) - min(delays)) > ROUNDING:
                self._publish(RobotsApart(now, now - max(delays), apart, len(delays)))
        return self._delay


class PlanInStep:
    """
    The velocity source of one robot: a plan that waits at a rest for those of other robots.

    :ivar is_over: whether no robot has to wait for this one any more
    """

    kind = VelocityKind.PLAN

    def __init__(self, group: InStep, plan: Plan) -> None:
        self._group, self._plan, self._period = group, TickScheduler(plan), plan.period
        self.plan_duration = self._plan.plan_duration
        self.skipped = 0
        self.is_over = False
        self._factor = 1.0
        #: the total time of all waits so far [s]
        self._waited = 0.0
        #: the zero velocity that is sent while this robot waits; None while it drives
        self._zero: Tick | None = None
        #: when it would have gone on without this wait, by the time of ``_plan`` [s]
        self._arrived = 0.0
        #: the deadline of the newest tick of ``_plan``, by its time [s]
        self._deadline = 0.0

    @property
    def delay(self) -> float | None:
        """Return by how much the plan is late, without the present wait [s]; None if open."""
        delay = None if is_hold(self._factor) else self._plan.delay
        return None if delay is None else delay + self._waited

    @property
    def earliest_delay(self) -> float:
        """Return the least delay with which the robot can go on, once ``delay`` is known [s]."""
        delay, rest = self.delay or 0.0, self._plan.rest
        # It has promised a zero until then, and is not called before.
        return delay if self._zero is None or rest is None else max(
            delay, self._zero.deadline - rest)

    def watch(self) -> Callable[[], PlanPoint | None]:
        """Return what tells how far the plan is, as ``VelocitySource.watch`` says."""
        return self._plan.watch()

    def on_scan(self) -> None:
        """Do nothing: the speed factor holds a plan."""

    def due(self, elapsed: float, factor: float = 1.0) -> Tick | None:
        """Return the velocity that is due, as ``VelocitySource.due`` says."""
        if factor != self._factor:
            self._factor = factor
            self._group.reopen()
        while True:
            if self._zero is None:
                tick = self._drive(elapsed, factor)
                if tick is None:
                    self.is_over = True
                    return None
                self._zero = self._next_zero(tick.start)
                if self._zero is None:
                    return tick
            else:
                self._plan.due(self._arrived, factor)
            if elapsed < self._zero.deadline:
                return self._zero
            self._zero = self._next_zero(self._zero.deadline)

    def _drive(self, elapsed: float, factor: float) -> Tick | None:
        # A deadline that has passed may be a rounding error ahead by the time of the plan.
        has_passed = elapsed >= self._deadline + self._waited
        tick = self._plan.due(
            max(elapsed - self._waited, self._deadline if has_passed else 0.0), factor)
        self.skipped = self._plan.skipped
        if tick is None:
            return None
        self._arrived, self._deadline = tick.start, tick.deadline
        return tick._replace(
            start=tick.start + self._waited, deadline=tick.deadline + self._waited)

    def _next_zero(self, now: float) -> Tick | None:
        """Return the zero velocity of a robot that waits; None if it drives on, or drives."""
        if self._group.is_agreed(self.delay) or (rest := self._plan.rest) is None:
            return None
        end, is_held = now + self._period, is_hold(self._factor)
        if not is_held and (delay := self._group.agreed(now)) is not None:
            if rest + delay <= now + ROUNDING:
                self._waited, self._deadline = now - self._arrived, self._arrived
                return None
            end = min(end, rest + delay)
        return Tick(ZERO, now, end, math.inf if is_held else end - now, rest)
