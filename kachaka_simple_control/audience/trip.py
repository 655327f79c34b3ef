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
"""How far the robot has gone since the step under way began; pure."""

from __future__ import annotations

from bisect import bisect_right

from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.report.metrics import Displacement

REST = Displacement(0.0, 0.0)


class Course:
    """
    When the steps of a motion are due.

    :param plan: the motion's plan
    """

    def __init__(self, plan: Plan) -> None:
        """Look up its steps."""
        self.stages = plan.stages
        self.duration = plan.stages[-1].end if plan.stages else 0.0
        self._starts = [stage.start for stage in plan.stages]

    def step_at(self, elapsed: float) -> int:
        """
        Return which step is due.

        :param elapsed: the time since t = 0 [s]; at least 0
        :returns: its place; of several that begin at once the last
        """
        return max(0, bisect_right(self._starts, elapsed) - 1)


class Trip:
    """
    How far it is since the step under way began, by one of those who know.

    :param course: when the steps begin
    :param began: when the motion began [s on the steady clock]
    """

    def __init__(self, course: Course, began: float) -> None:
        """Have gone nowhere."""
        self._course, self._began = course, began
        self._step, self._gone = 0, REST

    def go(self, since: float, until: float, way: Displacement) -> None:
        """
        Go on; what falls into an earlier step is left to that.

        :param since: when this stretch began [s on the steady clock]
        :param until: when it ended
        :param way: how far it was
        """
        step = self._course.step_at(until - self._began)
        part = 1.0
        if step != self._step:
            start = self._began + self._course.stages[step].start
            part = min(1.0, max(0.0, (until - start) / max(until - since, 1e-9)))
            self._step, self._gone = step, REST
        self._gone = Displacement(
            self._gone.distance + part * way.distance, self._gone.angle + part * way.angle)

    def gone(self, step: int) -> Displacement:
        """
        Return how far it was.

        :param step: the step under way
        :returns: the way since it began; none if nothing was heard of it yet
        """
        return self._gone if step == self._step else REST


def left_of(asked: float, gone: float) -> float | None:
    """
    Return what is left of a way.

    :param asked: how far it was to be, either way
    :param gone: how far it is
    :returns: the rest, not below zero; None if there was no way to go
    """
    if asked == 0.0:
        return None
    return max(0.0, asked - gone if asked > 0.0 else gone - asked)
