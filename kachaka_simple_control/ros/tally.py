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
"""How a drive goes: its motion and step, what left late, what never left; pure, told the time."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Sequence
import time

from kachaka_simple_control.execution.player import Due, Player
from kachaka_simple_control.motion.plan import Plan, Stage
from kachaka_simple_control.report.events import Began, Ended, Event, Planned, Sent
from kachaka_simple_control.report.timing import LATE

#: How much is kept for a count that does not come; an hour of 20 Hz.
MOST = 100_000
#: How much is counted at once.
AT_ONCE = 100


class Tally:
    """
    Counts what happens.

    To be told of it takes no time; the counting is done later, in the thread that asks for it.
    """

    def __init__(self) -> None:
        """Have seen no motion yet."""
        #: the name of the newest motion; empty before there is one
        self.motion = ''
        #: velocities of all motions that left a quarter of a period or more after their time
        self.late = 0
        #: velocities of all motions that never left: the next was due by then
        self.skipped = 0
        #: why the newest motion was over before its end; None if it was not
        self.failure: str | None = None
        #: whether a motion was planned and is not over
        self.is_on = False
        #: takes what happens, from any thread
        self.hear: Callable[[Event], None]
        self._unread: deque[Event | Plan] = deque(maxlen=MOST)
        self.hear = self.expect = self._unread.append
        self._stages: Sequence[Stage] = ()
        self._began: float | None = None
        self._period = 0.0
        self._player: Player | None = None
        self._due: Due | None = None

    @property
    def has_begun(self) -> bool:
        """Whether the newest motion has sent its first velocity."""
        return self._began is not None

    def count(self) -> None:
        """Count what happened since; in one thread at a time."""
        counted = 0
        while self._unread:
            self._take(self._unread.popleft())
            counted += 1
            if counted % AT_ONCE == 0:
                time.sleep(0.0)  # lets go of the interpreter: the robot's thread may wait for it

    def _take(self, event: Event | Plan) -> None:
        match event:
            case Plan():
                self._expect(event)
            case Sent():
                if self._due is not None:
                    self._count(event.time)
            case Began():
                self._began = event.time
                self._due = self._player.due(0.0) if self._player else None
            case Planned():
                self.motion, self.is_on, self.failure = event.motion.name, True, None
            case Ended():
                self.is_on, self.failure, self._due = False, event.reason, None

    def _expect(self, plan: Plan) -> None:
        self._stages, self._period = plan.stages, plan.period
        self._player, self._began, self._due = Player(plan), None, None

    def step(self, now: float) -> tuple[int, int]:
        """
        Return how far the newest motion is.

        :param now: the time [s]
        :returns: the number of the step under way, and of all; 0 before the first
        """
        count = len(self._stages)
        if self._began is None:
            return 0, count
        passed = bisect_right(self._stages, now - self._began, key=_end)
        return min(passed + 1, count), count

    def _count(self, now: float) -> None:
        assert self._began is not None
        assert self._player is not None
        elapsed = now - self._began
        due, self._due = self._next()
        while self._due is not None and self._due.deadline <= elapsed:
            self.skipped += 1
            due, self._due = self._next()
        if elapsed - due >= LATE * self._period:
            self.late += 1

    def _next(self) -> tuple[float, Due | None]:
        """Return when the next velocity is due, and what; nothing after the last zero."""
        assert self._due is not None
        assert self._player is not None
        return self._due.deadline, self._player.due(self._due.deadline)


def _end(stage: Stage) -> float:
    return stage.end
