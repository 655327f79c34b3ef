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
"""All that a report says of a drive, worked out once; pure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
import math

from kachaka_simple_control.motion.kinematics import Pose
from kachaka_simple_control.report.driven_path import DrivenPath, Odometry
from kachaka_simple_control.report.frames import apart
from kachaka_simple_control.report.naive import Naive, naive
from kachaka_simple_control.report.record import Record
from kachaka_simple_control.report.step_errors import StepDriven, steps_driven
from kachaka_simple_control.report.timing import Timing, timing
from kachaka_simple_control.report.verdict import Verdict, verdict


@dataclass(frozen=True)
class Miss:
    """
    How far odometry saw the robot from where it should have been.

    :param distance: how far [m]
    :param angle: by how much it looked too far to the left [rad]
    """

    distance: float
    angle: float


class Summary:
    """
    What a report says, each part worked out when it is asked for first.

    :param record: what happened
    """

    def __init__(self, record: Record) -> None:
        """
        Take a record; it changes no more.

        :param record: what happened
        """
        self.record = record

    @cached_property
    def verdict(self) -> Verdict:
        """How it came out."""
        return verdict(self.record)

    @cached_property
    def path(self) -> DrivenPath:
        """Where it was planned, sent and seen to go."""
        return DrivenPath(self.record)

    @cached_property
    def steps(self) -> list[StepDriven]:
        """The steps that were begun."""
        pairs = [(movement, motion.planned.motion.name) for motion in self.record.motions
                 for movement in motion.movements if movement.sent]
        opened = self.record.opened
        odometry = [seen.answer for seen in self.path.odometry]
        return steps_driven([one for one, _ in pairs], [name for _, name in pairs], odometry,
                            math.inf if opened is None else opened.hold)

    @cached_property
    def timing(self) -> Timing:
        """How exactly it was timed."""
        return timing(self.record.motions)

    @cached_property
    def naive(self) -> Naive:
        """What the lesson's loop would have made of all that was planned."""
        return naive([motion.plan for motion in self.record.motions])

    @property
    def planned_duration(self) -> float:
        """How long all motions that began were to take [s]."""
        return math.fsum(motion.plan.duration for motion in self.record.motions
                         if motion.has_begun)

    @property
    def driven_duration(self) -> float:
        """How long they took, from t = 0 of each to the zero that ended it [s]."""
        return math.fsum(
            motion.own_messages[-1].time - motion.began for motion in self.record.motions
            if motion.own_messages)

    @property
    def last_seen(self) -> Odometry | None:
        """What odometry told last; None if it told nothing since t = 0."""
        return self.path.odometry[-1] if self.path.odometry else None

    @property
    def end(self) -> Pose | None:
        """Where odometry saw the robot in the end."""
        return None if self.last_seen is None else self.last_seen.pose

    @property
    def miss_of_plan(self) -> Miss | None:
        """How far from the planned end that is; None if it was not to be reached or not seen."""
        if self.end is None or not all(motion.is_whole for motion in self.record.motions):
            return None
        return Miss(*apart(self.path.planned_end, self.end))

    @property
    def miss_of_sent(self) -> Miss | None:
        """How far from where the messages should have brought it that is."""
        return None if self.last_seen is None else Miss(
            self.last_seen.distance, self.last_seen.angle)
