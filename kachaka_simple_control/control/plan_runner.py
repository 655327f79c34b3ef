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

#: A last tick shorter than this part of a period is a rounding error, not a tick.
TIME_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Tick:
    """
    What is due at a time.

    :param velocity: the velocity to send now
    :param deadline: when the next tick is due [s after t = 0]
    :param skipped: number of ticks before this one that were never asked for
    :param rest: how long the plan stays at rest from the start of this tick [s]; 0 while moving
    """

    velocity: Velocity
    deadline: float
    skipped: int
    rest: float


class TickScheduler:
    """
    Walks a plan once: told the time, it returns the velocity due.  No clock.

    Deadlines are absolute: they follow from the plan alone.  A late call returns what is due by
    then and moves no later deadline.

    :param plan: the plan to walk
    """

    def __init__(self, plan: Plan) -> None:
        self._segments = iter(plan.segments)
        self._period = plan.period
        self._answered = False
        self._segment: Segment | None
        self._deadline: float
        self._enter_next()

    def due(self, elapsed: float) -> Tick | None:
        """
        Return the tick that is due; call it at 0 first, then at each deadline.

        :param elapsed: time since t = 0 [s], never less than before
        :returns: the tick; None when the plan is over
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
    """Periodic checks during a run, in its thread; each call must be quick."""

    def on_sent(self, rest: float) -> None:
        """
        Do what is due after a message was sent.

        :param rest: how long the plan stays at rest from here [s]; 0 while moving
        """

    def check(self) -> None:
        """
        Look for faults.

        :raises ControlError: if the run must end
        """


def max_gap(period: float, command_timeout: float) -> float:
    """
    Return the longest time between two messages that is no fault [s].

    :param period: time between two messages in good conditions [s]
    :param command_timeout: how long the robot keeps a velocity [s]; the gap is never longer
    """
    return min(period + MAX_LATENESS, command_timeout)


def min_rate(command_timeout: float) -> float:
    """
    Return the lowest rate at which a late message still finds the robot moving [Hz].

    :param command_timeout: how long the robot keeps a velocity [s]
    """
    return 1.0 / (command_timeout - MAX_LATENESS)


def run_plan(
        plan: Plan,
        gate: VelocityGate,
        command_timeout: float,
        monitor: RunMonitor,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        prepared: Run | None = None) -> Run:
    """
    Run a plan from its first velocity to the zero after its last.

    :param plan: the plan to run
    :param gate: the velocity gate
    :param command_timeout: how long the robot keeps a velocity [s]
    :param monitor: called after each message, and every POLL_PERIOD or more often
    :param clock: the steady clock [s]
    :param sleep: sleeps for a time [s]
    :param prepared: the run that the gate prepared for it; None for a new one
    :returns: the run, which has sent one zero; the whole stop is the caller's
    :raises ControlError: if the run was stopped or could not go on
    """
    run = gate.begin(max_gap(plan.period, command_timeout), prepared, command_timeout)

    def check() -> None:
        gate.check(run)
        gate.wait_for_dds(run, monitor.check)

    check()
    scheduler = TickScheduler(plan)
    tick = scheduler.due(0.0)
    while tick is not None:
        gate.send(run, tick.velocity)
        gate.wait_for_dds(run, partial(monitor.on_sent, tick.rest))
        sleep_until(run.began + tick.deadline, check, clock, sleep)
        # The deadline has passed, even if the difference of two clock readings rounds below it.
        tick = scheduler.due(max(clock() - run.began, tick.deadline))
    gate.send(run, ZERO)
    return run
