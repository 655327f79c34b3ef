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
Chains of arcs: the curved part of a flow, which is driven without a stop.

Tested by test/motion/test_transition.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import (
    compose,
    integrate,
    ORIGIN,
    Pose,
    Velocity,
    ZERO,
)
from kachaka_simple_control.motion.roots import bisection
from kachaka_simple_control.motion.trajectory import Piece, TimedVelocity, Trajectory
from kachaka_simple_control.motion.velocity_profile import PathState

#: An arc of a chain lasts at most this fraction of the period of the plan.  At a lower speed it
#: lasts longer: down to this factor it is still one message, and below it is two or more.  So no
#: message that borders on a change of curvature becomes so short that the change would exceed a
#: limit of acceleration.
ARC_SHARE = math.sqrt(0.5)
#: How often the range of possible speeds is halved to find the next speed.
SPEED_BISECTIONS = 20
#: A limit may be exceeded by this fraction, because of rounding.
ROUNDING = 1e-9


class Axis(NamedTuple):
    """The limits of acceleration of one axis: linear [m/s^2] or angular [rad/s^2]."""

    acceleration: float
    deceleration: float

    def allows(self, before: float, after: float, time: float) -> bool:
        """
        Return whether a velocity may change to another one.

        :param before: the velocity before [m/s or rad/s]
        :param after: the velocity after [m/s or rad/s]
        """
        if before * after < 0.0:
            limit = min(self.acceleration, self.deceleration)
        else:
            limit = self.acceleration if abs(after) > abs(before) else self.deceleration
        return abs(after - before) <= limit * time * (1.0 + ROUNDING)


@dataclass(frozen=True)
class ChainPath(Trajectory):
    """
    A path of short arcs, each with its own curvature, which is one message long as planned.

    It is defined by what is sent, so its end is exact at every rate.  A position is the planned
    time since the start [s], a velocity 1 as planned and lower at a lower speed factor: each arc
    takes longer, the path stays the same.

    :param tick: the planned duration of each arc [s]
    :param speed: the linear velocity at both ends [m/s], not negative
    """

    sent: tuple[Velocity, ...]
    tick: float
    speed: float
    linear: Axis
    angular: Axis

    @property
    def is_rest(self) -> bool:
        """Return False: the robot moves."""
        return False

    @property
    def duration(self) -> float:
        """Return the planned duration [s], which is also the length in its own unit [s]."""
        return self.tick * len(self.sent)

    @property
    def extent(self) -> float:
        """Return the position of the end [s]."""
        return self.duration

    @cached_property
    def length(self) -> float:
        """Return the driven length [m], negative backwards."""
        return math.fsum(velocity.linear_x for velocity in self.sent) * self.tick

    @cached_property
    def angle(self) -> float:
        """Return the heading change [rad], positive to the left."""
        return math.fsum(velocity.angular_z for velocity in self.sent) * self.tick

    @cached_property
    def _displacement(self) -> Pose:
        pose = ORIGIN
        for velocity in self.sent:
            pose = integrate(pose, velocity, self.tick)
        return pose

    def advance(self, pose: Pose) -> Pose:
        """Return the pose at the end of the path, for the pose at its start."""
        return compose(pose, self._displacement)

    def ticks(self, rate: float) -> int:  # noqa: ARG002
        """Return the number of velocities: one for each arc."""
        return len(self.sent)

    def velocities(self, rate: float) -> list[Velocity]:  # noqa: ARG002
        """Return the velocity of each arc as planned."""
        return list(self.sent)

    def state_at(self, time: float) -> PathState:
        """Return the state at a time since the start [s]; this time is also the position."""
        return PathState(time, 1.0)

    def time_at(self, position: float) -> float:
        """Return the planned time at a position [s]; it is equal to the position [s]."""
        return position

    @property
    def planned_start(self) -> PathState:
        """Return the planned state at the start."""
        return PathState(0.0, 1.0)

    def first_state(self, factor: float, velocity: float) -> PathState:  # noqa: ARG002
        """
        Return the state at the start.

        :param velocity: the linear velocity at the end of the previous trajectory [m/s]
        """
        return PathState(0.0, velocity / self.speed)

    def exit_velocity(self, state: PathState) -> float:
        """Return the linear velocity at the end [m/s], for the state there."""
        return state.velocity * self.speed

    def pieces(
            self, state: PathState, factor: float, period: float,
            before: TimedVelocity) -> Iterator[Piece]:
        """
        Yield the messages from a state to the end of the path, or to a stop before its end.

        Each lies within one arc, as near to the speed factor as the limits of acceleration allow.
        The previous speed is always allowed: the plan keeps the limits, and a lower speed needs
        less.

        :param period: the longest duration of a message [s]
        """
        index = min(int(state.position / self.tick + ROUNDING), len(self.sent) - 1)
        left = index + 1.0 - state.position / self.tick
        speed, time, here = state.velocity, 0.0, state
        while index < len(self.sent):
            if not factor and self.may_follow(before, TimedVelocity(ZERO, period)):
                yield Piece(time, time, ZERO, here, here._replace(velocity=0.0))
                return
            chosen = _Next(self, index, left, period, before)
            speed = chosen.speed_towards(factor, speed)
            message, part = chosen.message(speed)
            left -= part
            if left <= ROUNDING:
                index, left = index + 1, 1.0
            reached = PathState((index + 1.0 - left) * self.tick, speed)
            yield Piece(time, time + message.duration, message.velocity, here, reached)
            time, here, before = time + message.duration, reached, message

    def may_follow(self, before: TimedVelocity, after: TimedVelocity) -> bool:
        """Return whether a velocity may follow another one within the limits of acceleration."""
        time = (before.duration + after.duration) / 2.0
        one, two = before.velocity, after.velocity
        return (self.linear.allows(one.linear_x, two.linear_x, time)
                and self.angular.allows(one.angular_z, two.angular_z, time))


class _Next(NamedTuple):
    """The choice of the next message within an arc of a chain."""

    path: ChainPath
    arc: int
    left: float
    period: float
    before: TimedVelocity

    def message(self, speed: float) -> tuple[TimedVelocity, float]:
        """Return the message for a speed [s/s], and the part of the arc that it covers."""
        whole = self.left * self.path.tick / speed
        count = max(1, math.ceil(whole / self.period * (1.0 - ROUNDING)))
        planned = self.path.sent[self.arc]
        velocity = Velocity(planned.linear_x * speed, planned.angular_z * speed)
        return TimedVelocity(velocity, whole / count), self.left / count

    def is_allowed(self, speed: float) -> bool:
        """Return whether a speed [s/s] keeps the limits now, and can be kept from now on."""
        message, part = self.message(speed)
        # The change to the next arc needs a message of at least this duration; see formula (25) of
        # docs/theory.md.
        return part >= speed * speed * (1.0 - ROUNDING) and self.path.may_follow(
            self.before, message)

    def speed_towards(self, factor: float, speed: float) -> float:
        """Return the allowed speed [s/s] that is nearest to the factor, from the last speed on."""
        if factor and self.is_allowed(factor):
            return factor
        if factor > speed:
            return bisection(
                speed, factor, lambda one: not self.is_allowed(one), SPEED_BISECTIONS)[0] or (
                    factor * 0.5 ** SPEED_BISECTIONS)
        return bisection(factor, speed, self.is_allowed, SPEED_BISECTIONS)[1]
