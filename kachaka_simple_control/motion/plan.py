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
"""Check a motion against limits, and compute all its velocities before the drive begins."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.geometry import advance, integrate, ORIGIN, Pose, Velocity
from kachaka_simple_control.motion.limits import CLOSED_LOOP_SHARE, Limits
from kachaka_simple_control.motion.step_base import MAX_DURATION, Step
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.trajectory import Trajectory
from kachaka_simple_control.motion.units import FREQUENCY

#: The largest number of steps of a motion; a repeated step counts once for each repetition.
MAX_STEPS = 1_000_000
#: The largest number of segments of a plan.  It is enough for a day at 50 Hz, and takes less than
#: a gigabyte of memory.
MAX_SEGMENTS = 5_000_000


@dataclass(frozen=True, slots=True)
class Segment:
    """
    A time interval with one velocity, sent repeatedly at the plan's rate.

    :param start: the start time [s after the start of the plan]
    :param end: the end time [s after the start of the plan]
    :param velocity: the velocity that is sent
    """

    start: float
    end: float
    velocity: Velocity


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """
    One step of a plan; a repeated step has one entry for each repetition.

    :param path: the place of the step in the motion, as in ``steps[3].repeat.steps[0]``
    :param step: the step, which is never a repeat
    :param start: the start time [s after the start of the plan]
    :param end: the end time [s after the start of the plan]
    :param pose: the planned pose at the end of the step; the plan starts at the origin
    :param length: the length of the path, forwards plus backwards [m]
    :param max_linear_velocity: the largest linear velocity sent, in either direction [m/s]
    :param max_angular_velocity: the largest angular velocity sent, in either direction [rad/s]
    :param trajectories: the trajectories that drive the step, in order
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
        """Return the duration of the step [s]."""
        return self.end - self.start


@dataclass(frozen=True)
class Plan:
    """
    The timed velocities of a motion; after the last segment the velocity is zero.

    :param segments: the velocities to send, in order; they start at 0 s and have no gaps
    :param period: the time after which a velocity is sent again within its segment [s]
    :param steps: the planned steps, in order, with each repetition as its own entry
    """

    segments: tuple[Segment, ...]
    period: float
    steps: tuple[PlannedStep, ...] = ()

    @property
    def duration(self) -> float:
        """Return the duration of the plan [s]."""
        return self.segments[-1].end if self.segments else 0.0

    @property
    def pose(self) -> Pose:
        """Return the planned pose at the end of the plan; the plan starts at the origin."""
        return self.steps[-1].pose if self.steps else ORIGIN

    @property
    def length(self) -> float:
        """Return the length of the path, forwards plus backwards [m]."""
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
        Return the poses of a robot that drives exactly as planned.

        :param start: the pose of the robot at the start of the plan
        :returns: the start pose, then the pose at the end of each segment
        """
        poses = [start]
        for segment in self.segments:
            poses.append(integrate(poses[-1], segment.velocity, segment.end - segment.start))
        return poses

    def step_index(self, elapsed: float) -> int:
        """
        Return the index of the step that is driven at a time.

        :param elapsed: the time since the start of the plan [s]
        :returns: the index in ``steps``: 0 before the start, and the last index after the end.  If
            several steps start at the same time, it is the index of the last of them
        """
        return max(0, bisect_right(self.steps, elapsed, key=attrgetter('start')) - 1)


def find_errors(motion: Motion, limits: Limits) -> list[InvalidMotionError]:
    """
    Return all errors of a motion for the limits of a robot.

    :param motion: the motion
    :param limits: the limits of the robot
    :returns: the errors, in the order of the motion.  If there are none, ``plan()`` refuses the
        motion only if the rate is invalid or gives more than ``MAX_SEGMENTS`` velocities
    """
    return _apply_limits(motion, limits)[1]


def plan(motion: Motion, limits: Limits, rate: float) -> Plan:
    """
    Return the plan of a motion: the timed velocities that drive it.

    :param motion: the motion
    :param limits: the limits of the robot
    :param rate: the rate at which velocities are sent [Hz]
    :raises InvalidMotionError: if a step is beyond a limit, the motion is too long, or the rate
        is not a positive number; ``find_errors()`` returns all errors of a motion
    """
    FREQUENCY.require('rate', rate)
    whole, errors = _apply_limits(motion, limits)
    if errors:
        raise errors[0]
    count = whole.total(
        lambda item: sum(trajectory.ticks(rate) for trajectory in item.trajectories))
    if count > MAX_SEGMENTS:
        raise InvalidMotionError(
            f'the motion needs {count:.10g} velocities at {rate} Hz; it may have {MAX_SEGMENTS} '
            'at most: take a lower rate')
    return _planned(whole.expand(), rate)


# Compared by identity: a repeated item is one object.
@dataclass(frozen=True, eq=False)
class _Item:
    """A step, its place in the motion, and its trajectories; a refused step may have none."""

    path: str
    step: Step
    trajectories: Sequence[Trajectory]


class _Block(NamedTuple):
    """Steps that are driven several times, with the trajectories of each step."""

    times: int
    parts: Sequence[_Item | _Block]

    def total(self, measure: Callable[[_Item], float]) -> float:
        """Return the sum of a measure of all steps; a step counts once for each repetition."""
        return self.times * sum(
            measure(part) if isinstance(part, _Item) else part.total(measure)
            for part in self.parts)

    def expand(self) -> list[_Item]:
        """Return the steps in driving order; a step occurs once for each repetition."""
        return self.times * [
            item for part in self.parts
            for item in ([part] if isinstance(part, _Item) else part.expand())]


def _apply_limits(motion: Motion, limits: Limits) -> tuple[_Block, list[InvalidMotionError]]:
    """
    Return the steps of a motion with their trajectories, and all errors of the motion.

    A repeated step is checked once, not once for each repetition.
    """
    errors: list[InvalidMotionError] = []

    def part(step: Step, path: str) -> _Item | _Block:
        place = f'{path}.{step.keyword}.'
        if (block := step.block()) is not None:
            return _Block(block[0], parts(block[1], place))
        return _Item(path, step, step.trajectories(
            limits, lambda name, error: errors.append(error.at(place + name))))

    def parts(steps: Sequence[Step], prefix: str) -> list[_Item | _Block]:
        return [part(step, f'{prefix}steps[{index}]') for index, step in enumerate(steps)]

    whole = _Block(1, parts(motion.steps, ''))
    count = whole.total(lambda _: 1)
    if count > MAX_STEPS:
        errors.append(InvalidMotionError(
            f'the motion has {count:.10g} steps, its repeats counted; it may have {MAX_STEPS} at '
            'most'))
    duration = whole.total(
        lambda item: sum(trajectory.duration for trajectory in item.trajectories))
    if duration > MAX_DURATION:
        errors.append(InvalidMotionError(
            f'the motion takes {duration:.10g} s, its repeats counted; it may take '
            f'{MAX_DURATION:.10g} s at most'))
    return whole, errors


class _Sent(NamedTuple):
    """The velocities of each trajectory of a step, and the largest linear and angular velocity."""

    velocities: list[list[Velocity]]
    max_linear: float
    max_angular: float


def _planned(items: Sequence[_Item], rate: float) -> Plan:
    """Return the plan of steps that are in driving order."""
    segments: list[Segment] = []
    steps: list[PlannedStep] = []
    time, pose = 0.0, ORIGIN
    #: the velocities of each item, computed once even if the item is repeated
    known: dict[_Item, _Sent] = {}
    for item in items:
        if item not in known:
            known[item] = _sent([trajectory.velocities(rate) for trajectory in item.trajectories])
        sent = known[item]
        start, first, length = time, len(segments), 0.0
        for trajectory, velocities in zip(item.trajectories, sent.velocities):
            begin, path = time, trajectory.segment
            time = begin + trajectory.duration
            segments += _segments(velocities, begin, time)
            pose = advance(pose, path.length, path.angle)
            length += abs(path.length)
        has_segments = len(segments) > first
        steps.append(PlannedStep(
            item.path, item.step, start, time, pose, length,
            sent.max_linear if has_segments else 0.0, sent.max_angular if has_segments else 0.0,
            item.trajectories))
    return Plan(tuple(segments), 1.0 / rate, tuple(steps))


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
    # Leave out a segment that is shorter than the resolution of the time since t = 0.
    return [segment for segment in segments if segment.end > segment.start]


@dataclass(frozen=True)
class DriveOrder:
    """
    A motion with all that its plan depends on, for a drive or a preview.

    :param motion: the motion; for a closed loop, with a settle step at its end
    :param limits: the limits to plan with
    :param rate: the rate at which velocities are sent [Hz]
    :param allowed: the limits that no velocity of the plan may exceed
    :param corrected: the limits of velocities corrected from odometry, higher than ``limits``;
        None if the velocities are sent as planned
    """

    motion: Motion
    limits: Limits
    rate: float
    allowed: Limits
    corrected: Limits | None = None

    @classmethod
    def of(cls, motion: Motion, robot: Limits, rate: float, limits: Limits | None = None,
           is_closed_loop: bool = False) -> DriveOrder:
        """
        Return a drive order with the limits for an open or a closed loop.

        :param motion: the motion
        :param robot: the limits of the robot for plans
        :param rate: the rate at which velocities are sent [Hz]
        :param limits: the limits of the motion; None for the limits of the robot
        :param is_closed_loop: whether velocities are corrected from odometry
        """
        limits = limits or robot
        if not is_closed_loop:
            return cls(motion, limits, rate, robot)
        return cls(motion.settled(), limits.scaled(CLOSED_LOOP_SHARE), rate,
                   robot.scaled(CLOSED_LOOP_SHARE), limits.tightened(robot))

    def plan(self) -> Plan:
        """
        Return the plan of the motion.

        :raises InvalidMotionError: if the motion is invalid, or the robot cannot drive it
        """
        try:
            planned = plan(self.motion, self.limits, self.rate)
        except InvalidMotionError as error:
            raise error if self.corrected is None else error.by("the closed loop's") from None
        if self.limits.exceeds(self.allowed):
            # Otherwise such a velocity would be refused during the motion.
            for velocity in {segment.velocity for segment in planned.segments}:
                self.allowed.check(velocity)
        return planned
