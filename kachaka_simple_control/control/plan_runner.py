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
"""Run a plan in real time: the loop that sends each velocity when it is due."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import time
from typing import Protocol

from kachaka_simple_control.control.tick_scheduler import Tick, TickScheduler
from kachaka_simple_control.control.timing import MAX_LATENESS
from kachaka_simple_control.control.velocity_gate import Run, VelocityGate
from kachaka_simple_control.control.waiting import sleep_until
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.plan import Plan


class RunMonitor(Protocol):
    """What a run asks and tells in its thread; each call must be quick."""

    @property
    def speed_factor(self) -> float:
        """Return the speed factor, from 0 to 1; 1: as planned."""

    def correct(self, tick: Tick, now: float) -> Velocity:
        """
        Return the velocity to send for a tick: its own, or one that odometry corrects.

        :param now: when it is sent [s on the clock]
        :raises ControlError: if the run must end
        """

    def on_sent(self, rest: float) -> None:
        """
        Do what is due after a message was sent.

        :param rest: how long the robot stays at rest from here [s]; 0 while moving, infinite
            while it is held by a speed factor of 0
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
    tick = scheduler.due(0.0, monitor.speed_factor)
    is_delayed = False
    while tick is not None:
        is_delayed = is_delayed or tick.plan_time != tick.start
        velocity = monitor.correct(tick, clock())
        gate.send(run, velocity, tick.plan_time if is_delayed else None)
        gate.wait_for_dds(run, partial(
            monitor.on_sent, tick.rest if velocity.is_zero else 0.0))
        sleep_until(run.began + tick.deadline, check, clock, sleep)
        # The deadline has passed, even if the difference of two clock readings rounds below it.
        tick = scheduler.due(max(clock() - run.began, tick.deadline), monitor.speed_factor)
    gate.send(run, ZERO, plan.duration if is_delayed else None)
    return run
