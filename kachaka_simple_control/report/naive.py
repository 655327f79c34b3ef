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
"""What the lesson's loop would have made of the same plans; a model with one measured figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from kachaka_simple_control.motion.kinematics import integrate, ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan, Segment, Stage
from kachaka_simple_control.report.frames import apart, composed
from kachaka_simple_control.report.timing import due_times

#: By how much a turn of the lesson's loop is longer than its period [s].  Measured by the
#: benchmarks, docs/why.md: at 10 Hz a second is held for about 0.8 % too long, in ten turns.
EXTRA = 0.0008


@dataclass(frozen=True)
class Naive:
    """
    What a loop would have made of some plans that publishes, and then waits a period.

    :param longer: by how much it would have taken longer [s]
    :param missing: how many messages fewer it would have sent
    :param distance: how far from the planned end the robot would have ended [m]
    :param angle: by how much it would have turned too far [rad], positive to the left
    """

    longer: float
    missing: int
    distance: float
    angle: float


def naive(plans: Sequence[Plan]) -> Naive:
    """
    Let the lesson's loop walk some plans, one after the other.

    Each turn publishes what is due and takes a period and a little more; a step is over with the
    turn in which its time is up, and the next begins then.

    :param plans: the plans
    :returns: what it would have made of them, for a robot that does exactly as it is told
    """
    pose = wanted = ORIGIN
    took = 0.0
    turns = 0
    for plan in plans:
        wanted = composed(wanted, plan.pose)
        walk = _Walk(plan, pose)
        for stage in plan.stages:
            walk.drive(stage)
        pose, took, turns = walk.pose, took + walk.took, turns + walk.turns
    distance, angle = apart(wanted, pose)
    return Naive(
        took - sum(plan.duration for plan in plans),
        sum(len(due_times(plan, math.inf)) for plan in plans) - turns, distance, angle)


class _Walk:
    """The loop's way through one plan."""

    def __init__(self, plan: Plan, start: Pose) -> None:
        self.pose, self.took, self.turns = start, 0.0, 0
        self._segments: tuple[Segment, ...] = plan.segments
        self._turn = plan.period + EXTRA
        self._index = 0

    def drive(self, stage: Stage) -> None:
        count = math.ceil((stage.end - stage.start) / self._turn)
        for number in range(count):
            velocity = self._due(stage.start + number * self._turn).velocity
            if not velocity.is_zero:
                self.pose = integrate(self.pose, velocity, self._turn)
        self.turns += count
        self.took += count * self._turn

    def _due(self, time: float) -> Segment:
        last = len(self._segments) - 1
        while self._index < last and self._segments[self._index].end <= time:
            self._index += 1
        return self._segments[self._index]
