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
"""Check a motion against limits, and compute all its velocities before the robot drives."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.flow import Cut, find_flows, FlowPart, plan_flow
from kachaka_simple_control.motion.geometry import Displacement, integrate, ORIGIN, Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.placing import Block, has_placed_steps, Leaf, Placer
from kachaka_simple_control.motion.step_base import MAX_DURATION, Step
from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.trajectory import ProfiledPath, Trajectory
from kachaka_simple_control.motion.units import FREQUENCY

#: The largest number of steps of a motion; a repeated step counts once for each repetition.
MAX_STEPS = 1_000_000
#: The largest number of segments of a plan.  It is enough for a day at 50 Hz, and takes less than
#: a gigabyte of memory.
MAX_SEGMENTS = 5_000_000


@dataclass(frozen=True, slots=True)
class Segment:
    """A time interval of a plan [s], in which the same velocity is sent repeatedly."""

    start: float
    end: float
    velocity: Velocity


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """
    One step of a motion, or one repetition of it, with its planned times, velocities and end pose.

    :param path: its place in the motion, as in ``steps[3].repeat.steps[0]``
    :param start: [s after the start of the plan], as ``end``
    :param pose: the pose at the end of the step, relative to the start of the plan
    :param length: of its path [m]; parts driven backwards count as positive
    :param max_linear_velocity: the largest one sent, without its sign [m/s]
    :param max_angular_velocity: the largest one sent, without its sign [rad/s]
    :param trajectories: in driving order
    :param cut: for a turn that became a corner, how much of the corner is cut; None otherwise
    :param joins_next: whether the robot goes on into the next step without a stop
    :param included: the name of the motion that includes it; empty if none does
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
    cut: Cut | None = None
    joins_next: bool = False
    included: str = ''

    @property
    def duration(self) -> float:
        """Return the planned duration of the step [s]."""
        return self.end - self.start

    def named(self, text: str) -> str:
        """Return a text about the step, after the name of the motion that includes it."""
        return f'{self.included}: {text}' if self.included else text

    @property
    def displacement(self) -> Displacement:
        """Return the planned displacement: not that of the step if a corner replaces a part."""
        return Displacement(math.fsum(path.length for path in self.trajectories),
                            math.fsum(path.angle for path in self.trajectories))


@dataclass(frozen=True)
class Plan:
    """
    The velocities that drive a motion, each with its start time and end time; then zero.

    :param segments: from 0 s on, without gaps
    :param period: the longest time between two messages [s]; in a longer segment, the same
        velocity is sent again
    :param steps: a repeated step occurs once for each repetition
    :param saved_time: how much shorter the plan is than with a stop at each step [s]
    """

    segments: tuple[Segment, ...]
    period: float
    steps: tuple[PlannedStep, ...] = ()
    saved_time: float = 0.0

    def __reduce__(self) -> tuple[object, ...]:
        """Return what another process gets: numbers, in place of 180 000 segments an hour."""
        numbers = array('d')
        for segment in self.segments:
            velocity = segment.velocity
            numbers.extend((segment.end, velocity.linear_x, velocity.angular_z))
        return _restored, (numbers, self.period, self.steps, self.saved_time)

    @property
    def duration(self) -> float:
        """Return the duration of the plan [s]."""
        return self.segments[-1].end if self.segments else 0.0

    @property
    def pose(self) -> Pose:
        """Return the planned pose at the end, from 0, 0, 0 at the start."""
        return self.steps[-1].pose if self.steps else ORIGIN

    @property
    def length(self) -> float:
        """Return the length of the whole path [m]; parts driven backwards count as positive."""
        return sum(step.length for step in self.steps)

    @property
    def max_linear_velocity(self) -> float:
        """Return the largest linear velocity of the plan, without its sign [m/s]."""
        return max((step.max_linear_velocity for step in self.steps), default=0.0)

    @property
    def max_angular_velocity(self) -> float:
        """Return the largest angular velocity of the plan, without its sign [rad/s]."""
        return max((step.max_angular_velocity for step in self.steps), default=0.0)

    def path(self, start: Pose = ORIGIN) -> list[Pose]:
        """Return the poses of a robot that drives exactly as planned."""
        poses = [start]
        for segment in self.segments:
            poses.append(integrate(poses[-1], segment.velocity, segment.end - segment.start))
        return poses

    def velocity_at(self, elapsed: float) -> Velocity:
        """Return the planned velocity at a time of the plan, which has one."""
        return self.segments[
            max(0, bisect_right(self.segments, elapsed, key=attrgetter('start')) - 1)].velocity

    def step_index(self, elapsed: float) -> int:
        """Return the index of the step that the robot drives at a given time of the plan."""
        return max(0, bisect_right(self.steps, elapsed, key=attrgetter('start')) - 1)


def _restored(
        numbers: array[float], period: float, steps: tuple[PlannedStep, ...],
        saved_time: float) -> Plan:
    segments: list[Segment] = []
    start, velocity = 0.0, Velocity()
    for end, *now in zip(numbers[::3], numbers[1::3], numbers[2::3]):
        if now != [velocity.linear_x, velocity.angular_z]:
            velocity = Velocity(*now)
        segments.append(Segment(start, end, velocity))
        start = end
    return Plan(tuple(segments), period, steps, saved_time)


def find_errors(motion: Motion, limits: Limits) -> list[InvalidMotionError]:
    """
    Return all reasons why a robot with given limits cannot drive a motion.

    But for those of the rate, which ``plan()`` finds.

    :returns: the errors of the steps in their order, then those of the whole motion
    """
    return _apply_limits(motion, limits)[1]


def plan(motion: Motion, limits: Limits, rate: float) -> Plan:
    """
    Return the plan of a motion: all velocities that drive it, with their times.

    :raises InvalidMotionError: the first one of ``find_errors()``, or for more than
        ``MAX_SEGMENTS`` velocities, or a rate that is not a positive number
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
    items = whole.expand()
    if not any(item.corners for item in items):
        return _planned(items, rate)
    joined = _join(items, limits, rate)
    saved = sum(one.duration - two.duration for one, two in zip(items, joined))
    return replace(_planned(joined, rate), saved_time=saved)


# Compared by identity: a repeated item is one object.
@dataclass(frozen=True, eq=False)
class _Item:
    """One step of a motion, with its place and its trajectories; none if it cannot be driven."""

    path: str
    step: Step
    trajectories: Sequence[Trajectory]
    corners: float = 0.0
    included: str = ''
    cut: Cut | None = None
    joins_next: bool = False

    @property
    def duration(self) -> float:
        """Return the duration [s]."""
        return sum(trajectory.duration for trajectory in self.trajectories)


class _Block(NamedTuple):
    """A list of steps and blocks, and the number of times that it is driven."""

    times: int
    parts: Sequence[_Item | _Block]

    def total(self, measure: Callable[[_Item], float]) -> float:
        """Add up a number over all steps and repetitions, for example their durations."""
        return self.times * sum(
            measure(part) if isinstance(part, _Item) else part.total(measure)
            for part in self.parts)

    def expand(self) -> list[_Item]:
        """Return the steps in driving order, with each repetition."""
        return self.times * [
            item for part in self.parts
            for item in ([part] if isinstance(part, _Item) else part.expand())]


def _apply_limits(motion: Motion, limits: Limits) -> tuple[_Block, list[InvalidMotionError]]:
    """Return the steps of a motion with their trajectories, and all errors, each once."""
    errors: list[InvalidMotionError] = []

    def part(step: Step, path: str, corners: float, included: str) -> _Item | _Block:
        place = f'{path}.{step.keyword}.'
        if (block := step.block()) is not None:
            return _Block(block[0], parts(
                block[1], place, corners if step.corners is None else step.corners,
                included if step.name is None else step.name))
        return _Item(path, step, step.trajectories(
            limits, lambda name, error: errors.append(error.at(place + name))), corners, included)

    def parts(
            steps: Sequence[Step], prefix: str, corners: float,
            included: str) -> list[_Item | _Block]:
        return [part(step, f'{prefix}steps[{index}]', corners, included)
                for index, step in enumerate(steps)]

    if any(map(has_placed_steps, motion.steps)):
        whole = _place(motion, limits, errors)
    else:
        whole = _Block(1, parts(motion.steps, '', motion.corners, ''))
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


def _place(motion: Motion, limits: Limits, errors: list[InvalidMotionError]) -> _Block:
    """Return the steps of a motion in which steps depend on the pose at their start."""
    known: dict[Leaf, _Item] = {}
    refused: set[str] = set()
    count, duration = 0, 0.0

    def refuse(place: str, error: InvalidMotionError) -> None:
        if place not in refused:
            refused.add(place)
            errors.append(error.at(place))

    def visit(leaf: Leaf) -> None:
        nonlocal count, duration
        if leaf not in known:
            known[leaf] = _Item(leaf.path, leaf.step, leaf.step.trajectories(
                limits, lambda name, error: refuse(
                    leaf.speed_place if name == 'speed' else leaf.place + name, error)),
                leaf.corners, leaf.included)
        count, duration = count + 1, duration + known[leaf].duration
        # Ends a repeat whose passes all differ, before it needs much time and memory.
        if count > MAX_STEPS or duration > MAX_DURATION:
            raise InvalidMotionError(
                f'the motion has more than {MAX_STEPS} steps or takes more than '
                f'{MAX_DURATION:.10g} s, its repeats counted')

    def parts(placed: Sequence[Leaf | Block]) -> list[_Item | _Block]:
        return [_Block(part.times, parts(part.parts)) if isinstance(part, Block) else known[part]
                for part in placed]

    try:
        return _Block(1, parts(Placer(motion.corners, visit, refuse).parts(motion.steps, '')))
    except InvalidMotionError as error:
        errors.append(error)
        return _Block(1, [])


def _join(items: Sequence[_Item], limits: Limits, rate: float) -> list[_Item]:
    """Return the steps with their flows joined, so that the robot does not stop in them."""
    parts = [
        FlowPart(path if isinstance(path, ProfiledPath) else None, item.corners)
        for item in items for path in [item.trajectories[0] if item.trajectories else None]]
    joined = list(items)
    #: equal steps are one object, as before, so that their velocities are computed once
    known: dict[tuple[object, ...], _Item] = {}
    for flow in find_flows(parts):
        planned = plan_flow([parts[index] for index in flow], limits, rate)
        for index, step in zip(flow, planned):
            item = items[index]
            key = (id(item), *map(id, step.trajectories), step.cut, step.joins_next)
            if key not in known:
                known[key] = replace(item, trajectories=step.trajectories, cut=step.cut,
                                     joins_next=step.joins_next)
            joined[index] = known[key]
    return joined


class _Sent(NamedTuple):
    """The velocities of each trajectory of a step, and the largest ones, without signs."""

    velocities: list[list[Velocity]]
    max_linear: float
    max_angular: float


def _planned(items: Sequence[_Item], rate: float) -> Plan:
    """Return the plan that drives steps one after the other."""
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
            begin = time
            time = begin + trajectory.duration
            segments += _segments(velocities, begin, time)
            pose = trajectory.advance(pose)
            length += abs(trajectory.length)
        has_segments = len(segments) > first
        steps.append(PlannedStep(
            item.path, item.step, start, time, pose, length,
            sent.max_linear if has_segments else 0.0, sent.max_angular if has_segments else 0.0,
            item.trajectories, item.cut, item.joins_next, item.included))
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
