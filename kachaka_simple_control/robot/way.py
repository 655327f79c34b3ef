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
"""How the robot drives a part of its errand: by looking where it is, again and again."""

from __future__ import annotations

import math

from kachaka_simple_control.motion.kinematics import Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.robot.fidelity import Fidelity
from kachaka_simple_control.robot.legs import Align, Face, Leg, Stay, Straight, Turn

#: How often the robot looks where it is while it drives by itself [s]; chosen.
LOOK_PERIOD = 0.02
#: It has arrived when it is as near as this [m, rad]; chosen.  A lag makes the last bit slow.
NEAR, NEAR_WITH_LAG = 1e-6, 1e-4
#: And as slow as this [m/s, rad/s], unless it can stop at once; chosen.
SLOW = 1e-3
#: It has not arrived if it is farther away than this [m, rad] when it gives up; chosen.
FAR = 1e-3
#: It gives up after so many times what the way takes at its speed, and so much more [s]; chosen.
TIMES, MORE = 3.0, 10.0


class Way:
    """A leg under way; it ends where it should, whatever gains and noise do."""

    def __init__(
            self, leg: Leg, start: Pose, now: float, limits: Limits, fidelity: Fidelity) -> None:
        """
        Begin a leg.

        :param leg: what to do
        :param start: where the robot is
        :param now: the time [s]
        :param limits: its largest velocities
        :param fidelity: how its drive is
        """
        self._start = start
        self._lag = fidelity.lag
        self._near, self._slow = (NEAR, math.inf) if fidelity.is_prompt else (NEAR_WITH_LAG, SLOW)
        self._is_turn = isinstance(leg, (Turn, Face, Align))
        asked = abs(leg.speed) if isinstance(leg, Straight) else 0.0
        if self._is_turn:
            self._speed = limits.max_angular_velocity
            self._acceleration = fidelity.angular_acceleration
        else:
            self._speed = min(asked or math.inf, limits.max_linear_velocity)
            self._acceleration = fidelity.linear_acceleration
        self._stays = isinstance(leg, Stay)
        self._length = 0.0 if isinstance(leg, Stay) else leg.length(start)
        #: When to give up, or to go on [s].
        self.end = now + (
            leg.duration if isinstance(leg, Stay)
            else TIMES * abs(self._length) / self._speed + MORE)

    def look(
            self, pose: Pose, velocity: Velocity, now: float) -> tuple[Velocity, float] | bool:
        """
        Look where the robot is.

        :param pose: where it is
        :param velocity: how fast it is
        :param now: the time [s]
        :returns: the velocity, and when to look again [s]; or, at the end, whether it is there
        """
        if self._stays:
            return now >= self.end or (ZERO, self.end)
        rest = self._rest(pose)
        speed = velocity.angular_z if self._is_turn else velocity.linear_x
        # Whoever drives past the place is not there.
        if abs(rest) <= self._near and abs(speed) <= self._slow:
            return True
        if now >= self.end:
            return abs(rest) <= FAR
        wanted = self._speed_for(rest)
        return (
            Velocity(angular_z=wanted) if self._is_turn else Velocity(linear_x=wanted),
            now + LOOK_PERIOD)

    def _rest(self, pose: Pose) -> float:
        if self._is_turn:
            return self._length - (pose.theta - self._start.theta)
        heading = self._start.theta
        return self._length - (
            (pose.x - self._start.x) * math.cos(heading)
            + (pose.y - self._start.y) * math.sin(heading))

    def _speed_for(self, rest: float) -> float:
        # Without a lag: the rest within one look.  With one, a loop of gain 1 / (4 lag) is
        # critically damped: as fast as it can be without going too far.
        duration = LOOK_PERIOD + 4.0 * self._lag
        most = self._speed
        if math.isfinite(self._acceleration):
            duration += 3.0 * LOOK_PERIOD
            # Braking with half of what it can leaves room for its gains and its lag.
            most = min(most, math.sqrt(self._acceleration * abs(rest)))
        return max(-most, min(rest / duration, most))
