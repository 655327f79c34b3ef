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
"""A motion as timed velocities: nothing in a plan can fail later."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import advance, integrate, ORIGIN, Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.planner import MotionValidator, PlannedItem
from kachaka_simple_control.motion.steps import Motion, Step
from kachaka_simple_control.motion.trajectory import Trajectory
from kachaka_simple_control.motion.units import require_finite, require_positive

#: How many segments a plan may have: goals for a day at 50 Hz, in less than a gigabyte.
MAX_SEGMENTS = 5_000_000


@dataclass(frozen=True, slots=True)
class Segment:
    """
    A time interval with one velocity, which is repeated at the plan's rate.

    :param start: its begin [s after t = 0]
    :param end: its end [s after t = 0]
    :param velocity: the velocity that is sent
    """

    start: float
    end: float
    velocity: Velocity


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """
    One step as it is planned, each time that it is driven.

    :param path: its path in the motion, as in ``steps[3].repeat.steps[0]``
    :param step: the step, which is no block of others
    :param start: its begin [s after t = 0]
    :param end: its end [s after t = 0]
    :param pose: where it ends, for a robot that began at the origin and drives as planned
    :param length: of its path, forwards and backwards [m]
    :param max_linear_velocity: the largest linear velocity sent, in either direction [m/s]
    :param max_angular_velocity: the largest angular velocity sent, in either direction [rad/s]
    :param trajectories: how it is driven, in order
    """

    path: str
    step: Step
    start: float
    end: float
    pose: Pose
    length: float
    max_linear_velocity: float
    max_angular_velocity: float
    trajectories: Sequence[Trajectory] = ()

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""
        return self.end - self.start


@dataclass(frozen=True)
class Plan:
    """
    The timed velocities of a motion; after the last segment the velocity is zero.

    :param segments: the velocities to send, in order, without gaps, beginning at 0 s
    :param period: how often a velocity is repeated within its segment [s]
    :param steps: the same by step, in order, repeats written out
    """

    segments: tuple[Segment, ...]
    period: float
    steps: tuple[PlannedStep, ...] = ()

    @property
    def duration(self) -> float:
        """Return how long the plan takes [s]."""
        return self.segments[-1].end if self.segments else 0.0

    @property
    def pose(self) -> Pose:
        """Return where it ends, for a robot that began at the origin and drives as planned."""
        return self.steps[-1].pose if self.steps else ORIGIN

    @property
    def length(self) -> float:
        """Return the length of its path, forwards and backwards [m]."""
        return sum(step.length for step in self.steps)

    @property
    def max_linear_velocity(self) -> float:
        """Return the largest linear velocity sent, in either direction [m/s]."""
        return max((step.max_linear_velocity for step in self.steps), default=0.0)

    @property
    def max_angular_velocity(self) -> float:
        """Return the largest angular velocity sent, in either direction [rad/s]."""
        return max((step.max_angular_velocity for step in self.steps), default=0.0)

    def path(self, start: Pose = ORIGIN) -> list[Pose]:
        """
        Return the poses that this plan predicts, for a robot that drives as planned.

        :param start: of the robot at t = 0
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
    Return the velocities that drive a motion.

    :param motion: the motion
    :param limits: of the robot
    :param rate: how often a velocity is sent [Hz]
    :raises InvalidMotionError: if a step is beyond a limit, the motion too long, or the rate not
        a positive number; ``find_errors`` returns all that is wrong with a motion
    """
    require_finite('rate', rate, 'Hz')
    require_positive('rate', rate, 'Hz')
    checked = MotionValidator(motion, limits)
    if checked.errors:
        raise checked.errors[0]
    count = checked.whole.total(
        lambda item: sum(trajectory.ticks(rate) for trajectory in item.trajectories))
    if count > MAX_SEGMENTS:
        raise InvalidMotionError(
            f'the motion needs {count:.10g} velocities at {rate} Hz; it may have {MAX_SEGMENTS} '
            'at most: take a lower rate')
    builder = _PlanBuilder(rate)
    for item in checked.whole.expand():
        builder.add(item)
    return builder.plan()


class _Sent(NamedTuple):
    """The velocities of each trajectory of an item, and the largest of all in either direction."""

    velocities: list[list[Velocity]]
    max_linear: float
    max_angular: float


class _PlanBuilder:
    """Puts the velocities of planned items one after the other."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._time = 0.0
        self._pose = ORIGIN
        self._segments: list[Segment] = []
        self._steps: list[PlannedStep] = []
        #: computed once for each item, however often it is repeated
        self._sent: dict[PlannedItem, _Sent] = {}

    def plan(self) -> Plan:
        return Plan(tuple(self._segments), 1.0 / self._rate, tuple(self._steps))

    def add(self, item: PlannedItem) -> None:
        if item not in self._sent:
            self._sent[item] = _sent(
                [trajectory.velocities(self._rate) for trajectory in item.trajectories])
        sent = self._sent[item]
        start, first, length = self._time, len(self._segments), 0.0
        for trajectory, velocities in zip(item.trajectories, sent.velocities):
            begin, path = self._time, trajectory.segment
            self._time = begin + trajectory.duration
            self._segments += _segments(velocities, begin, self._time)
            self._pose = advance(self._pose, path.length, path.angle)
            length += abs(path.length)
        has_segments = len(self._segments) > first
        self._steps.append(PlannedStep(
            item.path, item.step, start, self._time, self._pose, length,
            sent.max_linear if has_segments else 0.0, sent.max_angular if has_segments else 0.0,
            item.trajectories))


def _sent(velocities: list[list[Velocity]]) -> _Sent:
    return _Sent(
        velocities,
        max((abs(velocity.linear_x) for part in velocities for velocity in part), default=0.0),
        max((abs(velocity.angular_z) for part in velocities for velocity in part), default=0.0))


def _segments(velocities: list[Velocity], start: float, end: float) -> list[Segment]:
    tick = (end - start) / max(1, len(velocities))
    marks = [start, *(start + tick * number for number in range(1, len(velocities))), end]
    segments = list(map(Segment, marks, marks[1:], velocities))
    if tick > 1e-9 * end:
        return segments
    # A segment too short for the resolution of the time since t = 0 is left out.
    return [segment for segment in segments if segment.end > segment.start]
