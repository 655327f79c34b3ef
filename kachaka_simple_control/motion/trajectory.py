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

Each of them is driven along a path segment, which is a part of the path with constant curvature.
Only a ``ChainPath`` (see ``chain.py``) is driven along a chain of short arcs.
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


class Sent(NamedTuple):
    """
    A velocity, and the time until the next one.

    :param velocity: the velocity
    :param duration: how long the robot keeps the velocity [s]
    """

    velocity: Velocity
    duration: float


class Piece(NamedTuple):
    """
    A part of a trajectory that is driven with one velocity.

    :param begin: the time of its start, from the start of the first piece on [s]
    :param end: the time of its end [s]
    :param velocity: the velocity to send
    :param first: the state along the trajectory at the start
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

    A position along the path has a unit of its own: m, rad, or s of planned time.
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
        """
        Return the pose of the robot at the end of the path.

        :param pose: its pose at the start
        """

    @abstractmethod
    def ticks(self, rate: float) -> int:
        """
        Return the number of velocities that drive the path.

        :param rate: the rate at which velocities are sent [Hz]
        """

    @abstractmethod
    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return the velocities that drive the path as planned, each for the same time.

        :param rate: the rate at which velocities are sent [Hz]
        """

    @abstractmethod
    def state_at(self, time: float) -> PathState:
        """
        Return the planned position, velocity and acceleration along the path at a time.

        :param time: the time since the start [s]
        """

    @abstractmethod
    def time_at(self, position: float) -> float:
        """
        Return the planned time since the start at which a position is reached [s].

        :param position: the position [m, rad or s]
        """

    @abstractmethod
    def first_state(self, factor: float, velocity: float) -> PathState:
        """
        Return the position and the velocity at the start, under a speed factor.

        :param factor: the speed factor, from 0 to 1
        :param velocity: the velocity that the previous trajectory leaves, in its unit; 0 at rest
        """

    @abstractmethod
    def exit_velocity(self, state: PathState) -> float:
        """
        Return the velocity that the next trajectory has to begin with; 0 after a rest.

        :param state: the position and the velocity at the end
        """

    @abstractmethod
    def pieces(
            self, state: PathState, factor: float, period: float,
            before: Sent) -> Iterator[Piece]:
        """
        Yield the velocities that drive the rest of the path under a speed factor.

        The robot may come to rest before the end.  The last piece then ends there.

        :param state: the current position, velocity and acceleration along the path
        :param factor: the speed factor, from 0 to 1
        :param period: the longest duration of a piece [s]
        :param before: the velocity before, and its duration
        """


@dataclass(frozen=True)
class TimedPath(Trajectory):
    """
    A path segment with its timing: the base class of ``ConstantVelocity`` and ``ProfiledPath``.

    :param segment: the segment
    :param limits: the limits along the segment
    """

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
        """
        Return the pose of the robot at the end of the path segment.

        :param pose: its pose at the start of the segment
        """
        return advance(pose, self.segment.length, self.segment.angle)

    @property
    def planned_start(self) -> PathState:
        """Return the planned position and velocity at the start of the path segment."""
        return self.first_state(1.0, 0.0)

    def exit_velocity(self, state: PathState) -> float:
        """
        Return the velocity that the next trajectory has to begin with; 0 after a rest.

        :param state: the position and the velocity at the end of the path segment
        """
        return 0.0 if self.is_rest else state.velocity

    @abstractmethod
    def replanned(self, state: PathState, factor: float) -> Replanned:
        """Plan the rest of the path segment again for another speed factor."""

    def pieces(
            self, state: PathState, factor: float, period: float,
            before: Sent) -> Iterator[Piece]:  # noqa: ARG002
        """
        Yield the velocities that drive the rest of the path segment under another speed factor.

        The robot may come to rest before the end.  The last piece then ends there.

        :param state: the current position, velocity and acceleration along the segment
        :param factor: the speed factor, from 0 to 1
        :param period: the longest duration of a piece [s]
        :param before: the velocity before; not used
        """
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
        """
        Return the largest planned velocity along the path segment [u/s].

        u is the unit of the segment's length: the metre, the radian, or the second of planned
        time.
        """

    def mean_velocity(self, distance: float, duration: float) -> Velocity:
        """
        Return the constant velocity at which the robot covers a distance in a time.

        Rounding can make the velocity along the path segment negative or larger than its largest
        planned value.  It is then set to 0 or to this largest value.

        :param distance: the distance along the segment, in metres, radians, or seconds of planned
            time
        :param duration: the time [s]
        """
        # Rounding must not raise the rate above the limit, or make it negative.
        return self.segment.velocity(min(max(0.0, distance / duration), self.max_rate))


class ConstantVelocity(TimedPath):
    """
    A path segment with one constant velocity, which is sent repeatedly at the rate of the plan.

    A position along the segment is the planned time since the start of the segment [s].  A
    velocity along the segment is the planned time that passes in each second: 1 as planned, and
    0.5 if the motion is slowed down to half its speed.
    """

    @property
    def duration(self) -> float:
        """Return the planned duration of the path segment [s]."""
        return self.segment.distance

    def ticks(self, rate: float) -> int:  # noqa: ARG002
        """
        Return the number of different velocities in the path segment.

        The result is 1, or 0 if the duration is 0.

        :param rate: not used
        """
        return 1 if self.duration else 0

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return a list with the constant velocity; the list is empty if the duration is 0.

        :param rate: the rate at which velocities are sent [Hz]; it does not change the result
        """
        return [self.segment.velocity(self.max_rate)] * self.ticks(rate)

    def state_at(self, time: float) -> PathState:
        """
        Return the planned position and velocity along the path segment at a time.

        The position is the planned time since the start of the segment, so it is equal to
        ``time``.  The velocity is the planned time that passes in each second, so it is 1.

        :param time: the time since the start of the segment [s]
        """
        return PathState(time, self.max_rate)

    def time_at(self, position: float) -> float:
        """
        Return the planned time at which a position is reached [s]; it is equal to the position.

        :param position: the position along the path segment, given as the planned time since the
            start of the segment [s]
        """
        return position

    def first_state(self, factor: float, velocity: float) -> PathState:
        """
        Return the position and the velocity at the start of the path segment.

        The position is 0.  If ``velocity`` is not 0, it is also the returned velocity.  Otherwise
        the returned velocity is ``factor``.  But if the robot stands still in the segment, a
        factor above 0 is rounded up to 1, so that a wait does not become longer.

        :param factor: the speed factor, which is the speed relative to the plan, from 0 to 1
        :param velocity: the velocity at the end of the previous segment: the planned time that
            passes in each second, so it is 1 at the planned speed
        """
        return PathState(0.0, velocity or self._rate(factor))

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """
        Plan the rest of the path segment again for a new speed factor.

        The velocity along the segment is the planned time that passes in each second.  It changes
        to the speed factor as fast as the limits allow.  If the rest of the segment is too short
        for this change, the change is not finished at the end of the segment.  If the robot stands
        still in the segment, a factor above 0 is rounded up to 1, so that a wait does not become
        longer.

        :param state: the current position, velocity and acceleration along the segment
        :param factor: the speed factor, which is the speed relative to the plan, from 0 to 1; 0
            means a stop
        """
        return replan_through(state, self.duration, self._rate(factor), self.limits)

    @property
    def max_rate(self) -> float:
        """
        Return the largest planned velocity along the path segment, which is 1.

        The velocity along the segment is the planned time that passes in each second.
        """
        return 1.0

    def _rate(self, factor: float) -> float:
        """
        Return the velocity along the path segment for a speed factor.

        This velocity is the planned time that passes in each second.  If the robot moves in the
        segment, the result is the factor.  If the robot stands still in the segment, a factor
        above 0 is rounded up to 1, so that a wait does not become longer.

        :param factor: the speed factor, which is the speed relative to the plan, from 0 to 1
        """
        return math.ceil(factor) if self.segment.is_rest else factor


@dataclass(frozen=True)
class ProfiledPath(TimedPath):
    """
    A path segment that is driven from rest to rest along a velocity profile.

    :param profile: the velocity along the segment over time
    """

    profile: VelocityProfile | Replanned

    @property
    def duration(self) -> float:
        """Return the planned duration of the path segment [s]."""
        return self.profile.duration

    def ticks(self, rate: float) -> int:
        """
        Return the number of ticks, the equal time parts into which the duration is divided.

        In each tick, one velocity is sent.  A tick is at most 1 / ``rate`` long.

        :param rate: the rate at which velocities are sent [Hz]
        """
        if not self.duration:
            return 0
        return max(1, math.ceil(self.duration * rate * (1.0 - TIME_TOLERANCE)))

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return the velocities to send, one for each of the equal time parts of the path segment.

        Each is the mean of the planned velocity in its time part.

        :param rate: the rate at which velocities are sent [Hz]
        """
        if not self.duration:
            return []
        top, means = self.max_rate, self.profile.means(self.ticks(rate))
        # All parts of a cruise share one Velocity object.
        cruising = self.segment.velocity(top)
        return [cruising if mean >= top else self.segment.velocity(mean) for mean in means]

    def state_at(self, time: float) -> PathState:
        """
        Return the planned position, velocity and acceleration along the path segment at a time.

        :param time: the time since the start of the segment [s]
        """
        return self.profile.state_at(time)

    def time_at(self, position: float) -> float:
        """
        Return the planned time at which a position is reached [s], found by bisection.

        :param position: the position along the path segment [m or rad]
        :returns: the time since the start of the segment [s]
        """
        return bisection(
            0.0, self.duration, lambda time: self.profile.state_at(time).position >= position,
            TIME_BISECTIONS)[1]

    def first_state(self, factor: float, velocity: float) -> PathState:  # noqa: ARG002
        """
        Return the position and the velocity at the start of the segment, which are both 0.

        :param factor: not used
        :param velocity: not used
        """
        return PathState(0.0)

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """
        Plan the rest of the path segment again for a new speed factor.

        The robot is at rest at the end of the new plan.

        :param state: the current position, velocity and acceleration along the segment
        :param factor: the speed factor, from 0 to 1.  The largest velocity along the segment is
            multiplied by it; the limits of acceleration and jerk stay the same.  0 means a stop as
            soon as possible
        """
        return replan_to_rest(state, self.segment.distance, factor * self.max_rate, self.limits)

    @property
    def max_rate(self) -> float:
        """Return the largest planned velocity along the path segment [m/s or rad/s]."""
        return self.profile.velocity
