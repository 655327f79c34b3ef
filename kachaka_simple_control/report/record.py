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
"""What was sent and what odometry answered, with the times of both."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field

from kachaka_simple_control.motion.kinematics import Pose, Velocity
from kachaka_simple_control.motion.plan import Stage
from kachaka_simple_control.motion.steps import Step

#: A message is not early if it is by less than this [s]: times are sums of others.
ROUNDING = 1e-6


@dataclass(frozen=True)
class Sent:
    """
    A velocity that was published.

    :param time: when [s on the steady clock]
    :param velocity: what
    """

    time: float
    velocity: Velocity


@dataclass(frozen=True)
class Answered:
    """
    A pose that odometry told.

    :param time: when it arrived [s on the steady clock]
    :param pose: where the robot was, in ``odom``
    """

    time: float
    pose: Pose


@dataclass(frozen=True)
class Movement:
    """
    One step and the messages that belong to it.

    :param step: what was asked for
    :param began: when it began by the plan [s on the steady clock]
    :param sent: its messages, from its first to the one after its last, which ends it
    """

    step: Step
    began: float
    sent: tuple[Sent, ...]


@dataclass
class Record:
    """
    What happened, as far as this program can tell.

    :param movements: the steps that were completed, in order
    :param sent: every message since the last completed run
    :param odometry: every pose that arrived, in order
    """

    movements: list[Movement] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    odometry: list[Answered] = field(default_factory=list)

    def add_sent(self, time: float, velocity: Velocity) -> None:
        """
        Take note of a message.

        :param time: when it was published [s]
        :param velocity: what it carried
        """
        self.sent.append(Sent(time, velocity))

    def add_odometry(self, time: float, pose: Pose) -> None:
        """
        Take note of an answer.

        :param time: when it arrived [s]
        :param pose: where the robot was
        """
        self.odometry.append(Answered(time, pose))

    def complete(self, stages: Sequence[Stage], began: float) -> None:
        """
        Assign the messages since the last run to the steps of the one that has just ended.

        :param stages: its steps
        :param began: when its first message was sent [s on the steady clock]
        """
        starts = [bisect_left(self.sent, began + stage.start - ROUNDING, key=_time)
                  for stage in stages]
        for stage, first, last in zip(stages, starts, [*starts[1:], len(self.sent) - 1]):
            self.movements.append(Movement(
                stage.step, began + stage.start, tuple(self.sent[first:last + 1])))
        self.sent.clear()


def _time(sent: Sent) -> float:
    return sent.time
