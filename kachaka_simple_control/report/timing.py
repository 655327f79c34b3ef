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
"""How the messages of a drive stand to the times at which they were due; pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.report.preview import ticks
from kachaka_simple_control.report.quantiles import Quantiles, quantiles
from kachaka_simple_control.report.record import DrivenMotion

#: A tick counts as late when its message comes this part of a period away from its time, or more.
LATE = 0.25
#: No message came within this part of a period of its time: the tick is lost.
LOST = 0.5


@dataclass(frozen=True)
class Timing:
    """
    How exactly a drive was timed.

    :param due: how many ticks there were: times at which the plans wanted a message
    :param late: how many came, but a quarter of a period or more from their time
    :param lost: for how many nothing came within half a period of their time
    :param uneven: by how much each interval between two messages was longer than it was due [s]
    :param lateness: how far each message was from its time [s]; None if there was none
    :param jitter: how far each interval was from what was due [s]; None if there was none
    :param periods: the periods that were sent with, without repetition [s]
    """

    due: int
    late: int
    lost: int
    uneven: tuple[float, ...]
    lateness: Quantiles | None
    jitter: Quantiles | None
    periods: tuple[float, ...]


def timing(motions: Sequence[DrivenMotion]) -> Timing:
    """
    Hold the messages of some motions against their plans.

    :param motions: the motions; those that never began say nothing
    :returns: what they come to together
    """
    late = lost = due = 0
    uneven: list[float] = []
    away: list[float] = []
    begun = [motion for motion in motions if motion.has_begun]
    for motion in begun:
        period = motion.plan.period
        wanted = due_times(motion.plan, _until(motion))
        came = _messages(wanted, [sent.time - motion.began for sent in motion.own_messages[:-1]])
        nearest = [None if time is None else time - at for at, time in zip(wanted, came)]
        gone = sum(off is None or abs(off) > LOST * period for off in nearest)
        due, lost = due + len(wanted), lost + gone
        late += sum(off is None or abs(off) >= LATE * period for off in nearest) - gone
        away += [abs(off) for off in nearest if off is not None]
        uneven += _uneven(wanted, came)
    return Timing(
        due, late, lost, tuple(uneven), quantiles(away), quantiles([abs(off) for off in uneven]),
        tuple(dict.fromkeys(motion.plan.period for motion in begun)))


def due_times(plan: Plan, until: float) -> list[float]:
    """
    Return the times at which a plan wants a message: each change, and each period in between.

    :param plan: the plan
    :param until: where to end [s after t = 0]; not included
    :returns: the times [s after t = 0], in order, without the zero at the end
    """
    times = [segment.start + number * plan.period for segment in plan.segments
             for number in range(ticks(segment, plan.period))]
    return times[:bisect_left(times, until)]


def _until(motion: DrivenMotion) -> float:
    if motion.is_whole or not motion.own_messages:
        return motion.plan.duration
    # A tick that the stop came before cannot be late any more.
    end = motion.own_messages[-1].time - motion.began
    return min(motion.plan.duration, end - LOST * motion.plan.period)


def _messages(wanted: Sequence[float], times: Sequence[float]) -> list[float | None]:
    """Return for each tick the message that came nearest to it, of those that no other is to."""
    found: list[float | None] = [None] * len(wanted)
    tick = 0
    for time in times:
        while tick + 1 < len(wanted) and wanted[tick + 1] - time <= time - wanted[tick]:
            tick += 1
        if tick < len(wanted):
            before = found[tick]
            if before is None or abs(time - wanted[tick]) < abs(before - wanted[tick]):
                found[tick] = time
    return found


def _uneven(wanted: Sequence[float], came: Sequence[float | None]) -> list[float]:
    # What was due after a message was the next tick's, whether that came or not.
    there = [(tick, time) for tick, time in enumerate(came) if time is not None]
    return [two - one - (wanted[tick + 1] - wanted[tick])
            for (tick, one), (_, two) in pairwise(there)]
