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
"""Figures of a drive: displacement, errors, timing, quantiles."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import (
    compose,
    Displacement,
    distance_between,
    integrate,
    ORIGIN,
    Pose,
)
from kachaka_simple_control.motion.plan import Plan, PlannedStep, Segment
from kachaka_simple_control.report.drive_log import MotionLog, StepLog
from kachaka_simple_control.report.plan_view import ticks
from kachaka_simple_control.telemetry.events import OdometryReceived, VelocitySent


@dataclass(frozen=True)
class Quantiles:
    """
    What some numbers come to.

    :param median: half of them are smaller
    :param p99: 99 of 100 are smaller
    :param worst: none is larger
    """

    median: float
    p99: float
    worst: float


def quantiles(values: Sequence[float]) -> Quantiles | None:
    """
    Return what some numbers come to.

    :param values: the numbers, in any order
    :returns: it; None if there are none
    """
    if not values:
        return None
    ordered = sorted(values)
    return Quantiles(median(ordered), quantile(ordered, 0.99), ordered[-1])


def quantile(values: Sequence[float], part: float) -> float:
    """
    Return the value below which a part of the values lies.

    :param values: at least one number, in any order; infinity is one
    :param part: from 0, the least, to 1, the greatest
    :returns: the value, interpolated between the two nearest
    """
    ordered = sorted(values)
    place = part * (len(ordered) - 1)
    below = min(int(place), len(ordered) - 1)
    above = min(below + 1, len(ordered) - 1)
    if place <= below or ordered[above] == ordered[below]:
        return ordered[below]  # also where infinity would make a difference that is no number
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def median(values: Sequence[float]) -> float:
    """
    Return the value in the middle.

    :param values: at least one number, in any order
    :returns: the median
    """
    return quantile(values, 0.5)


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


def timing(motions: Sequence[MotionLog]) -> Timing:
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


def _until(motion: MotionLog) -> float:
    if motion.is_complete or not motion.own_messages:
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


#: How long after a velocity was sent odometry surely shows it [s]: two of its samples and more.
SETTLING = 0.06


def sent(messages: Sequence[VelocitySent], hold: float = math.inf) -> Displacement:
    """
    Return what a receiver is told that holds each velocity until the next message.

    :param messages: what was sent, in order; the last one only ends the one before
    :param hold: how long the receiver keeps a velocity at most [s]
    :returns: the sum of velocity times interval
    """
    held = [(one.velocity, min(two.time - one.time, hold)) for one, two in pairwise(messages)]
    return Displacement(
        math.fsum(velocity.linear_x * interval for velocity, interval in held),
        math.fsum(velocity.angular_z * interval for velocity, interval in held))


def driven(odometry: Sequence[OdometryReceived], begin: float, end: float) -> Displacement | None:
    """
    Return how far odometry saw the robot go between two times.

    :param odometry: the poses that arrived, in order of time
    :param begin: from when [s]
    :param end: until when [s]
    :returns: the displacement; None if odometry does not cover that time
    """
    if not odometry or odometry[0].time > begin or odometry[-1].time < end:
        return None
    first = bisect_left(odometry, begin, key=_time)
    last = bisect_left(odometry, end, key=_time)
    poses = [pose_at(odometry, begin), *(o.pose for o in odometry[first:last]),
             pose_at(odometry, end)]
    return Displacement(
        math.fsum(_forward(one, two) for one, two in pairwise(poses)),
        math.fsum(_wrapped(two.theta - one.theta) for one, two in pairwise(poses)))


def segment_odometry(
        movements: Sequence[StepLog], odometry: Sequence[OdometryReceived]) -> list[float]:
    """
    Return where to cut odometry so that each movement gets what it moved.

    Commands and odometry take their time on the way, and odometry is sampled.  Where a movement
    meets a rest the cut is therefore made in the rest, a little aside.  A drive that begins with
    a rest begins with the first odometry: nothing moved before it.

    :param movements: the movements, in order
    :param odometry: the poses that arrived, in order
    :returns: one time more than there are movements [s]
    """
    first = movements[0]
    cuts = [first.began]
    if odometry and first.step.is_rest:
        cuts = [min(max(cuts[0], odometry[0].time), first.sent[-1].time)]
    for before, after in pairwise(movements):
        aside = SETTLING * (after.step.is_rest - before.step.is_rest)
        cuts.append(max(cuts[-1], after.sent[0].time + aside))
    return [*cuts, max(cuts[-1], movements[-1].sent[-1].time)]


def pose_at(odometry: Sequence[OdometryReceived], time: float) -> Pose:
    """
    Return the pose at a time, between the two samples around it.

    :param odometry: the poses that arrived, in order, covering the time
    :param time: when [s]
    :returns: the pose, interpolated linearly
    """
    after = odometry[bisect_left(odometry, time, key=_time)]
    before = odometry[max(0, bisect_left(odometry, time, key=_time) - 1)]
    if after.time <= before.time:
        return after.pose
    part = (time - before.time) / (after.time - before.time)
    one, two = before.pose, after.pose
    return Pose(
        one.x + part * (two.x - one.x),
        one.y + part * (two.y - one.y),
        one.theta + part * _wrapped(two.theta - one.theta))


def _time(answer: OdometryReceived) -> float:
    return answer.time


def _forward(one: Pose, two: Pose) -> float:
    # The chord's part along the heading half-way: its sign tells forwards from backwards.
    heading = one.theta + _wrapped(two.theta - one.theta) / 2.0
    return (two.x - one.x) * math.cos(heading) + (two.y - one.y) * math.sin(heading)


def _wrapped(angle: float) -> float:
    # Odometry tells headings within a turn; between two samples a robot turns less than half.
    return math.remainder(angle, math.tau)


@dataclass(frozen=True)
class StepResult:
    """
    One step that was begun, and what became of it.

    :param movement: the step and its messages
    :param motion: the name of its motion
    :param requested: what it asks for
    :param sent: what was sent
    :param odometry: what odometry saw; None if it does not cover the step
    """

    movement: StepLog
    motion: str
    requested: Displacement
    sent: Displacement
    odometry: Displacement | None

    @property
    def error(self) -> Displacement | None:
        """
        Return by how much odometry saw the robot go too far.

        Beside what was asked for; of a step that was cut short, beside what was sent.
        """
        if self.odometry is None:
            return None
        wanted = self.requested if self.movement.is_complete else self.sent
        return Displacement(
            self.odometry.distance - wanted.distance, self.odometry.angle - wanted.angle)


def step_results(
        movements: Sequence[StepLog], names: Sequence[str], odometry: Sequence[OdometryReceived],
        hold: float = math.inf) -> list[StepResult]:
    """
    Hold each step's messages and odometry against what it asked for.

    :param movements: the steps that were begun, in order
    :param names: the name of the motion of each
    :param odometry: the poses that arrived, in order
    :param hold: how long the robot keeps a velocity without a new one [s]
    :returns: the steps
    """
    if not movements:
        return []
    cuts = pairwise(segment_odometry(movements, odometry))
    return [
        StepResult(movement, name, movement.step.displacement, sent(movement.sent, hold),
                   driven(odometry, begin, end))
        for movement, name, (begin, end) in zip(movements, names, cuts)]


#: By how much a turn of the lesson's loop is longer than its period [s].  Measured by the
#: benchmarks, docs/why.md: at 10 Hz a second is held for about 0.8 % too long, in ten turns.
EXTRA = 0.0008


@dataclass(frozen=True)
class SleepLoopEstimate:
    """
    What a loop would have made of some plans that publishes, waits, and begins again.

    :param longer: by how much it would have taken longer [s]
    :param missing: how many messages fewer it would have sent
    :param distance: how far from the planned end the robot would have ended [m]
    :param angle: by how much it would have turned too far [rad], positive to the left
    """

    longer: float
    missing: int
    distance: float
    angle: float


def estimate_sleep_loop(plans: Sequence[Plan]) -> SleepLoopEstimate:
    """
    Let the lesson's loop walk some plans, one after the other.

    Each turn publishes what is due, waits for as long as that is to be held, a period at most, and
    takes a little longer than that; a step is over with the turn in which its time is up, and the
    next begins then.

    :param plans: the plans
    :returns: what it would have made of them, for a robot that does exactly as it is told
    """
    pose = wanted = ORIGIN
    took = 0.0
    turns = 0
    for plan in plans:
        wanted = compose(wanted, plan.pose)
        ways: dict[str, _LoopStep] = {}
        index = 0
        for stage in plan.steps:
            count = _count(plan.segments, index, stage)
            if stage.path not in ways:
                ways[stage.path] = _loop_step(
                    stage, plan.segments[index:index + count], plan.period)
            index += count
            way = ways[stage.path]
            pose, took, turns = compose(pose, way.end), took + way.took, turns + way.turns
    distance, angle = distance_between(wanted, pose)
    due = sum(ticks(segment, plan.period) for plan in plans for segment in plan.segments)
    return SleepLoopEstimate(
        took - sum(plan.duration for plan in plans), due - turns, distance, angle)


class _LoopStep(NamedTuple):
    """The loop's way through a step; the same each time that the step is repeated."""

    end: Pose
    took: float
    turns: int


def _count(segments: Sequence[Segment], first: int, stage: PlannedStep) -> int:
    return bisect_left(segments, stage.end, first, key=_start) - first


def _loop_step(stage: PlannedStep, segments: Sequence[Segment], period: float) -> _LoopStep:
    pose, time, turns, index = ORIGIN, stage.start, 0, 0
    while segments and time < stage.end:
        while index + 1 < len(segments) and segments[index].end <= time:
            index += 1
        segment = segments[index]
        turn = min(period, segment.end - segment.start) + EXTRA
        if not segment.velocity.is_zero:
            pose = integrate(pose, segment.velocity, turn)
        time += turn
        turns += 1
    return _LoopStep(pose, time - stage.start, turns)


def _start(segment: Segment) -> float:
    return segment.start
