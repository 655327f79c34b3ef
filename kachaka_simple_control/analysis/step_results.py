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
"""The displacement of each step as requested, as sent and by odometry."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from operator import attrgetter

from kachaka_simple_control.analysis.drive_log import StepLog
from kachaka_simple_control.control.events import OdometryReceived, VelocitySent
from kachaka_simple_control.motion.geometry import Displacement, Pose

#: After this time odometry shows a velocity that was sent [s]: more than two of its samples.
ODOMETRY_DELAY = 0.06


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
        offset = ODOMETRY_DELAY * (_begins_at_rest(after) - before.step.is_rest)
        cuts.append(max(cuts[-1], after.sent[0].time + offset))
    return [*cuts, max(cuts[-1], steps[-1].sent[-1].time)]


def _begins_at_rest(step: StepLog) -> bool:
    first = step.sent[0]
    is_held = first.is_of_run and first.is_delayed and first.velocity.is_zero
    return step.step.is_rest or is_held


def pose_at(odometry: Sequence[OdometryReceived], time: float) -> Pose:
    """
    Return the pose at a time [s], interpolated linearly between the two samples around it.

    :param odometry: the poses that arrived, in order, covering the time
    """
    index = bisect_left(odometry, time, key=attrgetter('time'))
    before, after = odometry[max(0, index - 1)], odometry[index]
    if after.time <= before.time:
        return after.pose
    part = (time - before.time) / (after.time - before.time)
    one, two = before.pose, after.pose
    return Pose(
        one.x + part * (two.x - one.x),
        one.y + part * (two.y - one.y),
        one.theta + part * _wrapped(two.theta - one.theta))


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
    :param odometry: what odometry reported; None if it does not cover the step
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
