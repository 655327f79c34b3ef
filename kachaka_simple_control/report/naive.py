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

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from kachaka_simple_control.motion.kinematics import integrate, ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan, Segment, Stage
from kachaka_simple_control.report.frames import apart, composed
from kachaka_simple_control.report.preview import ticks

#: By how much a turn of the lesson's loop is longer than its period [s].  Measured by the
#: benchmarks, docs/why.md: at 10 Hz a second is held for about 0.8 % too long, in ten turns.
EXTRA = 0.0008


@dataclass(frozen=True)
class Naive:
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


def naive(plans: Sequence[Plan]) -> Naive:
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
        wanted = composed(wanted, plan.pose)
        ways: dict[str, _Way] = {}
        index = 0
        for stage in plan.stages:
            count = _count(plan.segments, index, stage)
            if stage.path not in ways:
                ways[stage.path] = _way(stage, plan.segments[index:index + count], plan.period)
            index += count
            way = ways[stage.path]
            pose, took, turns = composed(pose, way.end), took + way.took, turns + way.turns
    distance, angle = apart(wanted, pose)
    due = sum(ticks(segment, plan.period) for plan in plans for segment in plan.segments)
    return Naive(took - sum(plan.duration for plan in plans), due - turns, distance, angle)


class _Way(NamedTuple):
    """The loop's way through a step; the same each time that the step is repeated."""

    end: Pose
    took: float
    turns: int


def _count(segments: Sequence[Segment], first: int, stage: Stage) -> int:
    return bisect_left(segments, stage.end, first, key=_start) - first


def _way(stage: Stage, segments: Sequence[Segment], period: float) -> _Way:
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
    return _Way(pose, time - stage.start, turns)


def _start(segment: Segment) -> float:
    return segment.start
