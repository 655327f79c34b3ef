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
"""Path segments of constant curvature, and trajectories: path segments with their timing."""

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

#: If a duration exceeds a whole number of periods by less than this fraction of the duration, the
#: excess comes from rounding and gets no tick of its own.
TIME_TOLERANCE = 1e-9
#: How often a duration is halved to find the time of a position.  A duration of a day is halved to
#: less than a microsecond.
TIME_BISECTIONS = 40


class PathSegment(NamedTuple):
    """
    A path with a constant curvature; its length has the unit u.

    The unit u is the metre for straight lines and arcs, the radian for a turn in place, and the
    second for a step with given velocities.  If u is the second, ``linear`` and ``angular`` are
    velocities.

    :param distance: the length [u], not negative
    :param linear: metres forwards for each u, negative backwards
    :param angular: radians to the left for each u, negative to the right
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
        """
        Return the velocity of the robot for a velocity along the segment.

        :param rate: the velocity along the segment [u/s]
        """
        return Velocity(self.linear * rate, self.angular * rate)


def limits_along(segment: PathSegment, limits: Limits) -> PathLimits:
    """
    Return the limits along a segment: each is the stricter of the linear and the angular limit.

    :param segment: the segment
    :param limits: the limits of the robot
    :returns: the limits in the unit of the segment; see formulas (13) and (17) of docs/theory.md.
        They are infinite if the robot stands still during the segment
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
    # If rounding raised a velocity above its limit, it would be refused during the motion.
    return along if along * rate <= limit else math.nextafter(along, 0.0)


@dataclass(frozen=True)
class TimedPath(ABC):
    """
    A path segment with its timing: the base class of both kinds of trajectories.

    :param segment: the segment
    :param limits: the limits along the segment
    """

    segment: PathSegment
    limits: PathLimits

    @property
    @abstractmethod
    def max_rate(self) -> float:
        """Return the largest velocity along the segment [m/s, rad/s or s/s]."""

    def mean_velocity(self, distance: float, duration: float) -> Velocity:
        """
        Return the constant velocity of the robot that covers a distance in a time.

        :param distance: the distance along the segment [m, rad or s]
        :param duration: the time [s]
        """
        # Rounding must not raise the rate above the limit, or make it negative.
        return self.segment.velocity(min(max(0.0, distance / duration), self.max_rate))


class ConstantVelocity(TimedPath):
    """
    A segment with one constant velocity, which is sent repeatedly at the rate of the plan.

    Its length is a time [s].  Its velocity [s/s] is 1 if the time of the plan passes as planned.
    It is smaller if the motion is slowed down.
    """

    @property
    def duration(self) -> float:
        """Return how long the velocity is sent if the motion is not slowed down [s]."""
        return self.segment.distance

    def ticks(self, rate: float) -> int:  # noqa: ARG002
        """Return the number of different velocities: 1, or 0 if the duration is 0."""
        return 1 if self.duration else 0

    def velocities(self, rate: float) -> list[Velocity]:
        """Return a list with the constant velocity; the list is empty if the duration is 0."""
        return [self.segment.velocity(self.max_rate)] * self.ticks(rate)

    def state_at(self, time: float) -> PathState:
        """Return the state at a time since the start [s]; this time is also the position."""
        return PathState(time, self.max_rate)

    def time_at(self, position: float) -> float:
        """Return the time at which a position is reached [s]; it is equal to the position [s]."""
        return position

    def first_state(self, factor: float, velocity: float) -> PathState:
        """
        Return the state at the start: the position 0, and the velocity along the segment [s/s].

        :param factor: the speed factor, from 0 to 1.  It gives the velocity if ``velocity`` is 0
        :param velocity: the velocity along the previous trajectory at its end, which is kept; 0
            if the robot stood still
        """
        return PathState(0.0, velocity or self._rate(factor))

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """
        Plan the rest of the segment again: change its velocity [s/s] to the speed factor.

        :param state: the current state
        :param factor: the speed factor, from 0 to 1.  0 means a stop; if the rest of the segment
            is too short to stop, the velocity at its end is not zero
        """
        return replan_through(state, self.duration, self._rate(factor), self.limits)

    @property
    def max_rate(self) -> float:
        """Return the largest velocity along the segment: 1 s/s, the velocity as planned."""
        return 1.0

    def _rate(self, factor: float) -> float:
        """
        Return the velocity along the segment for a speed factor [s/s].

        It is the factor.  If the robot stands still in the segment, it is 1 for each factor above
        0, so that a wait does not become longer.
        """
        return math.ceil(factor) if self.segment.is_rest else factor


@dataclass(frozen=True)
class ProfiledPath(TimedPath):
    """
    A segment driven from rest to rest along a velocity profile.

    :param profile: the velocity profile over the length of the segment
    """

    profile: VelocityProfile

    @property
    def duration(self) -> float:
        """Return the duration of the profile [s]."""
        return self.profile.duration

    def ticks(self, rate: float) -> int:
        """
        Return the number of equal time parts, each at most one period of the rate long.

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
        """Return the time at which a position is reached [s], found by bisection."""
        return bisection(
            0.0, self.duration, lambda time: self.profile.state_at(time).position >= position,
            TIME_BISECTIONS)[1]

    def first_state(self, factor: float, velocity: float) -> PathState:  # noqa: ARG002
        """Return the state at the start: the position 0, at rest."""
        return PathState(0.0)

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """
        Plan the rest of the segment again with another speed factor.

        The new plan ends at rest.

        :param state: the current state
        :param factor: the speed factor, from 0 to 1.  It multiplies the largest velocity of the
            profile, but no other limit.  0 means a stop as soon as possible
        """
        return replan_to_rest(state, self.segment.distance, factor * self.max_rate, self.limits)

    @property
    def max_rate(self) -> float:
        """Return the largest velocity of the profile [m/s or rad/s]."""
        return self.profile.velocity


#: Either kind of trajectory.
Trajectory = ConstantVelocity | ProfiledPath
