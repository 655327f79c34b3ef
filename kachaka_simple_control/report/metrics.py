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
from itertools import pairwise, takewhile
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
from kachaka_simple_control.report.plan_timeline import ROUNDING
from kachaka_simple_control.report.plan_view import ticks
from kachaka_simple_control.telemetry.events import OdometryReceived, VelocitySent


@dataclass(frozen=True)
class Quantiles:
    """The median, the 99th percentile and the largest of some numbers."""

    median: float
    p99: float
    worst: float


def quantiles(values: Sequence[float]) -> Quantiles | None:
    """Return the quantiles of numbers in any order; None if there are none."""
    if not values:
        return None
    ordered = sorted(values)
    return Quantiles(median(ordered), quantile(ordered, 0.99), ordered[-1])


def quantile(values: Sequence[float], part: float) -> float:
    """
    Return the value below which a part of the values lies.

    :param values: at least one number, in any order; may contain infinity
    :param part: from 0, the least, to 1, the greatest
    :returns: the value, interpolated between the two nearest
    """
    ordered = sorted(values)
    place = part * (len(ordered) - 1)
    below = min(int(place), len(ordered) - 1)
    above = min(below + 1, len(ordered) - 1)
    if place <= below or ordered[above] == ordered[below]:
        return ordered[below]  # the difference of two infinities is no number
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def median(values: Sequence[float]) -> float:
    """Return the median of at least one number, in any order."""
    return quantile(values, 0.5)


#: A tick is late if its message is this part of a period away from its time, or more.
LATE = 0.25
#: A tick is lost if no message came within this part of a period of its time.
LOST = 0.5


@dataclass(frozen=True)
class Timing:
    """
    How exactly a drive was timed.

    :param due: how many ticks there were: times at which the plans had a message
    :param late: how many came, but a quarter of a period or more from their time
    :param lost: for how many nothing came within half a period of their time
    :param interval_errors: by how much each interval between two messages was longer than due [s]
    :param lateness: how far each message was from its time [s]; None if there was none
    :param jitter: how far each interval was from the due one [s]; None if there was none
    :param periods: the periods of the plans, each once [s]
    :param unjudged: how many messages are left out, because from the first on that was not sent
        as planned no time is due by the plan: after a pause, or at less speed
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
    Compare the messages of motions with their plans, each as far as it was driven as planned.

    Motions that never began do not count.
    """
    late = lost = due = unjudged = 0
    interval_errors: list[float] = []
    lateness: list[float] = []
    begun = [motion for motion in motions if motion.has_begun]
    for motion in begun:
        period = motion.plan.period
        messages = motion.own_messages[:-1]
        as_planned = list(takewhile(lambda message: message.plan_time is None, messages))
        if len(as_planned) < len(messages):
            unjudged += len(messages) - len(as_planned)
            until = as_planned[-1].time - motion.began + ROUNDING if as_planned else 0.0
        else:
            until = _timed_until(motion)
        times = due_times(motion.plan, until)
        sent_at = _nearest_messages(
            times, [message.time - motion.began for message in as_planned])
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
    Return when messages of a plan are due: at each change, and each period in between.

    :param plan: the plan
    :param until: where to end [s after t = 0]; not included
    :returns: the times [s after t = 0], in order, without the zero at the end
    """
    times = [segment.start + number * plan.period for segment in plan.segments
             for number in range(ticks(segment, plan.period))]
    return times[:bisect_left(times, until)]


def _timed_until(motion: MotionLog) -> float:
    if motion.is_complete or not motion.own_messages:
        return motion.plan.duration
    # A tick that the stop preceded cannot be late any more.
    end = motion.own_messages[-1].time - motion.began
    return min(motion.plan.duration, end - LOST * motion.plan.period)


def _nearest_messages(due: Sequence[float], times: Sequence[float]) -> list[float | None]:
    """Return for each tick the nearest of the messages that are nearest to it; None: no such."""
    found: list[float | None] = [None] * len(due)
    tick = 0
    for time in times:
        while tick + 1 < len(due) and due[tick + 1] - time <= time - due[tick]:
            tick += 1
        if tick < len(due):
            before = found[tick]
            if before is None or abs(time - due[tick]) < abs(before - due[tick]):
                found[tick] = time
    return found


def _interval_errors(due: Sequence[float], sent_at: Sequence[float | None]) -> list[float]:
    # After a message the next tick's was due, whether it came or not.
    messages = [(tick, time) for tick, time in enumerate(sent_at) if time is not None]
    return [two - one - (due[tick + 1] - due[tick])
            for (tick, one), (_, two) in pairwise(messages)]


#: After this time odometry shows a velocity that was sent [s]: more than two of its samples.
SETTLING = 0.06


def sent(messages: Sequence[VelocitySent], command_timeout: float = math.inf) -> Displacement:
    """
    Return the displacement of a robot that keeps each velocity until the next message.

    :param messages: what was sent, in order; the last one only ends the one before
    :param command_timeout: how long the robot keeps a velocity at most [s]
    :returns: the sum of velocity times interval
    """
    held = [(one.velocity, min(two.time - one.time, command_timeout))
            for one, two in pairwise(messages)]
    return Displacement(
        math.fsum(velocity.linear_x * interval for velocity, interval in held),
        math.fsum(velocity.angular_z * interval for velocity, interval in held))


def driven(odometry: Sequence[OdometryReceived], begin: float, end: float) -> Displacement | None:
    """
    Return the displacement between two times by odometry.

    :param odometry: the poses that arrived, in order of time
    :param begin: from when [s]
    :param end: until when [s]
    :returns: the displacement; None if odometry does not cover that time
    """
    if not odometry or odometry[0].time > begin or odometry[-1].time < end:
        return None
    first = bisect_left(odometry, begin, key=_time)
    last = bisect_left(odometry, end, key=_time)
    poses = [pose_at(odometry, begin), *(sample.pose for sample in odometry[first:last]),
             pose_at(odometry, end)]
    return Displacement(
        math.fsum(_forward(one, two) for one, two in pairwise(poses)),
        math.fsum(_wrapped(two.theta - one.theta) for one, two in pairwise(poses)))


def segment_odometry(
        steps: Sequence[StepLog], odometry: Sequence[OdometryReceived]) -> list[float]:
    """
    Return where to cut odometry so that each step gets its own displacement.

    Commands and odometry have a delay, and odometry is sampled.  Where a step borders on a rest,
    or was paused at its start, the cut is therefore moved a little into the rest.  A drive that
    begins with a rest begins with the first odometry: nothing moved before it.

    :param steps: the steps, in order
    :param odometry: the poses that arrived, in order
    :returns: one time more than there are steps [s]
    """
    first = steps[0]
    cuts = [first.began]
    if odometry and first.step.is_rest:
        cuts = [min(max(cuts[0], odometry[0].time), first.sent[-1].time)]
    for before, after in pairwise(steps):
        offset = SETTLING * (_begins_at_rest(after) - before.step.is_rest)
        cuts.append(max(cuts[-1], after.sent[0].time + offset))
    return [*cuts, max(cuts[-1], steps[-1].sent[-1].time)]


def _begins_at_rest(step: StepLog) -> bool:
    first = step.sent[0]
    is_held = first.plan_time is not None and first.velocity.is_zero
    return step.step.is_rest or is_held


def pose_at(odometry: Sequence[OdometryReceived], time: float) -> Pose:
    """
    Return the pose at a time [s], interpolated linearly between the two samples around it.

    :param odometry: the poses that arrived, in order, covering the time
    """
    index = bisect_left(odometry, time, key=_time)
    before, after = odometry[max(0, index - 1)], odometry[index]
    if after.time <= before.time:
        return after.pose
    part = (time - before.time) / (after.time - before.time)
    one, two = before.pose, after.pose
    return Pose(
        one.x + part * (two.x - one.x),
        one.y + part * (two.y - one.y),
        one.theta + part * _wrapped(two.theta - one.theta))


def _time(sample: OdometryReceived) -> float:
    return sample.time


def _forward(one: Pose, two: Pose) -> float:
    # The chord's part along the heading half-way: its sign tells forwards from backwards.
    heading = one.theta + _wrapped(two.theta - one.theta) / 2.0
    return (two.x - one.x) * math.cos(heading) + (two.y - one.y) * math.sin(heading)


def _wrapped(angle: float) -> float:
    # Headings of odometry are wrapped; between two samples a robot turns less than half a turn.
    return math.remainder(angle, math.tau)


@dataclass(frozen=True)
class StepResult:
    """
    The displacements of a step that was begun.

    :param log: the step and its messages
    :param motion: the name of its motion
    :param requested: what it asks for
    :param sent: what was sent
    :param odometry: what odometry saw; None if it does not cover the step
    """

    log: StepLog
    motion: str
    requested: Displacement
    sent: Displacement
    odometry: Displacement | None

    @property
    def error(self) -> Displacement | None:
        """
        Return odometry less requested; of a step that was cut short, odometry less sent.

        None if odometry does not cover the step.
        """
        if self.odometry is None:
            return None
        goal = self.requested if self.log.is_complete else self.sent
        return Displacement(
            self.odometry.distance - goal.distance, self.odometry.angle - goal.angle)


def step_results(
        steps: Sequence[StepLog], names: Sequence[str], odometry: Sequence[OdometryReceived],
        command_timeout: float = math.inf) -> list[StepResult]:
    """
    Compare each step's messages and odometry with what it asked for.

    :param steps: the steps that were begun, in order
    :param names: the name of the motion of each
    :param odometry: the poses that arrived, in order
    :param command_timeout: how long the robot keeps a velocity without a new one [s]
    """
    if not steps:
        return []
    cuts = pairwise(segment_odometry(steps, odometry))
    return [
        StepResult(log, name, log.step.displacement, sent(log.sent, command_timeout),
                   driven(odometry, begin, end))
        for log, name, (begin, end) in zip(steps, names, cuts)]


#: By how much an iteration of the lesson's loop is longer than its period [s].  Measured by the
#: benchmarks, docs/why.md: at 10 Hz a second is held for about 0.8 % too long, in ten iterations.
EXTRA = 0.0008


@dataclass(frozen=True)
class SleepLoopEstimate:
    """
    What a loop that publishes and sleeps would have made of some plans.

    :param extra_time: by how much it would have taken longer [s]
    :param missing_messages: how many messages fewer it would have sent
    :param distance: how far from the planned end the robot would have ended [m]
    :param angle: by how much it would have turned too far [rad], positive to the left
    """

    extra_time: float
    missing_messages: int
    distance: float
    angle: float


def estimate_sleep_loop(plans: Sequence[Plan]) -> SleepLoopEstimate:
    """
    Estimate what the lesson's loop would have made of plans, one after the other.

    Each iteration publishes what is due, sleeps for as long as that is to be held, a period at
    most, and takes a little longer than that.  A step ends with the iteration in which its time is
    up, and the next begins then.  The robot does exactly as it is told.
    """
    pose = goal = ORIGIN
    duration = 0.0
    iterations = 0
    for plan in plans:
        goal = compose(goal, plan.pose)
        results: dict[str, _LoopStep] = {}
        index = 0
        for step in plan.steps:
            count = bisect_left(plan.segments, step.end, index, key=_start) - index
            if step.path not in results:
                results[step.path] = _loop_step(
                    step, plan.segments[index:index + count], plan.period)
            index += count
            result = results[step.path]
            pose = compose(pose, result.end)
            duration, iterations = duration + result.duration, iterations + result.iterations
    distance, angle = distance_between(goal, pose)
    due = sum(ticks(segment, plan.period) for plan in plans for segment in plan.segments)
    return SleepLoopEstimate(
        duration - sum(plan.duration for plan in plans), due - iterations, distance, angle)


class _LoopStep(NamedTuple):
    """What the loop makes of a step: the same each time that the step is repeated."""

    end: Pose
    duration: float
    iterations: int


def _loop_step(step: PlannedStep, segments: Sequence[Segment], period: float) -> _LoopStep:
    pose, time, iterations, index = ORIGIN, step.start, 0, 0
    while segments and time < step.end:
        while index + 1 < len(segments) and segments[index].end <= time:
            index += 1
        segment = segments[index]
        interval = min(period, segment.end - segment.start) + EXTRA
        if not segment.velocity.is_zero:
            pose = integrate(pose, segment.velocity, interval)
        time += interval
        iterations += 1
    return _LoopStep(pose, time - step.start, iterations)


def _start(segment: Segment) -> float:
    return segment.start
