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

from bisect import bisect_right
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import advance, integrate, ORIGIN, Pose, Velocity
from kachaka_simple_control.motion.limits import Limits, require_finite, require_positive
from kachaka_simple_control.motion.planner import expand, MotionValidator, PlannedItem, total
from kachaka_simple_control.motion.steps import Motion, Step

#: How many segments a plan may have: goals for a day at 50 Hz, in less than a gigabyte.
MAX_SEGMENTS = 5_000_000


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """
    What one step comes to, each time that it is driven.

    :param path: its place in the motion, as in ``steps[3].repeat.steps[0]``
    :param step: the step; never a repeat
    :param start: when it begins [s after t = 0]
    :param end: when it ends [s after t = 0]
    :param pose: where it ends, for a robot that began at the origin and does as it is told
    :param length: how far it drives, forwards or backwards [m]
    :param max_linear_velocity: the largest linear velocity sent, in either direction [m/s]
    :param max_angular_velocity: the largest angular velocity sent, in either direction [rad/s]
    """

    path: str
    step: Step
    start: float
    end: float
    pose: Pose
    length: float
    max_linear_velocity: float
    max_angular_velocity: float


@dataclass(frozen=True)
class Plan:
    """
    The timed velocities of a motion; after the last segment the velocity is zero.

    :param segments: what to send, in order, without gaps, beginning at 0 s
    :param period: how often a velocity is repeated within its segment [s]
    :param stages: the same by step, in order, repeats written out
    """

    segments: tuple[Segment, ...]
    period: float
    steps: tuple[PlannedStep, ...] = ()

    @property
    def duration(self) -> float:
        """How long the plan takes [s]."""
        return self.segments[-1].end if self.segments else 0.0

    @property
    def pose(self) -> Pose:
        """Where it ends, for a robot that began at the origin and does as it is told."""
        return self.steps[-1].pose if self.steps else ORIGIN

    @property
    def length(self) -> float:
        """How far it drives, forwards and backwards [m]."""
        return sum(stage.length for stage in self.steps)

    @property
    def max_linear_velocity(self) -> float:
        """The largest linear velocity sent, in either direction [m/s]."""
        return max((stage.max_linear_velocity for stage in self.steps), default=0.0)

    @property
    def max_angular_velocity(self) -> float:
        """The largest angular velocity sent, in either direction [rad/s]."""
        return max((stage.max_angular_velocity for stage in self.steps), default=0.0)

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

    def step_index(self, elapsed: float) -> int:
        """
        Return which step is under way at a time.

        :param elapsed: the time since t = 0 [s]
        :returns: its index in ``steps``: the first before t = 0, the last after the end; of
            several that begin at once the last
        """
        return max(0, bisect_right(self.steps, elapsed, key=attrgetter('start')) - 1)


def plan(motion: Motion, limits: Limits, rate: float) -> Plan:
    """
    Turn a motion into the velocities to send.

    :param motion: what to do
    :param limits: what the robot can do
    :param rate: how often a velocity is sent [Hz]
    :returns: the plan
    :raises InvalidMotionError: if a step is beyond a limit, the motion too long, or the rate not
        a positive number; ``find_errors`` tells all that is wrong with a motion
    """
    require_finite('rate', rate, 'Hz')
    require_positive('rate', rate, 'Hz')
    survey = MotionValidator(motion, limits)
    if survey.errors:
        raise survey.errors[0]
    count = total(survey.parts, lambda leg: leg.course.ticks(rate))
    if count > MAX_SEGMENTS:
        raise InvalidMotionError(
            f'the motion needs {count:.10g} velocities at {rate} Hz; it may have {MAX_SEGMENTS} '
            'at most: take a lower rate')
    return _PlanBuilder(rate).drawn(expand(survey.parts))


class _Sent(NamedTuple):
    """What a leg sends each time, and the largest of it in either direction."""

    velocities: list[Velocity]
    max_linear: float
    max_angular: float


class _PlanBuilder:
    """A plan being made, leg after leg."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._time = 0.0
        self._pose = ORIGIN
        self._segments: list[Segment] = []
        self._stages: list[PlannedStep] = []
        #: found but once for each leg, however often it is repeated
        self._sent: dict[PlannedItem, _Sent] = {}

    def drawn(self, legs: list[PlannedItem]) -> Plan:
        for leg in legs:
            if leg not in self._sent:
                self._sent[leg] = _sent(leg.course.velocities(self._rate))
            self._draw(leg, self._sent[leg])
        return Plan(tuple(self._segments), 1.0 / self._rate, tuple(self._stages))

    def _draw(self, leg: PlannedItem, sent: _Sent) -> None:
        start, course = self._time, leg.course
        self._time = start + course.duration
        segments = _segments(sent.velocities, start, self._time)
        self._segments += segments
        self._pose = advance(self._pose, course.length, course.angle)
        self._stages.append(PlannedStep(
            leg.path, leg.step, start, self._time, self._pose, abs(course.length),
            sent.max_linear if segments else 0.0, sent.max_angular if segments else 0.0))


def _sent(velocities: list[Velocity]) -> _Sent:
    return _Sent(
        velocities,
        max((abs(velocity.linear_x) for velocity in velocities), default=0.0),
        max((abs(velocity.angular_z) for velocity in velocities), default=0.0))


def _segments(velocities: list[Velocity], start: float, end: float) -> list[Segment]:
    tick = (end - start) / max(1, len(velocities))
    marks = [start, *(start + tick * number for number in range(1, len(velocities))), end]
    segments = list(map(Segment, marks, marks[1:], velocities))
    if tick > 1e-9 * end:
        return segments
    # A time so short that it is lost beside the time since t = 0 is none.
    return [segment for segment in segments if segment.end > segment.start]
