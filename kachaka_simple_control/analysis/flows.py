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
"""What tables and reports show of flows: runs of steps that the robot drives without a stop."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import NamedTuple

from kachaka_simple_control.motion.chain import ChainPath
from kachaka_simple_control.motion.flow import Cut
from kachaka_simple_control.motion.flow_leg import FlowLeg
from kachaka_simple_control.motion.plan import Plan, PlannedStep


class CutCorner(NamedTuple):
    """
    A corner of a flow, and the shorter one of its two legs.

    :param number: the number of the corner in the plan, from 1
    :param leg: the length, as requested, of the leg of which less is left beside the corner [m]
    """

    number: int
    cut: Cut
    leg: float


def is_in_flow(step: PlannedStep) -> bool:
    """Return whether the path of a step depends on its neighbours, because they are one flow."""
    return any(isinstance(path, (ChainPath, FlowLeg)) for path in step.trajectories)


def repetition_key(step: PlannedStep) -> Hashable:
    """
    Return a key that is equal for repetitions of a step that are driven in the same way.

    In a flow they may differ, because they have other neighbours.
    """
    if not is_in_flow(step):
        return step.path
    return step.path, round(step.duration, 6), round(step.length, 6), step.joins_next


def cut_corners(plan: Plan) -> Iterator[CutCorner]:
    """Yield the corners of a plan, in order, each with the shorter one of its legs."""
    number = 0
    for index, step in enumerate(plan.steps):
        if step.cut is None:
            continue
        number += 1
        # A corner is always between two legs.
        leg = min(plan.steps[index - 1], plan.steps[index + 1], key=lambda leg: leg.length)
        yield CutCorner(number, step.cut, abs(leg.step.displacement.distance))
