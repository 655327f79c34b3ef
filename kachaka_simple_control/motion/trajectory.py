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
"""Path segments of constant curvature, and the trajectories that drive them over time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.velocity_profile import (
    bisection,
    PathLimits,
    PathState,
    replan_through,
    replan_to_rest,
    Replanned,
    VelocityProfile,
)

#: A last tick shorter than this share of a period is left out (rounding).
TIME_TOLERANCE = 1e-9
#: The number of bisections to find the time for a position: to a microsecond in a day.
TIME_BISECTIONS = 40


class PathSegment(NamedTuple):
    """
    A path with a constant curvature; its length has the unit u.

    The unit u is the metre for straight lines and arcs, the radian for a turn in place, and the
    second for a step with given velocities.  In seconds, ``linear`` and ``angular`` are
    velocities.

    :param distance: the length [u], not negative
    :param linear: metres forward for each u, negative backwards
    :param angular: radians to the left for each u
    """

    distance: float
    linear: float
    angular: float

    @property
    def is_rest(self) -> bool:
        """Return whether the robot stands still during the whole segment."""
        return not (self.linear or self.angular)

    @property
    def length(self) -> float:
        """Return the driven length [m], negative backwards."""
        return self.linear * self.distance

    @property
    def angle(self) -> float:
        """Return the heading change [rad], positive to the left."""
        return self.angular * self.distance

    def velocity(self, rate: float) -> Velocity:
        """Return the velocity of the robot for a velocity along the segment [u/s]."""
        return Velocity(self.linear * rate, self.angular * rate)


def limits_along(segment: PathSegment, limits: Limits) -> PathLimits:
    """
    Return the limits along a segment: for each, the stricter of the linear and angular limit.

    :param segment: the segment
    :param limits: the limits of the robot
    :returns: the limits in the segment's unit, (13) and (17) in docs/theory.md; infinite at rest
    """
    forward = limits.backward_velocity if segment.linear < 0.0 else limits.max_linear_velocity
    return PathLimits(
        _tighter(segment, forward, limits.max_angular_velocity),
        _tighter(segment, limits.max_linear_acceleration, limits.max_angular_acceleration),
        _tighter(segment, limits.linear_deceleration, limits.angular_deceleration),
        _tighter(segment, limits.max_linear_jerk, limits.max_angular_jerk))


def _tighter(segment: PathSegment, linear: float, angular: float) -> float:
    return min(_along(linear, abs(segment.linear)), _along(angular, abs(segment.angular)))


def _along(limit: float, rate: float) -> float:
    if not rate:
        return math.inf
    along = limit / rate
    # If rounding raised the velocity above the limit, the gate would refuse it in the motion.
    return along if along * rate <= limit else math.nextafter(along, 0.0)


@dataclass(frozen=True)
class _TimedPath(ABC):
    """
    A path segment with its timing: what both kinds of trajectories have in common.

    :param segment: the segment
    :param limits: the limits along the segment
    """

    segment: PathSegment
    limits: PathLimits

    @property
    @abstractmethod
    def max_rate(self) -> float:
        """Return the largest velocity along the segment [u/s]."""

    def mean_velocity(self, distance: float, duration: float) -> Velocity:
        """
        Return the mean velocity that covers a distance along the segment in a time.

        :param distance: the distance [u]
        :param duration: the time [s]
        """
        # Rounding must not raise the rate above the limit, or make it negative.
        return self.segment.velocity(min(max(0.0, distance / duration), self.max_rate))


class ConstantVelocity(_TimedPath):
    """A segment in seconds: one constant velocity, sent repeatedly at the plan's rate."""

    @property
    def duration(self) -> float:
        """Return how long the velocity is held [s]."""
        return self.segment.distance

    def ticks(self, rate: float) -> int:  # noqa: ARG002
        """Return 1, or 0 for a duration of zero."""
        return 1 if self.duration else 0

    def velocities(self, rate: float) -> list[Velocity]:
        """Return a list with the one velocity; empty for a duration of zero."""
        return [self.segment.velocity(self.max_rate)] * self.ticks(rate)

    def state_at(self, time: float) -> PathState:
        """Return the time as the position, with a rate of one second per second."""
        return PathState(time, self.max_rate)

    def time_at(self, position: float) -> float:
        """Return the position itself, because the position is a time."""
        return position

    def first_state(self, factor: float, velocity: float) -> PathState:
        """
        Return position 0 and the previous velocity; after a rest, the rate for the factor.

        :param factor: the speed factor, from 0 to 1
        :param velocity: the end velocity of the previous trajectory, in its unit [u/s]; 0 at rest
        """
        return PathState(0.0, velocity or self._rate(factor))

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """
        Return the re-planned remainder: the rate of plan time ramps to the speed factor.

        :param state: the current state
        :param factor: the speed factor, from 0 to 1; 0: stop as soon as possible, or pass the
            end if the remaining path is too short to stop
        """
        return replan_through(state, self.duration, self._rate(factor), self.limits)

    @property
    def max_rate(self) -> float:
        """Return the largest rate: one second per second."""
        return 1.0

    def _rate(self, factor: float) -> float:
        """Return the rate of plan time: the factor; in a rest 1, or 0 for a factor of 0."""
        return math.ceil(factor) if self.segment.is_rest else factor


@dataclass(frozen=True)
class ProfiledPath(_TimedPath):
    """
    A segment driven from rest to rest along a velocity profile.

    :param profile: the profile over the segment's distance
    """

    profile: VelocityProfile

    @property
    def duration(self) -> float:
        """Return the duration of the profile [s]."""
        return self.profile.duration

    def ticks(self, rate: float) -> int:
        """
        Return the number of equal time parts, each not longer than a period.

        :param rate: the rate at which velocities are sent [Hz]
        """
        if not self.duration:
            return 0
        return max(1, math.ceil(self.duration * rate * (1.0 - TIME_TOLERANCE)))

    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return the mean velocity of the profile in each time part.

        :param rate: the rate at which velocities are sent [Hz]
        """
        if not self.duration:
            return []
        top, means = self.max_rate, self.profile.means(self.ticks(rate))
        # All parts of a cruise share one Velocity object.
        cruising = self.segment.velocity(top)
        return [cruising if mean == top else self.segment.velocity(mean) for mean in means]

    def state_at(self, time: float) -> PathState:
        """Return the state of the profile at a time since its start [s]."""
        return self.profile.state_at(time)

    def time_at(self, position: float) -> float:
        """Return the time of a position [s] by bisection; the position never decreases."""
        return bisection(
            0.0, self.duration, lambda time: self.profile.state_at(time).position >= position,
            TIME_BISECTIONS)[1]

    def first_state(self, factor: float, velocity: float) -> PathState:  # noqa: ARG002
        """Return the start state: position 0, at rest."""
        return PathState(0.0)

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """Return the re-planned remainder: the factor scales the velocity limit only."""
        return replan_to_rest(state, self.segment.distance, factor * self.max_rate, self.limits)

    @property
    def max_rate(self) -> float:
        """Return the largest velocity of the profile [u/s]."""
        return self.profile.velocity


#: A path segment with its timing.
Trajectory = ConstantVelocity | ProfiledPath
