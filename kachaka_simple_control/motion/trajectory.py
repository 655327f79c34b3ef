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
"""
Trajectories: parts of a path with their timing.

Each is driven along a path segment; only a ``ChainPath`` is driven along a chain of short arcs.

Tested by test/motion/test_plan.py.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import advance, Pose, Velocity, ZERO
from kachaka_simple_control.motion.path_segment import PathSegment
from kachaka_simple_control.motion.replanning import (
    replan_through,
    replan_to_rest,
    Replanned,
)
from kachaka_simple_control.motion.roots import bisection
from kachaka_simple_control.motion.velocity_profile import (
    PathLimits,
    PathState,
    VelocityProfile,
)

#: If a duration exceeds a whole number of periods by less than this fraction of the duration, the
#: excess comes from rounding and gets no tick of its own.
TIME_TOLERANCE = 1e-9
#: A last message shorter than this fraction of a period is a rounding error, not a message.
MESSAGE_TOLERANCE = 1e-6
#: How often a duration is halved to find the time of a position.  A duration of a day is halved to
#: less than a microsecond.
TIME_BISECTIONS = 40


class TimedVelocity(NamedTuple):
    """A velocity, and the time until the next one."""

    velocity: Velocity
    duration: float


class Piece(NamedTuple):
    """
    A part of a trajectory that is driven with one velocity.

    :param begin: from the start of the first piece on [s]
    :param end: [s]
    :param last: the state along the trajectory at the end
    :param rest: how long the robot stays at rest from the start on [s]; 0 while moving
    """

    begin: float
    end: float
    velocity: Velocity
    first: PathState
    last: PathState
    rest: float = 0.0


class Trajectory(ABC):
    """
    A path with its timing: what the plan, the tick scheduler and the tables need to know of it.

    A position along the path has a unit u of its own: m, rad, or s of planned time.
    """

    @property
    @abstractmethod
    def duration(self) -> float:
        """Return the planned duration [s]."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """Return the position of the end [m, rad or s]."""

    @property
    @abstractmethod
    def length(self) -> float:
        """Return the driven length [m], negative backwards."""

    @property
    @abstractmethod
    def angle(self) -> float:
        """Return the heading change [rad], positive to the left."""

    @property
    @abstractmethod
    def is_rest(self) -> bool:
        """Return whether the robot stands still during the whole path."""

    @property
    @abstractmethod
    def planned_start(self) -> PathState:
        """Return the planned position and velocity at the start."""

    @abstractmethod
    def advance(self, pose: Pose) -> Pose:
        """Return the pose of the robot at the end of the path."""

    @abstractmethod
    def ticks(self, rate: float) -> int:
        """Return the number of velocities that drive the path."""

    @abstractmethod
    def velocities(self, rate: float) -> list[Velocity]:
        """Return the velocities that drive the path as planned, each for the same time."""

    @abstractmethod
    def state_at(self, time: float) -> PathState:
        """Return the planned position, velocity and acceleration along the path at a time."""

    @abstractmethod
    def time_at(self, position: float) -> float:
        """Return the planned time since the start at which a position [u] is reached [s]."""

    @abstractmethod
    def first_state(self, factor: float, velocity: float) -> PathState:
        """
        Return the position and the velocity at the start, under a speed factor.

        :param velocity: what the previous trajectory leaves [u/s]; 0 at rest
        """

    @abstractmethod
    def exit_velocity(self, state: PathState) -> float:
        """Return the velocity that the next trajectory has to begin with; 0 after a rest."""

    @abstractmethod
    def pieces(
            self, state: PathState, factor: float, period: float,
            before: TimedVelocity) -> Iterator[Piece]:
        """
        Yield the velocities that drive the rest of the path under a speed factor.

        The robot may come to rest before the end.  The last piece then ends there.

        :param period: the longest duration of a piece [s]
        """


@dataclass(frozen=True)
class TimedPath(Trajectory):
    """A path segment with its timing: a ``ConstantVelocity`` or a ``ProfiledPath``."""

    segment: PathSegment
    limits: PathLimits

    @property
    def is_rest(self) -> bool:
        """Return whether the robot stands still during the whole path segment."""
        return self.segment.is_rest

    @property
    def extent(self) -> float:
        """Return the position of the end of the path segment [m, rad or s]."""
        return self.segment.distance

    @property
    def length(self) -> float:
        """Return the driven length [m], negative backwards."""
        return self.segment.length

    @property
    def angle(self) -> float:
        """Return the heading change [rad], positive to the left."""
        return self.segment.angle

    def advance(self, pose: Pose) -> Pose:
        """Return the pose of the robot at the end of the path segment."""
        return advance(pose, self.segment.length, self.segment.angle)

    @property
    def planned_start(self) -> PathState:
        """Return the planned position and velocity at the start of the path segment."""
        return self.first_state(1.0, 0.0)

    def exit_velocity(self, state: PathState) -> float:
        """Return the velocity that the next trajectory has to begin with; 0 after a rest."""
        return 0.0 if self.is_rest else state.velocity

    @abstractmethod
    def replanned(self, state: PathState, factor: float) -> Replanned:
        """Plan the rest of the path segment again for another speed factor."""

    def pieces(
            self, state: PathState, factor: float, period: float,
            before: TimedVelocity) -> Iterator[Piece]:  # noqa: ARG002
        """Yield the velocities that drive the rest of the path under a speed factor."""
        replanned = self.replanned(state, factor)
        duration = replanned.duration
        count = math.ceil(duration / period * (1.0 - MESSAGE_TOLERANCE))
        if not count:
            yield Piece(0.0, 0.0, ZERO, state, replanned.end)
        first, begin = state, 0.0
        for index in range(count):
            first = replanned.state_at(begin)
            end = duration * ((index + 1) / count)
            last = replanned.end if index + 1 == count else replanned.state_at(end)
            # In a piece without duration nothing is driven.
            velocity = ZERO if end <= begin else self.mean_velocity(
                last.position - first.position, end - begin)
            yield Piece(
                begin, end, velocity, first, last, duration - begin if self.is_rest else 0.0)
            begin = end

    @property
    @abstractmethod
    def max_rate(self) -> float:
        """Return the largest planned velocity along the path segment [u/s]."""

    def mean_velocity(self, distance: float, duration: float) -> Velocity:
        """
        Return the constant velocity at which the robot covers a distance in a time.

        Rounding cannot make it negative or larger than planned.
        """
        # Rounding must not raise the rate above the limit, or make it negative.
        return self.segment.velocity(min(max(0.0, distance / duration), self.max_rate))


class ConstantVelocity(TimedPath):
    """
    A path segment with one constant velocity, which is sent repeatedly at the rate of the plan.

    A position is the planned time since its start [s]; a velocity is 1 as planned, 0.5 at half the
    speed.
    """

    @property
    def duration(self) -> float:
        """Return the planned duration of the path segment [s]."""
        return self.segment.distance

    def ticks(self, rate: float) -> int:  # noqa: ARG002
        """Return the number of different velocities: 1, or 0 if the duration is 0."""
        return 1 if self.duration else 0

    def velocities(self, rate: float) -> list[Velocity]:
        """Return a list with the constant velocity; the list is empty if the duration is 0."""
        return [self.segment.velocity(self.max_rate)] * self.ticks(rate)

    def state_at(self, time: float) -> PathState:
        """Return the planned state at a time."""
        return PathState(time, self.max_rate)

    def time_at(self, position: float) -> float:
        """Return the planned time at which a position is reached: they are the same."""
        return position

    def first_state(self, factor: float, velocity: float) -> PathState:
        """
        Return the state at the start: its velocity is that before, or else the factor.

        At rest, a factor above 0 counts as 1, so that a wait does not become longer.
        """
        return PathState(0.0, velocity or self._rate(factor))

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """Plan the rest again for a new speed factor; the segment may end before it is reached."""
        return replan_through(state, self.duration, self._rate(factor), self.limits)

    @property
    def max_rate(self) -> float:
        """Return the largest planned velocity: 1."""
        return 1.0

    def _rate(self, factor: float) -> float:
        """Return the velocity for a speed factor; at rest 1 above 0, so a wait is no longer."""
        return math.ceil(factor) if self.segment.is_rest else factor


@dataclass(frozen=True)
class ProfiledPath(TimedPath):
    """A path segment that is driven from rest to rest along a velocity profile."""

    profile: VelocityProfile | Replanned

    @property
    def duration(self) -> float:
        """Return the planned duration of the path segment [s]."""
        return self.profile.duration

    def ticks(self, rate: float) -> int:
        """Return the number of equal time parts, each at most 1 / ``rate`` long."""
        if not self.duration:
            return 0
        return max(1, math.ceil(self.duration * rate * (1.0 - TIME_TOLERANCE)))

    def velocities(self, rate: float) -> list[Velocity]:
        """Return the velocities to send: the mean planned velocity in each tick."""
        if not self.duration:
            return []
        top, means = self.max_rate, self.profile.means(self.ticks(rate))
        # All parts of a cruise share one Velocity object.
        cruising = self.segment.velocity(top)
        return [cruising if mean >= top else self.segment.velocity(mean) for mean in means]

    def state_at(self, time: float) -> PathState:
        """Return the planned position, velocity and acceleration along the path at a time."""
        return self.profile.state_at(time)

    def time_at(self, position: float) -> float:
        """Return the planned time at which a position is reached [s], found by bisection."""
        return bisection(
            0.0, self.duration, lambda time: self.profile.state_at(time).position >= position,
            TIME_BISECTIONS)[1]

    def first_state(self, factor: float, velocity: float) -> PathState:  # noqa: ARG002
        """Return the position and the velocity at the start of the segment, which are both 0."""
        return PathState(0.0)

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """
        Plan the rest again to its end at rest; the factor multiplies the largest velocity.

        :param factor: 0 for a stop as soon as possible
        """
        return replan_to_rest(state, self.segment.distance, factor * self.max_rate, self.limits)

    @property
    def max_rate(self) -> float:
        """Return the largest planned velocity along the path segment [m/s or rad/s]."""
        return self.profile.velocity
