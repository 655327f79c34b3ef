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
Compute how far a fleet is in step from the velocities that were sent to its robots.

A robot has a *tick* wherever its plan wants a velocity; lateness is that of a message after its
tick.  Times of messages are the source timestamps of DDS, on the system clock [s].
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
import math
from typing import NamedTuple

from benchmarks.wire import movements, relative_error, Row
from kachaka_simple_control.analysis.message_timing import quantile
from kachaka_simple_control.analysis.plan_view import ticks
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.plan import Plan

#: Velocities and times that differ by less are equal [m/s, rad/s, s].
ROUNDING = 1e-9
#: By how much a message may be more punctual than all by which t = 0 is found [s].
EARLY = 0.005


class Sent(NamedTuple):
    """A velocity that was sent to a robot."""

    time: float
    linear_x: float
    angular_z: float

    @property
    def moves(self) -> bool:
        """Return whether it asks for motion."""
        return self.linear_x != 0.0 or self.angular_z != 0.0


class PlannedTick(NamedTuple):
    """When a plan wants a velocity [s after t = 0], and which."""

    due: float
    velocity: Velocity

    def is_sent(self, sent: Sent) -> bool:
        """Return whether a message has this velocity."""
        return (abs(sent.linear_x - self.velocity.linear_x) < ROUNDING
                and abs(sent.angular_z - self.velocity.angular_z) < ROUNDING)


#: The velocities sent to each robot, by its name, in order of time.
Records = Mapping[str, Sequence[Sent]]
#: For each robot the lateness of the message of each tick [s]; None for a tick without one.
Lateness = dict[str, list[float | None]]


def planned_ticks(plan: Plan) -> list[PlannedTick]:
    """Return the ticks of a plan at which a robot is to move."""
    return [
        PlannedTick(segment.start + number * plan.period, segment.velocity)
        for segment in plan.segments if segment.velocity != Velocity()
        for number in range(ticks(segment, plan.period))]


def firsts(records: Records) -> dict[str, float | None]:
    """Return when each robot was sent its first velocity that moves it; None if none was."""
    return {name: _first(sent, lambda one: one.moves) for name, sent in records.items()}


def first_zeros(records: Records, since: float) -> dict[str, float | None]:
    """Return when each robot was sent its first zero after a time; None if none was."""
    return {name: _first(sent, lambda one: one.time > since and not one.moves)
            for name, sent in records.items()}


def moved_after(records: Records, zeros: Mapping[str, float | None]) -> int:
    """Return how many velocities moved a robot after its zero, or that of another without one."""
    latest = max((zero for zero in zeros.values() if zero is not None), default=math.inf)
    return sum(one.moves and one.time > (zeros[name] or latest)
               for name, sent in records.items() for one in sent)


def lateness(records: Records, planned: Sequence[PlannedTick]) -> Lateness:
    """Return how late each message was after its tick, and after the most punctual of all."""
    origin = _origin(records, planned)
    guess = {name: _on_ticks(sent, planned, origin) for name, sent in records.items()}
    least = min(known(guess), default=0.0)
    return {name: [None if late is None else late - least for late in robot]
            for name, robot in guess.items()}


def known(late: Lateness) -> list[float]:
    """Return the lateness of all messages."""
    return [one for robot in late.values() for one in robot if one is not None]


def lost(late: Lateness) -> int:
    """Return how many ticks have no message."""
    return sum(one is None for robot in late.values() for one in robot)


def spreads(late: Lateness) -> list[float]:
    """Return for each tick by how much the robots were apart, at most [s]; infinite for none."""
    columns = ([one for one in column if one is not None] for column in zip(*late.values()))
    return [max(column) - min(column) if column else math.inf for column in columns]


def p99(values: Sequence[float]) -> float:
    """Return the 99th percentile; infinite without values."""
    return quantile(values, 0.99) if values else math.inf


def displacement_errors(records: Records, duration: float) -> list[float]:
    """Return the relative error of each movement of a duration [s] with one forward velocity."""
    return [relative_error(rows, duration) for sent in records.values()
            for rows in movements(Row(one.time, one.linear_x) for one in sent)]


def departure(
        sent: Iterable[Sent], planned: Sequence[PlannedTick], rests: Sequence[float],
        resumed: float) -> float | None:
    """
    Return when a robot would have begun its plan, by its first step as planned after a pause.

    From there to its end it was sent the velocities of the plan.

    :param rests: when the steps of the plan begin, before which the robot is at rest [s]
    :param resumed: when the pause ended [s, system clock]
    :returns: the time of this step's first message minus its tick; None if there is no such step
    """
    moving = [one for one in sent if one.moves]
    count = 0
    while count < min(len(moving), len(planned)) and planned[-1 - count].is_sent(
            moving[-1 - count]):
        count += 1
    if not count:
        return None
    begun = [(planned[-1 - number].due, moving[-1 - number].time) for number in range(count)]
    return next((time - rest for rest in sorted(rests) for due, time in begun
                 if abs(due - rest) < ROUNDING and time > resumed), None)


def _first(sent: Iterable[Sent], condition: Callable[[Sent], bool]) -> float | None:
    return next((one.time for one in sent if condition(one)), None)


def _origin(records: Records, planned: Sequence[PlannedTick]) -> float:
    """
    Return t = 0 by the most punctual message that begins a velocity [s, system clock].

    Which tick that belongs to needs no time, and the first message of a drive is often late.
    """
    begun = [number for number, tick in enumerate(planned)
             if not number or tick.velocity != planned[number - 1].velocity]
    times = []
    for sent in records.values():
        runs = groupby((one for one in sent if one.moves), key=lambda one: one[1:])
        for (_, run), number in zip(runs, begun):
            first = next(run)
            if not planned[number].is_sent(first):
                break
            times.append(first.time - planned[number].due)
    return min(times, default=0.0)


def _on_ticks(
        messages: Iterable[Sent], planned: Sequence[PlannedTick],
        origin: float) -> list[float | None]:
    """Give each message to the last tick before it that has its velocity, and none yet."""
    found: list[float | None] = [None] * len(planned)
    last = -1
    for sent in messages:
        after = bisect_right(planned, sent.time - origin + EARLY, key=lambda tick: tick.due)
        tick = next((tick for tick in range(after - 1, last, -1) if planned[tick].is_sent(sent)),
                    None)
        if tick is not None:
            last, found[tick] = tick, sent.time - origin - planned[tick].due
    return found
