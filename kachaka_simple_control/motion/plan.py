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
"""A motion under limits, ready to be driven: nothing in a plan can fail later."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from kachaka_simple_control.motion.errors import InvalidMotionError
from kachaka_simple_control.motion.kinematics import integrate, ORIGIN, Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion, Move


@dataclass(frozen=True)
class Segment:
    """
    A stretch of time with one velocity; repeated at the plan's rate while it lasts.

    :param start: when it begins [s after t = 0]
    :param end: when it ends [s after t = 0]
    :param velocity: what is sent
    """

    start: float
    end: float
    velocity: Velocity


@dataclass(frozen=True)
class Plan:
    """
    The timed velocities of a motion; after the last segment the velocity is zero.

    :param segments: what to send, in order, without gaps, beginning at 0 s
    :param period: how often a velocity is repeated within its segment [s]
    """

    segments: tuple[Segment, ...]
    period: float

    @property
    def duration(self) -> float:
        """How long the plan takes [s]."""
        return self.segments[-1].end if self.segments else 0.0

    def path(self, start: Pose = ORIGIN) -> list[Pose]:
        """
        Return the poses that this plan predicts, for a robot that does as it is told.

        :param start: where the robot is at t = 0
        :returns: the start and the pose at the end of each segment
        """
        poses = [start]
        for segment in self.segments:
            poses.append(integrate(poses[-1], segment.velocity, segment.end - segment.start))
        return poses


def plan(motion: Motion, limits: Limits, rate: float) -> Plan:
    """
    Turn a motion into the velocities to send.

    :param motion: what to do
    :param limits: what the robot can do
    :param rate: how often a velocity is sent [Hz]
    :returns: the plan
    :raises InvalidMotionError: if a step is beyond a limit, or the rate is not positive
    """
    if not (math.isfinite(rate) and rate > 0.0):
        raise InvalidMotionError(f'rate is {rate} Hz; it must be a finite number above 0 Hz')
    moves = [step for step in motion.steps if isinstance(step, Move)]
    if len(moves) < len(motion.steps):
        raise InvalidMotionError('only Move can be planned yet')
    for step in moves:
        limits.check(step.velocity)
    return Plan(segments=_segments(moves), period=1.0 / rate)


def _segments(steps: Sequence[Move]) -> tuple[Segment, ...]:
    ends = [0.0]
    for step in steps:
        ends.append(ends[-1] + step.duration)
    return tuple(
        Segment(start=start, end=end, velocity=step.velocity)
        for step, start, end in zip(steps, ends, ends[1:])
        if end > start)
