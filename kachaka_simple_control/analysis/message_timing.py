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
"""Compare the times at which velocity messages were sent with the times that the plans require."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, takewhile

from kachaka_simple_control.analysis.drive_log import MotionLog, ROUNDING
from kachaka_simple_control.analysis.plan_view import ticks
from kachaka_simple_control.control.events import VelocitySent
from kachaka_simple_control.control.robot_drive import LATE
from kachaka_simple_control.motion.plan import Plan


@dataclass(frozen=True)
class Quantiles:
    """The median, the 99th percentile and the largest value of a set of numbers."""

    median: float
    p99: float
    worst: float


def quantiles(values: Sequence[float]) -> Quantiles | None:
    """Return the median, the 99th percentile and the largest value; None without values."""
    if not values:
        return None
    ordered = sorted(values)
    return Quantiles(median(ordered), quantile(ordered, 0.99), ordered[-1])


def quantile(values: Sequence[float], part: float) -> float:
    """
    Return the value below which a given fraction of at least one number lies.

    :param part: the fraction, from 0 to 1; 0 gives the smallest number, and 1 the largest
    """
    ordered = sorted(values)
    place = part * (len(ordered) - 1)
    below = min(int(place), len(ordered) - 1)
    above = min(below + 1, len(ordered) - 1)
    if place <= below or ordered[above] == ordered[below]:
        return ordered[below]  # avoid NaN from the difference of two infinities
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def median(values: Sequence[float]) -> float:
    """Return the median of one or more numbers, in any order."""
    return quantile(values, 0.5)


#: A tick is a time at which a plan requires a message.  The tick is lost if no message was sent
#: within this fraction of a period before or after it.
LOST = 0.5


@dataclass(frozen=True)
class Timing:
    """
    The timing accuracy of the velocity messages of a drive.

    :param late: the number of ticks whose message was off by 1/4 to 1/2 of the period
    :param lost: the number of ticks without a message up to 1/2 of the period before or after
    :param interval_errors: between consecutive messages: the real interval minus the planned one
        [s]; about one period if a message is missing
    :param lateness: quantiles of the absolute differences between messages and ticks [s]; None
        without messages
    :param jitter: quantiles of the absolute ``interval_errors`` [s]; None if there are none
    :param periods: of the plans, without duplicates [s]
    :param unjudged: the number of messages that a pause or a lower speed keeps from being
        compared: in each motion, from the first delayed one on
    """

    due: int
    late: int
    lost: int
    interval_errors: tuple[float, ...]
    lateness: Quantiles | None
    jitter: Quantiles | None
    periods: tuple[float, ...]
    unjudged: int = 0


def timing(motions: Sequence[MotionLog]) -> Timing:
    """
    Compare the messages of motions with their plans, up to the first one that was delayed.

    Motions that never started do not count.
    """
    late = lost = due = unjudged = 0
    interval_errors: list[float] = []
    lateness: list[float] = []
    begun = [motion for motion in motions if motion.has_begun]
    for motion in begun:
        period = motion.plan.period
        messages = [message for message in motion.own_messages if message.is_of_run]
        if motion.is_complete and messages:
            messages.pop()  # the zero velocity at the end has no tick
        as_planned = list(takewhile(lambda message: not message.is_delayed, messages))
        until = _timed_until(motion)
        if len(as_planned) < len(messages):
            unjudged += len(messages) - len(as_planned)
            until = as_planned[-1].time - motion.began + ROUNDING if as_planned else 0.0
        times = due_times(motion.plan, until)
        sent_at = _sent_at(times, as_planned, motion.began)
        errors = [None if time is None else time - at for at, time in zip(times, sent_at)]
        missed = sum(error is None or abs(error) > LOST * period for error in errors)
        due, lost = due + len(times), lost + missed
        late += sum(error is None or abs(error) >= LATE * period for error in errors) - missed
        lateness += [abs(error) for error in errors if error is not None]
        interval_errors += _interval_errors(times, sent_at)
    return Timing(
        due, late, lost, tuple(interval_errors), quantiles(lateness),
        quantiles([abs(error) for error in interval_errors]),
        tuple(dict.fromkeys(motion.plan.period for motion in begun)), unjudged)


def due_times(plan: Plan, until: float) -> list[float]:
    """
    Return when a plan requires messages [s after t = 0], without the zero at its end.

    :param until: leave out times at or after this one [s after t = 0]
    """
    times = [segment.start + number * plan.period for segment in plan.segments
             for number in range(ticks(segment, plan.period))]
    return times[:bisect_left(times, until)]


def _timed_until(motion: MotionLog) -> float:
    if motion.is_complete or not motion.own_messages:
        return motion.plan.duration
    # Ticks due after the stop do not count.
    end = motion.own_messages[-1].time - motion.began
    return min(motion.plan.duration, end - LOST * motion.plan.period)


def _sent_at(due: Sequence[float], messages: Sequence[VelocitySent],
             began: float) -> list[float | None]:
    """Return when the message of each tick was sent [s after t = 0]; None without one."""
    found: list[float | None] = [None] * len(due)
    for message in messages:
        tick = bisect_left(due, (message.due or 0.0) - ROUNDING)
        if tick < len(due):
            found[tick] = message.time - began
    return found


def _interval_errors(due: Sequence[float], sent_at: Sequence[float | None]) -> list[float]:
    # The planned interval ends at the next tick, even if no message was sent for that tick.
    messages = [(tick, time) for tick, time in enumerate(sent_at) if time is not None]
    return [two - one - (due[tick + 1] - due[tick])
            for (tick, one), (_, two) in pairwise(messages)]
