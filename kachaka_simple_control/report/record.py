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

from dataclasses import dataclass, field

from kachaka_simple_control.motion.kinematics import Pose, Velocity
from kachaka_simple_control.motion.steps import Move


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
    One movement and the messages that belong to it.

    :param step: what was asked for
    :param sent: its messages, from its first to the zero at its end
    """

    step: Move
    sent: tuple[Sent, ...]


@dataclass
class Record:
    """
    What happened, as far as this program can tell.

    :param movements: the movements that were completed, in order
    :param sent: every message since the last completed movement
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

    def complete(self, step: Move) -> None:
        """
        Assign the messages since the last movement to the one that has just ended.

        :param step: what was asked for
        """
        self.movements.append(Movement(step, tuple(self.sent)))
        self.sent.clear()
