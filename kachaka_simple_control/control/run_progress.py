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
"""The state of a run: its plan, how far it is, why it ended; all who show it read it here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
import math

from kachaka_simple_control.control.speed_factor import is_hold, product
from kachaka_simple_control.motion.geometry import compose, ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan


class RunState(Enum):
    """The state of the newest run, in words."""

    NONE = 'nothing started yet'
    CONNECTING = 'connecting to the robot'
    DRIVING = 'driving'
    HELD = 'paused'
    ENDED = 'at rest'
    ENDED_EARLY = 'stopped early'


@dataclass(frozen=True)
class RunProgress:
    """
    The newest run at one time; it never changes.

    :param title: the name of what is driven; empty before the first run
    :param plan: its plan; None without one
    :param began: t = 0 [s on the steady clock]; nan before it began
    :param plan_time: where on the plan its newest velocity is [s of the plan]; None without a plan
    :param start: where odometry showed the robot at t = 0; None if that is unknown
    :param way: where the velocities since then should have brought it, from its start
    :param factors: the speed factors below 1, by the name of who asks for less speed
    :param late: how many velocities of all runs left a quarter of a period or more after their
        time
    :param skipped: how many velocities of all runs never left: the next was due by then
    :param is_over: whether it has ended
    :param ended_by: why it ended early; None if it did not
    """

    title: str = ''
    plan: Plan | None = None
    began: float = math.nan
    plan_time: float | None = None
    start: Pose | None = None
    way: Pose = ORIGIN
    factors: Mapping[str, float] = field(default_factory=dict)
    late: int = 0
    skipped: int = 0
    is_over: bool = False
    ended_by: str | None = None

    @property
    def state(self) -> RunState:
        """Return its state."""
        if not self.title:
            return RunState.NONE
        if self.is_over:
            return RunState.ENDED if self.ended_by is None else RunState.ENDED_EARLY
        if math.isnan(self.began):
            return RunState.CONNECTING
        return RunState.HELD if is_hold(product(self.factors)) else RunState.DRIVING

    @property
    def planned_pose(self) -> Pose | None:
        """Return where the robot should be, as odometry would show it; None if unknown."""
        return None if self.start is None else compose(self.start, self.way)

    @property
    def step(self) -> tuple[int, int]:
        """Return the number of the step under way, and of all; 0 before the first."""
        if self.plan is None or not self.plan.steps:
            return 0, 0
        number = 0 if self.plan_time is None else self.plan.step_index(self.plan_time) + 1
        return number, len(self.plan.steps)
