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
"""What there is to see of a drive at one time."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from kachaka_simple_control.motion.kinematics import Velocity


class State(Enum):
    """What is going on, in words that need no colour."""

    READY = 'ready'
    WAITING = 'waiting'
    MEETING = 'meeting'
    DRIVING = 'driving'
    STOPPING = 'stopping'
    STOPPED = 'stopped'
    CUT_SHORT = 'cut short'


@dataclass(frozen=True)
class Left:
    """
    How far it is to the end of a step.

    :param distance: along the path [m]; None if the step does not go anywhere
    :param angle: how far to turn [rad]; None if the step does not turn
    :param is_seen: whether odometry says so; otherwise what was sent does
    """

    distance: float | None
    angle: float | None
    is_seen: bool


@dataclass(frozen=True)
class Step:
    """
    The step under way.

    :param number: the how many-th it is, from 1 on
    :param count: of how many; None if nobody knows how many will come
    :param words: what it is
    :param duration: how long it takes [s]
    :param time_left: until its end, by the plan [s]
    :param left: how far it is to its end
    """

    number: int
    count: int | None
    words: str
    duration: float
    time_left: float
    left: Left


@dataclass(frozen=True)
class Glance:
    """
    What there is to see at one time.

    :param state: what is going on
    :param title: what is driven
    :param robot: by which robot; empty before that is known
    :param reason: why it was cut short; None if it was not
    :param step: the step under way; None without one
    :param duration: how long the motion takes [s]; None without one
    :param time_left: until its end, by the plan [s]
    :param commanded: what was sent last; None before
    :param seen: how fast odometry said the robot was; None if it never did
    :param seen_ago: how long ago that was [s]
    :param silence: how long nothing was heard of a program that should drive [s]; None if all is
        well
    """

    state: State
    title: str
    robot: str
    reason: str | None
    step: Step | None
    duration: float | None
    time_left: float
    commanded: Velocity | None
    seen: Velocity | None
    seen_ago: float
    silence: float | None

    @property
    def part(self) -> float:
        """Return how much of the motion is over, from 0 to 1."""
        return 1.0 - self.time_left / self.duration if self.duration else 1.0
