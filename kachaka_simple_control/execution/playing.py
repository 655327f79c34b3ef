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
"""Drive a plan in real time, in the thread that asks for it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
import time
from typing import Protocol

from kachaka_simple_control.execution.pacing import sleep_until
from kachaka_simple_control.execution.player import Player
from kachaka_simple_control.execution.publisher_edge import PublisherEdge, Run
from kachaka_simple_control.motion.kinematics import ZERO
from kachaka_simple_control.motion.plan import Plan

#: What a run may be late beyond one period [s] before it is given up.
LATENESS = 0.1
#: No use is known for more [Hz].
HIGHEST_RATE = 1000.0


class Companion(Protocol):
    """What goes along with a run, in its thread; each call returns as soon as DDS lets it."""

    def tick(self, rest: float) -> None:
        """
        Do what is due after a message was sent.

        :param rest: how long the plan stays at rest from here [s]; 0 while moving
        """

    def beat(self) -> None:
        """Raise what ends the run, if anything does."""


def max_gap(period: float, hold: float) -> float:
    """
    Return the longest time between two messages that is no fault.

    :param period: time between two messages when all is well [s]
    :param hold: how long the robot keeps a velocity without a new one [s]
    :returns: one period and the lateness allowed, but never more than the hold [s]
    """
    return min(period + LATENESS, hold)


def lowest_rate(hold: float) -> float:
    """
    Return how often a velocity must be sent at least.

    :param hold: how long the robot keeps a velocity without a new one [s]
    :returns: the rate at which a message may be late, and the robot still moves on [Hz]
    """
    return 1.0 / (hold - LATENESS)


def play(
        plan: Plan,
        edge: PublisherEdge,
        hold: float,
        companion: Companion,
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
        edge.wait_for_dds(run, companion.beat)

    beat()
    player = Player(plan)
    due = player.due(0.0)
    while due is not None:
        edge.send(run, due.velocity)
        edge.wait_for_dds(run, partial(companion.tick, due.rest))
        sleep_until(run.began + due.deadline, beat, clock, sleep)
        # The deadline has passed, even if the difference of two clock readings rounds below it.
        due = player.due(max(clock() - run.began, due.deadline))
    edge.send(run, ZERO)
    return run
