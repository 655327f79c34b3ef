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
"""Compute the displacement of each step: requested, from sent velocities, and from odometry."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
import math
from operator import attrgetter

from kachaka_simple_control.analysis.drive_log import StepLog
from kachaka_simple_control.control.events import OdometryReceived, VelocitySent
from kachaka_simple_control.motion.geometry import Displacement, Pose

#: The time until odometry shows a sent velocity [s]: more than two periods of its samples.
ODOMETRY_DELAY = 0.06


def sent(messages: Sequence[VelocitySent], command_timeout: float = math.inf) -> Displacement:
    """
    Return the displacement of a robot that keeps each sent velocity until the next message.

    :param messages: in order; the last one only gives the end time
    """
    held = [(one.velocity, min(two.time - one.time, command_timeout))
            for one, two in pairwise(messages)]
    return Displacement(
        math.fsum(velocity.linear_x * interval for velocity, interval in held),
        math.fsum(velocity.angular_z * interval for velocity, interval in held))


def driven(odometry: Sequence[OdometryReceived], begin: float, end: float) -> Displacement | None:
    """
    Return how far a robot moved between two times by odometry.

    :returns: None if odometry begins after ``begin`` or ends before ``end``
    """
    if not odometry or odometry[0].time > begin or odometry[-1].time < end:
        return None
    first = bisect_left(odometry, begin, key=attrgetter('time'))
    last = bisect_left(odometry, end, key=attrgetter('time'))
    poses = [pose_at(odometry, begin), *(sample.pose for sample in odometry[first:last]),
             pose_at(odometry, end)]
    return Displacement(
        math.fsum(_forward(one, two) for one, two in pairwise(poses)),
        math.fsum(_wrapped(two.theta - one.theta) for one, two in pairwise(poses)))


def segment_odometry(
        steps: Sequence[StepLog], odometry: Sequence[OdometryReceived]) -> list[float]:
    """
    Return the times at which to divide the odometry of a drive into its steps.

    Odometry is late: where the robot moves in only one of two steps, the time is shifted by
    ODOMETRY_DELAY (0.06 s) into the standstill, so that the whole movement counts for that step.
    The end of the last step is shifted, too, and to the next sample: a node that was suspended
    received none before the guardian stopped the robot.  A waiting step in which odometry begins
    starts with its first sample.

    :returns: in order: the start of each step, and the end of the last step [s]
    """
    first = steps[0]
    cuts = [first.began]
    if odometry and first.step.is_rest:
        cuts = [min(max(cuts[0], odometry[0].time), first.sent[-1].time)]
    for before, after in pairwise(steps):
        offset = ODOMETRY_DELAY * (_begins_at_rest(after) - before.step.is_rest)
        cuts.append(max(cuts[-1], after.sent[0].time + offset))
    return [*cuts, _end_of_movement(max(cuts[-1], steps[-1].sent[-1].time), odometry)]


def _end_of_movement(end: float, odometry: Sequence[OdometryReceived]) -> float:
    """Return the time of the first odometry sample that shows the end of the last movement [s]."""
    if not odometry:
        return end
    later = bisect_left(odometry, end + ODOMETRY_DELAY, key=attrgetter('time'))
    return max(end, odometry[min(later, len(odometry) - 1)].time)


def _begins_at_rest(step: StepLog) -> bool:
    first = step.sent[0]
    is_held = first.is_of_run and first.is_delayed and first.velocity.is_zero
    return step.step.is_rest or is_held


def pose_at(odometry: Sequence[OdometryReceived], time: float) -> Pose:
    """Return the pose at a time between two odometry samples, interpolated."""
    index = bisect_left(odometry, time, key=attrgetter('time'))
    before, after = odometry[max(0, index - 1)], odometry[index]
    if after.time <= before.time:
        return after.pose
    part = (time - before.time) / (after.time - before.time)
    one, two = before.pose, after.pose
    return Pose(one.x + part * (two.x - one.x), one.y + part * (two.y - one.y),
                one.theta + part * _wrapped(two.theta - one.theta))


def _forward(one: Pose, two: Pose) -> float:
    # The distance between the poses along the mean heading; negative backwards.
    heading = one.theta + _wrapped(two.theta - one.theta) / 2.0
    return (two.x - one.x) * math.cos(heading) + (two.y - one.y) * math.sin(heading)


def _wrapped(angle: float) -> float:
    # Odometry headings are wrapped; between two samples a robot turns less than half a turn.
    return math.remainder(angle, math.tau)


@dataclass(frozen=True)
class Result:
    """
    The displacement of a step or a flow: as requested, as sent, and as reported by odometry.

    :param requested: for a step in a flow, the planned one
    :param odometry: None if odometry does not cover it
    """

    is_complete: bool
    requested: Displacement
    sent: Displacement
    odometry: Displacement | None

    @property
    def error(self) -> Displacement | None:
        """
        Return the displacement in odometry minus the requested one; None without odometry.

        Minus the sent one if it ended early.
        """
        if self.odometry is None:
            return None
        goal = self.requested if self.is_complete else self.sent
        return Displacement(
            self.odometry.distance - goal.distance, self.odometry.angle - goal.angle)


@dataclass(frozen=True)
class FlowResult(Result):
    """The displacement of the started steps of a flow."""

    count: int


@dataclass(frozen=True)
class StepResult(Result):
    """
    The displacement of a started step: as requested, as sent, and as reported by odometry.

    In a flow, ``odometry`` is None: it is late, and does not show where a step ended in motion.

    :param flow: for the last started step of a flow, the result of the whole flow
    """

    log: StepLog
    motion: str
    is_in_flow: bool = False
    flow: FlowResult | None = None


def flow_ranges(steps: Sequence[StepLog]) -> list[range]:
    """Return the started steps of each flow; they may belong to several motions."""
    flows: list[range] = []
    for index, (before, after) in enumerate(pairwise(steps)):
        # The next step may be the first step of another motion, if a motion ended early.
        if before.planned.joins_next and after.planned.start == before.planned.end:
            is_same = flows and flows[-1].stop == index + 1
            first = flows.pop().start if is_same else index
            flows.append(range(first, index + 2))
    return flows


def step_results(
        steps: Sequence[StepLog], names: Sequence[str], odometry: Sequence[OdometryReceived],
        command_timeout: float = math.inf) -> list[StepResult]:
    """Return the displacement of each step: requested, from sent velocities, and from odometry."""
    if not steps:
        return []
    cuts = segment_odometry(steps, odometry)
    results = [
        StepResult(log.is_complete, log.planned.displacement, sent(log.sent, command_timeout),
                   driven(odometry, begin, end), log, name)
        for log, name, (begin, end) in zip(steps, names, pairwise(cuts))]
    for flow in flow_ranges(steps):
        parts = results[flow.start:flow.stop]
        whole = FlowResult(
            parts[-1].is_complete, _total([part.requested for part in parts]),
            _total([part.sent for part in parts]),
            driven(odometry, cuts[flow.start], cuts[flow.stop]), len(parts))
        results[flow.start:flow.stop] = [
            replace(part, odometry=None, is_in_flow=True,
                    flow=whole if part is parts[-1] else None) for part in parts]
    return results


def _total(displacements: Sequence[Displacement]) -> Displacement:
    return Displacement(math.fsum(part.distance for part in displacements),
                        math.fsum(part.angle for part in displacements))
