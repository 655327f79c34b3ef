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
"""How far a movement was asked, sent and driven; pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
import math

from kachaka_simple_control.motion.kinematics import Pose
from kachaka_simple_control.motion.steps import Arc, Forward, Move, Step, Turn, Wait
from kachaka_simple_control.motion.way import way_of
from kachaka_simple_control.report.events import Answered, Sent
from kachaka_simple_control.report.record import Movement

#: How long after a velocity was sent odometry surely shows it [s]: two of its samples and more.
SETTLING = 0.06


@dataclass(frozen=True)
class Displacement:
    """
    How far a robot went along its path.

    :param distance: signed length of the path [m], negative backwards
    :param angle: heading change [rad], counter-clockwise positive
    """

    distance: float
    angle: float


def requested(step: Step) -> Displacement:
    """
    Return what a step asks for.

    :param step: the step; not a repeat
    :returns: velocity times duration, or the goal
    """
    if isinstance(step, Move):
        return Displacement(step.linear_x * step.duration, step.angular_z * step.duration)
    if isinstance(step, (Forward, Turn, Arc)):
        way = way_of(step)
        return Displacement(way.length, way.angle)
    return Displacement(0.0, 0.0)


def sent(messages: Sequence[Sent], hold: float = math.inf) -> Displacement:
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


def driven(odometry: Sequence[Answered], begin: float, end: float) -> Displacement | None:
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


def boundaries(
        movements: Sequence[Movement], odometry: Sequence[Answered]) -> list[float]:
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
    if odometry and _rests(first.step):
        cuts = [min(max(cuts[0], odometry[0].time), first.sent[-1].time)]
    for before, after in pairwise(movements):
        aside = SETTLING * (_rests(after.step) - _rests(before.step))
        cuts.append(max(cuts[-1], after.sent[0].time + aside))
    return [*cuts, max(cuts[-1], movements[-1].sent[-1].time)]


def pose_at(odometry: Sequence[Answered], time: float) -> Pose:
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


def _rests(step: Step) -> bool:
    return isinstance(step, Wait) or (isinstance(step, Move) and step.velocity.is_zero)


def _time(answer: Answered) -> float:
    return answer.time


def _forward(one: Pose, two: Pose) -> float:
    # The chord's part along the heading half-way: its sign tells forwards from backwards.
    heading = one.theta + _wrapped(two.theta - one.theta) / 2.0
    return (two.x - one.x) * math.cos(heading) + (two.y - one.y) * math.sin(heading)


def _wrapped(angle: float) -> float:
    # Odometry tells headings within a turn; between two samples a robot turns less than half.
    return math.remainder(angle, math.tau)
