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
"""Path segments of constant curvature, and the trajectories by which they are driven."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.replanning import (
    PathLimits,
    PathState,
    replan_through,
    replan_to_rest,
    Replanned,
)
from kachaka_simple_control.motion.velocity_profile import VelocityProfile

#: A last tick shorter than this part of a period is rounding, not a tick.
TIME_TOLERANCE = 1e-9
#: How often the time that belongs to a position is bisected: to a microsecond within a day.
TIME_BISECTIONS = 40


class PathSegment(NamedTuple):
    """
    A path with a constant curvature, in its own unit u.

    The unit is the metre, the radian for a turn in place, and the second where the velocity is
    given: the rates are then velocities.

    :param distance: its length [u], not negative
    :param linear: metres forward for each u, negative backwards
    :param angular: radians to the left for each u
    """

    distance: float
    linear: float
    angular: float

    @property
    def is_rest(self) -> bool:
        """Return whether the robot stands still throughout."""
        return not (self.linear or self.angular)

    @property
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""
        return self.linear * self.distance

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""
        return self.angular * self.distance


def limits_along(segment: PathSegment, limits: Limits) -> PathLimits:
    """
    Return the limits along a segment: the tighter of the linear and the angular ones.

    :param segment: the segment
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
    # A velocity that rounding took beyond the limit would be refused in mid-motion.
    return along if along * rate <= limit else math.nextafter(along, 0.0)


@dataclass(frozen=True)
class Trajectory(ABC):
    """
    A path segment and the time it takes.

    :param segment: the segment
    :param limits: along the segment
    """

    segment: PathSegment
    limits: PathLimits

    @property
    @abstractmethod
    def duration(self) -> float:
        """Return how long it takes [s]."""

    @abstractmethod
    def ticks(self, rate: float) -> int:
        """
        Return in how many parts of equal length it is sent, each with its own velocity.

        :param rate: how often a velocity is sent [Hz]
        :returns: the number of parts; 0 if it takes no time
        """

    @abstractmethod
    def velocities(self, rate: float) -> list[Velocity]:
        """
        Return the velocity to send in each part.

        :param rate: how often a velocity is sent [Hz]
        """

    @abstractmethod
    def state_at(self, time: float) -> PathState:
        """
        Return the state as planned.

        :param time: since it began [s]
        """

    @abstractmethod
    def time_at(self, position: float) -> float:
        """
        Return when it is planned to be somewhere [s]: the inverse of ``state_at``.

        :param position: the distance from the start of the segment [u]
        """

    @abstractmethod
    def first_state(self, factor: float, velocity: float) -> PathState:
        """
        Return the state in which it begins under a speed factor.

        :param factor: the speed factor, from 0 to 1
        :param velocity: of the trajectory before at its end, in its own unit [u/s]; 0 at rest
        """

    @abstractmethod
    def replanned(self, state: PathState, factor: float) -> Replanned:
        """
        Return how the rest is driven under another speed factor.

        :param state: the state now
        :param factor: the speed factor, from 0 to 1; 0: come to rest, or pass the end on the way
        """

    @property
    @abstractmethod
    def max_rate(self) -> float:
        """Return the largest velocity along the segment [u/s]."""

    def mean_velocity(self, distance: float, duration: float) -> Velocity:
        """
        Return the velocity that takes a distance along the segment in a time.

        :param distance: the distance [u]
        :param duration: the time [s]
        """
        # Rounding must not carry it beyond the limit, or backwards.
        rate = min(max(0.0, distance / duration), self.max_rate)
        return Velocity(self.segment.linear * rate, self.segment.angular * rate)


class ConstantVelocity(Trajectory):
    """A segment in seconds: one velocity, which a plan runner repeats at the rate."""

    @property
    def duration(self) -> float:
        """Return how long the velocity is held [s]."""
        return self.segment.distance

    def ticks(self, rate: float) -> int:  # noqa: ARG002
        """Return 1, or 0 if it takes no time."""
        return 1 if self.duration else 0

    def velocities(self, rate: float) -> list[Velocity]:
        """Return the velocity, once."""
        return [Velocity(self.segment.linear, self.segment.angular)] * self.ticks(rate)

    def state_at(self, time: float) -> PathState:
        """Return the time itself, which passes at one second a second."""
        return PathState(time, 1.0)

    def time_at(self, position: float) -> float:
        """Return the position, which is a time."""
        return position

    def first_state(self, factor: float, velocity: float) -> PathState:
        """Return the rate of the movement before; from rest the factor, as the plan jumps too."""
        return PathState(0.0, velocity or self._rate(factor))

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """Return how time passes: at the factor, with a ramp to it."""
        return replan_through(state, self.duration, self._rate(factor), self.limits)

    @property
    def max_rate(self) -> float:
        """Return one second a second."""
        return 1.0

    def _rate(self, factor: float) -> float:
        """Return how fast plan time passes: the factor; in a rest 1, or 0 while held."""
        return math.ceil(factor) if self.segment.is_rest else factor


@dataclass(frozen=True)
class ProfiledPath(Trajectory):
    """
    A segment driven from rest to rest along a velocity profile.

    :param profile: the profile over the segment's distance
    """

    profile: VelocityProfile

    @property
    def duration(self) -> float:
        """Return how long the profile takes [s]."""
        return self.profile.duration

    def ticks(self, rate: float) -> int:
        """Return the number of parts, none longer than a period."""
        if not self.duration:
            return 0
        return max(1, math.ceil(self.duration * rate * (1.0 - TIME_TOLERANCE)))

    def velocities(self, rate: float) -> list[Velocity]:
        """Return the mean of the profile over each part."""
        count = self.ticks(rate)
        if not count:
            return []
        linear, angular, top = self.segment.linear, self.segment.angular, self.profile.velocity
        # A cruise is one velocity many times over, and one object.
        cruising = Velocity(linear * top, angular * top)
        return [
            cruising if mean == top else Velocity(linear * mean, angular * mean)
            for mean in self.profile.means(count)]

    def state_at(self, time: float) -> PathState:
        """Return the state of the profile."""
        return PathState(
            self.profile.position_at(time), self.profile.velocity_at(time),
            self.profile.acceleration_at(time))

    def time_at(self, position: float) -> float:
        """Return the time, by bisection: the profile never goes back."""
        low, high = 0.0, self.duration
        for _ in range(TIME_BISECTIONS):
            middle = (low + high) / 2.0
            if self.profile.position_at(middle) < position:
                low = middle
            else:
                high = middle
        return high

    def first_state(self, factor: float, velocity: float) -> PathState:  # noqa: ARG002
        """Return rest at its start."""
        return PathState(0.0)

    def replanned(self, state: PathState, factor: float) -> Replanned:
        """Return how the rest is driven: the factor caps the velocity, accelerations stay."""
        return replan_to_rest(
            state, self.segment.distance, factor * self.profile.velocity, self.limits)

    @property
    def max_rate(self) -> float:
        """Return the largest velocity of the profile [u/s]."""
        return self.profile.velocity
