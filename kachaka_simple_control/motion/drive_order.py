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
"""
What is to be driven: a motion with the limits and the rate of its plan.

Tested by test/ros/test_robot.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.limits import CLOSED_LOOP_SHARE, Limits
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import Motion


@dataclass(frozen=True)
class MotionText:
    """
    The file of a motion, as a report keeps it.

    :param source: its path or name
    :param values: what its parameters were given, by name, as text
    :param included: the text of each file that it includes, as in ``MotionFile.included_texts``
    """

    source: str
    text: str
    values: Mapping[str, str]
    included: Mapping[str, str]


@dataclass(frozen=True)
class DriveOrder:
    """
    A motion, with the limits and the rate from which its plan is computed.

    For a closed loop, the plan uses only a part of each limit; corrections can use the rest.

    :param motion: for a closed loop, its last step is a settle
    :param allowed: the limits of the plan; ``plan()`` raises an error for a velocity beyond them
    :param corrected: the limits of the corrected velocities; None without a closed loop
    :param motion_file: None if the motion is not from a file
    """

    motion: Motion
    limits: Limits
    rate: float
    allowed: Limits
    corrected: Limits | None = None
    motion_file: MotionText | None = field(default=None, repr=False, compare=False)

    @classmethod
    def of(cls, motion: Motion, robot: Limits, rate: float, limits: Limits | None = None,
           is_closed_loop: bool = False, motion_file: MotionText | None = None) -> DriveOrder:
        """
        Return the order for a motion; a closed loop gets a settle step at its end.

        :param limits: the limits for this motion; None for those of the robot
        """
        limits = limits or robot
        if not is_closed_loop:
            return cls(motion, limits, rate, robot, motion_file=motion_file)
        return cls(motion.settled(), limits.scaled(CLOSED_LOOP_SHARE), rate,
                   robot.scaled(CLOSED_LOOP_SHARE), limits.tightened(robot), motion_file)

    @cached_property
    def plan(self) -> Plan:
        """
        Return the plan of the motion, computed once.

        :raises InvalidMotionError: if the motion is invalid, or the robot cannot drive it
        """
        try:
            planned = plan(self.motion, self.limits, self.rate)
        except InvalidMotionError as error:
            raise error if self.corrected is None else error.by("the closed loop's") from None
        if self.limits.exceeds(self.allowed):
            # Otherwise such a velocity would be refused during the motion.
            for velocity in {segment.velocity for segment in planned.segments}:
                self.allowed.check(velocity)
        return planned
