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
"""Walk a plan: told the time, answer what is due now and when to ask again."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.motion.kinematics import Velocity
from kachaka_simple_control.motion.plan import Plan, Segment

#: A last tick shorter than this part of a period is rounding, not a tick.
SLIVER = 1e-6


@dataclass(frozen=True)
class Due:
    """
    What a player answers.

    :param velocity: the velocity to send now
    :param deadline: when to ask again [s after t = 0]
    :param skipped: ticks before this one whose time passed without an answer
    :param rest: how long the plan stays at rest from the start of this tick [s]; 0 while moving
    """

    velocity: Velocity
    deadline: float
    skipped: int
    rest: float


class Player:
    """
    One walk through a plan; pure, so that any clock can drive it.

    Deadlines are absolute: they come from the plan alone.  An answer asked for late is what is
    due by then, and moves no deadline after it.
    """

    def __init__(self, plan: Plan) -> None:
        """
        Stand before the first tick.

        :param plan: what to walk
        """
        self._segments = iter(plan.segments)
        self._period = plan.period
        self._answered = False
        self._segment: Segment | None
        self._deadline: float
        self._enter_next()

    def due(self, elapsed: float) -> Due | None:
        """
        Return what is due; ask at 0 first, then at each deadline.

        :param elapsed: time since t = 0 [s], never less than before
        :returns: the velocity to send, or None when the plan is over
        """
        skipped = 0
        while self._segment is not None and self._deadline <= elapsed:
            skipped += not self._answered
            self._answered = False
            self._pass_tick(self._segment)
        if self._segment is None:
            return None
        self._answered = True
        return Due(self._segment.velocity, self._deadline, skipped, self._rest(self._segment))

    def _pass_tick(self, segment: Segment) -> None:
        if self._deadline >= segment.end:
            self._enter_next()
        else:
            self._tick += 1
            self._deadline = self._end_of_tick(segment)

    def _enter_next(self) -> None:
        self._segment = next(self._segments, None)
        self._tick = 0
        if self._segment is not None:
            self._deadline = self._end_of_tick(self._segment)

    def _end_of_tick(self, segment: Segment) -> float:
        following = segment.start + (self._tick + 1) * self._period
        nearly = following >= segment.end - SLIVER * self._period
        return segment.end if nearly else following

    def _rest(self, segment: Segment) -> float:
        if not segment.velocity.is_zero:
            return 0.0
        return segment.end - segment.start - self._tick * self._period
