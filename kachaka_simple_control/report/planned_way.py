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
"""Where a plan goes, as few poses."""

from __future__ import annotations

import math

from kachaka_simple_control.motion.kinematics import ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.report.frames import composed
from kachaka_simple_control.report.track import stretches

#: So many poses at most, where nobody says another number.
MOST = 2000


def planned_way(plan: Plan, start: Pose = ORIGIN, most: int = MOST) -> list[Pose]:
    """
    Return where a plan goes.

    :param plan: the plan
    :param start: where the robot is at t = 0
    :param most: how many poses there may be, two at least
    :returns: poses from the start to the end; on curves so many that they look round
    """
    if len(plan.stages) >= most:
        ends = [ORIGIN, *(stage.pose for stage in plan.stages)]
        return [composed(start, pose) for pose in _some(ends, most)]
    paths = stretches(plan)
    # Were they all of one length, none would be without its end.
    coarseness = max(1.0, sum(path.count for path in paths) / most)
    poses = [ORIGIN]
    for path in paths:
        poses += path.poses(math.ceil(path.count / coarseness))
    return [composed(start, pose) for pose in _some(poses, most)]


def _some(poses: list[Pose], most: int) -> list[Pose]:
    if len(poses) <= most:
        return poses
    return [poses[number * (len(poses) - 1) // (most - 1)] for number in range(most)]
