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
"""The path that a plan predicts, as few poses as show it."""

from __future__ import annotations

from collections.abc import Iterator
import math

from kachaka_simple_control.motion.kinematics import advance, ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan, Segment

#: How far a path turns between two of its poses [rad].
BEND = math.radians(4.0)
#: So many poses at most, about.
MOST = 4000


def planned_path(plan: Plan, start: Pose = ORIGIN, most: int = MOST) -> list[tuple[float, Pose]]:
    """
    Return where a plan leads.

    :param plan: the plan
    :param start: where the robot is at t = 0
    :param most: so many poses at most lie between its first and its last
    :returns: times [s after t = 0] and poses, from the first to the last
    """
    total = sum(map(_parts, plan.segments))
    stride = max(1, math.ceil(total / most))
    return [(0.0, start), *(
        place for number, place in enumerate(_places(plan, start), 1)
        if number % stride == 0 or number == total)]


def _places(plan: Plan, start: Pose) -> Iterator[tuple[float, Pose]]:
    pose = start
    for segment in plan.segments:
        span = segment.end - segment.start
        distance = segment.velocity.linear_x * span
        angle = segment.velocity.angular_z * span
        count = _parts(segment)
        for number in range(1, count):
            part = number / count
            yield segment.start + span * part, advance(pose, distance * part, angle * part)
        pose = advance(pose, distance, angle)
        yield segment.end, pose


def _parts(segment: Segment) -> int:
    angle = segment.velocity.angular_z * (segment.end - segment.start)
    return max(1, math.ceil(abs(angle) / BEND))
