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
from kachaka_simple_control.motion.velocity_profile import VelocityProfile

#: A last tick shorter than this part of a period is rounding, not a tick.
TIME_TOLERANCE = 1e-9


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
    def length(self) -> float:
        """Return how far it goes [m], negative backwards."""
        return self.linear * self.distance

    @property
    def angle(self) -> float:
        """Return how far it turns [rad], positive to the left."""
        return self.angular * self.distance


class PathLimits(NamedTuple):
    """
    The limits along a path segment; each is positive or infinite.

    :param velocity: largest velocity [u/s]
    :param acceleration: largest acceleration [u/s^2]
    :param deceleration: largest deceleration [u/s^2]
    :param jerk: largest jerk [u/s^3]
    """

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float


def limits_along(segment: PathSegment, limits: Limits) -> PathLimits:
    """
    Return the limits along a segment: the tighter of the linear and the angular ones.

    :param segment: the segment, with one metre or one radian to the unit
    :returns: the limits in the segment's unit, (13) in docs/theory.md
    """
    forward = limits.backward_velocity if segment.linear < 0.0 else limits.max_linear_velocity
    return PathLimits(
        _tighter(segment, forward, limits.max_angular_velocity),
        _tighter(segment, limits.max_linear_acceleration, limits.max_angular_acceleration),
        _tighter(segment, limits.linear_deceleration, limits.angular_deceleration),
        _tighter(segment, limits.max_linear_jerk, limits.max_angular_jerk))


def _tighter(segment: PathSegment, linear: float, angular: float) -> float:
    if not segment.linear:
        return angular
    if not segment.angular:
        return linear
    bend = abs(segment.angular)
    limit = angular / bend
    # A velocity that rounding took beyond the limit would be refused in mid-motion.
    return min(linear, limit if limit * bend <= angular else math.nextafter(limit, 0.0))


@dataclass(frozen=True)
class Trajectory(ABC):
    """
    A path segment and the time it takes.

    :param segment: the segment
    """

    segment: PathSegment

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
