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
"""What each step asked for, was sent and did; pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
import math

from kachaka_simple_control.motion.steps import Move, Step
from kachaka_simple_control.report.events import Answered
from kachaka_simple_control.report.metrics import boundaries, Displacement, driven, requested, sent
from kachaka_simple_control.report.preview import in_words
from kachaka_simple_control.report.record import Movement


@dataclass(frozen=True)
class StepDriven:
    """
    One step that was begun, and what became of it.

    :param movement: the step and its messages
    :param motion: the name of its motion
    :param requested: what it asks for
    :param sent: what was sent
    :param odometry: what odometry saw; None if it does not cover the step
    """

    movement: Movement
    motion: str
    requested: Displacement
    sent: Displacement
    odometry: Displacement | None

    @property
    def error(self) -> Displacement | None:
        """
        Return by how much odometry saw the robot go too far.

        Beside what was asked for; of a step that was cut short, beside what was sent.
        """
        if self.odometry is None:
            return None
        wanted = self.requested if self.movement.is_whole else self.sent
        return Displacement(
            self.odometry.distance - wanted.distance, self.odometry.angle - wanted.angle)


def steps_driven(
        movements: Sequence[Movement], names: Sequence[str], odometry: Sequence[Answered],
        hold: float = math.inf) -> list[StepDriven]:
    """
    Hold each step's messages and odometry against what it asked for.

    :param movements: the steps that were begun, in order
    :param names: the name of the motion of each
    :param odometry: the poses that arrived, in order
    :param hold: how long the robot keeps a velocity without a new one [s]
    :returns: the steps
    """
    if not movements:
        return []
    cuts = pairwise(boundaries(movements, odometry))
    return [
        StepDriven(movement, name, requested(movement.step), sent(movement.sent, hold),
                   driven(odometry, begin, end))
        for movement, name, (begin, end) in zip(movements, names, cuts)]


def step_in_words(step: Step) -> str:
    """
    Return a step in a person's words, with the time that a velocity is held.

    :param step: the step
    :returns: a few words, with units
    """
    if isinstance(step, Move):
        return f'{in_words(step).removeprefix("move ")} for {step.duration:g} s'
    return in_words(step)
