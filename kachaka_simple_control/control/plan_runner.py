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
"""Run a plan in real time: which velocity is due when, and the loop that sends it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
import time
from typing import Protocol

from kachaka_simple_control.control.timing import MAX_LATENESS
from kachaka_simple_control.control.velocity_gate import Run, VelocityGate
from kachaka_simple_control.control.waiting import sleep_until
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.plan import Plan, Segment

#: A last tick shorter than this part of a period is rounding, not a tick.
TIME_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Tick:
    """
    What a player answers.

    :param velocity: the velocity to send now
    :param deadline: when to ask again [s after t = 0]
    :param skipped: ticks before this one whose time passed without an answer
    :param rest: how long the plan stays at rest from the start of this tick [s]; 0 while moving
    """

    velocity: Velocity
    deadline: float
    skipped: int
    rest: float


class TickScheduler:
    """
    One walk through a plan; pure, so that any clock can drive it.

    Deadlines are absolute: they come from the plan alone.  An answer asked for late is what is
    due by then, and moves no deadline after it.
    """

    def __init__(self, plan: Plan) -> None:
        """
        Stand before the first tick.

        :param plan: what to walk
        """
        self._segments = iter(plan.segments)
        self._period = plan.period
        self._answered = False
        self._segment: Segment | None
        self._deadline: float
        self._enter_next()

    def due(self, elapsed: float) -> Tick | None:
        """
        Return what is due; ask at 0 first, then at each deadline.

        :param elapsed: time since t = 0 [s], never less than before
        :returns: the velocity to send, or None when the plan is over
        """
        skipped = 0
        while self._segment is not None and self._deadline <= elapsed:
            skipped += not self._answered
            self._answered = False
            self._pass_tick(self._segment)
        if self._segment is None:
            return None
        self._answered = True
        return Tick(self._segment.velocity, self._deadline, skipped, self._rest(self._segment))

    def _pass_tick(self, segment: Segment) -> None:
        if self._deadline >= segment.end:
            self._enter_next()
        else:
            self._tick += 1
            self._deadline = self._end_of_tick(segment)

    def _enter_next(self) -> None:
        self._segment = next(self._segments, None)
        self._tick = 0
        if self._segment is not None:
            self._deadline = self._end_of_tick(self._segment)

    def _end_of_tick(self, segment: Segment) -> float:
        following = segment.start + (self._tick + 1) * self._period
        nearly = following >= segment.end - TIME_TOLERANCE * self._period
        return segment.end if nearly else following

    def _rest(self, segment: Segment) -> float:
        if not segment.velocity.is_zero:
            return 0.0
        return segment.end - segment.start - self._tick * self._period


class RunMonitor(Protocol):
    """What goes along with a run, in its thread; each call returns as soon as DDS lets it."""

    def on_sent(self, rest: float) -> None:
        """
        Do what is due after a message was sent.

        :param rest: how long the plan stays at rest from here [s]; 0 while moving
        """

    def check(self) -> None:
        """Raise what ends the run, if anything does."""


def max_gap(period: float, hold: float) -> float:
    """
    Return the longest time between two messages that is no fault.

    :param period: time between two messages when all is well [s]
    :param hold: how long the robot keeps a velocity without a new one [s]
    :returns: one period and the lateness allowed, but never more than the hold [s]
    """
    return min(period + MAX_LATENESS, hold)


def min_rate(hold: float) -> float:
    """
    Return how often a velocity must be sent at least.

    :param hold: how long the robot keeps a velocity without a new one [s]
    :returns: the rate at which a message may be late, and the robot still moves on [Hz]
    """
    return 1.0 / (hold - MAX_LATENESS)


def run_plan(
        plan: Plan,
        edge: VelocityGate,
        hold: float,
        companion: RunMonitor,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        prepared: Run | None = None) -> Run:
    """
    Drive a plan from its first velocity to the zero after its last.

    :param plan: what to drive
    :param edge: where velocities go
    :param hold: how long the robot keeps a velocity without a new one [s]
    :param companion: called after each message and at least every 20 ms
    :param clock: the steady clock [s]
    :param sleep: sleeps for a time [s]
    :param prepared: what the edge prepared for it; None for a new one
    :returns: the run, which has sent its zero; the stop is the caller's
    :raises ControlError: if the run was stopped or could not go on
    """
    run = edge.begin(max_gap(plan.period, hold), prepared, hold)

    def beat() -> None:
        edge.check(run)
        edge.wait_for_dds(run, companion.check)

    beat()
    player = TickScheduler(plan)
    due = player.due(0.0)
    while due is not None:
        edge.send(run, due.velocity)
        edge.wait_for_dds(run, partial(companion.on_sent, due.rest))
        sleep_until(run.began + due.deadline, beat, clock, sleep)
        # The deadline has passed, even if the difference of two clock readings rounds below it.
        due = player.due(max(clock() - run.began, due.deadline))
    edge.send(run, ZERO)
    return run
