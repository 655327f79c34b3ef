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
"""What the robot was sent to do by itself: one errand under way, the others behind it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from kachaka_simple_control.motion.kinematics import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.robot.error_codes import ERROR_STUCK, SUCCESS
from kachaka_simple_control.robot.fidelity import Fidelity
from kachaka_simple_control.robot.legs import Leg, Stay
from kachaka_simple_control.robot.way import Way

#: How many outcomes are kept; chosen.
MOST_OUTCOMES = 100


@dataclass(frozen=True)
class Errand:
    """
    Something to do.

    :param identity: its name, which no other has
    :param legs: its parts, in order
    :param ends_docked: whether the robot stands on its dock once all is done
    :param note: whatever its sender wants to have beside it
    """

    identity: str
    legs: tuple[Leg, ...]
    ends_docked: bool = False
    note: object = None

    @property
    def moves(self) -> bool:
        """Whether the robot moves for it."""
        return not all(isinstance(leg, Stay) for leg in self.legs)


@dataclass(frozen=True)
class Outcome:
    """
    How an errand ended.

    :param errand: the errand
    :param code: 0, or the code of the error
    """

    errand: Errand
    code: int

    @property
    def is_success(self) -> bool:
        """Whether all of it was done."""
        return self.code == SUCCESS


class Errands:
    """The errands of one robot, which does them one by one; told the time."""

    def __init__(self, limits: Limits, fidelity: Fidelity) -> None:
        """
        Have nothing to do.

        :param limits: the robot's largest velocities
        :param fidelity: how its drive is
        """
        self._limits = limits
        self._fidelity = fidelity
        self._waiting: deque[Errand] = deque()
        self._legs: deque[Leg] = deque()
        self._way: Way | None = None
        self.current: Errand | None = None
        #: Newest last.
        self.outcomes: deque[Outcome] = deque(maxlen=MOST_OUTCOMES)

    def add(self, errand: Errand) -> None:
        """
        Take an errand on, behind all others.

        :param errand: the errand
        """
        self._waiting.append(errand)
        if self.current is None:
            self._begin_next()

    def drop_all(self, code: int) -> None:
        """
        End all errands undone.

        :param code: why
        """
        dropped = [] if self.current is None else [self.current]
        self.outcomes.extend(Outcome(errand, code) for errand in (*dropped, *self._waiting))
        self._waiting.clear()
        self._begin_next()

    def put_first(self, leg: Leg) -> None:
        """
        Do something before the next leg.

        :param leg: what to do
        """
        self._legs.appendleft(leg)

    def end_stay(self, now: float) -> bool:
        """
        Go on, if the robot stays where it may be told to go on.

        :param now: the time [s]
        :returns: whether it did
        """
        if self._way is None or not isinstance(leg := self._legs[0], Stay) or not leg.can_be_ended:
            return False
        self._way.end = now
        return True

    def proceed(
            self, pose: Pose, velocity: Velocity, now: float) -> tuple[Velocity, float] | Outcome:
        """
        Do what is to be done for the current errand.

        :param pose: where the robot is
        :param velocity: how fast it is
        :param now: the time [s]
        :returns: the velocity, and when to ask again [s]; at the end of the errand its outcome,
            and the next errand is the current one
        """
        while self._legs:
            if self._way is None:
                self._way = Way(self._legs[0], pose, now, self._limits, self._fidelity)
            answer = self._way.look(pose, velocity, now)
            if not isinstance(answer, bool):
                return answer
            if not answer:
                return self._finish(ERROR_STUCK)
            self._legs.popleft()
            self._way = None
        return self._finish(SUCCESS)

    def _finish(self, code: int) -> Outcome:
        assert self.current is not None, 'somebody proceeds with nothing'
        outcome = Outcome(self.current, code)
        self.outcomes.append(outcome)
        self._begin_next()
        return outcome

    def _begin_next(self) -> None:
        self.current = self._waiting.popleft() if self._waiting else None
        self._legs = deque(self.current.legs if self.current else ())
        self._way = None
