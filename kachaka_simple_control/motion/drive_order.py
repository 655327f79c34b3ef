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
"""What is to be driven: a motion with the limits and the rate of its plan."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.limits import CLOSED_LOOP_SHARE, Limits
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import Motion


@dataclass(frozen=True)
class DriveOrder:
    """
    A motion, with the limits and the rate from which its plan is computed.

    A closed loop corrects the planned velocities with odometry while the robot drives.  For a
    closed loop, a plan uses only a part of each limit, so that the corrections can use the rest.

    :param motion: the motion; for a closed loop, its last step is a settle step, in which the
        robot stands still and its heading is corrected
    :param limits: the limits with which the plan is computed.  They are the limits of the robot,
        or limits for this motion, which can be higher.  For a closed loop, they are a part of
        these limits
    :param rate: the rate at which velocities are sent [Hz]
    :param allowed: the limits of the robot; for a closed loop, a part of each.  ``plan()`` raises
        an error for a planned velocity beyond them
    :param corrected: for a closed loop, the limits of the corrected velocities; None if there is
        no closed loop
    """

    motion: Motion
    limits: Limits
    rate: float
    allowed: Limits
    corrected: Limits | None = None

    @classmethod
    def of(cls, motion: Motion, robot: Limits, rate: float, limits: Limits | None = None,
           is_closed_loop: bool = False) -> DriveOrder:
        """
        Return the ``DriveOrder`` for a motion.

        A closed loop corrects velocities with odometry.  For a closed loop, the plan uses only a
        part of the limits, and the corrections can use the rest.  The motion then ends with a
        settle step, in which the robot stands still while its heading is corrected.

        :param motion: the motion
        :param robot: the limits of the robot
        :param rate: the rate at which velocities are sent [Hz]
        :param limits: the limits for this motion; None for the limits of the robot
        :param is_closed_loop: whether a closed loop corrects the velocities
        """
        limits = limits or robot
        if not is_closed_loop:
            return cls(motion, limits, rate, robot)
        return cls(motion.settled(), limits.scaled(CLOSED_LOOP_SHARE), rate,
                   robot.scaled(CLOSED_LOOP_SHARE), limits.tightened(robot))

    def plan(self) -> Plan:
        """
        Return the plan of the motion: all velocities that drive it, with their times.

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
