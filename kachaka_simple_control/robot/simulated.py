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
"""A Kachaka in memory, with the behaviour that its maker documents."""

from __future__ import annotations

from enum import Enum
import math
import random

from kachaka_simple_control.motion.kinematics import Pose, Velocity, ZERO
from kachaka_simple_control.robot.drive import Drive
from kachaka_simple_control.robot.fidelity import Fidelity, IDEAL
from kachaka_simple_control.robot.robot_profile import KACHAKA, RobotProfile

SUCCESS = 0
#: The robot's own code (error_code.hpp in pf-robotics/kachaka-api).
ERROR_NO_MANUAL_CONTROL = 13151
#: Ours, chosen: what the robot answers to a velocity that is no number is not published.
ERROR_NOT_A_VELOCITY = -1

#: Odometry is as new as this [s]: the official bridge asks for it every 20 ms.
ODOMETRY_PERIOD = 0.02


class _Phase(Enum):
    """What goes on for a time and then ends by itself."""

    #: manual control is on
    MANUAL_CONTROL = 'manual control'
    #: the last velocity holds
    HOLD = 'hold'
    #: the robot drives off its dock, whatever it is told
    UNDOCKING = 'undocking'


class SimulatedKachaka:
    """
    The robot as its gRPC service shows it; told the time by each call, never asking for it.

    Times are of a steady clock [s], and should not run backwards: one that is earlier than one
    before it counts as that one.  Not for two threads at once.
    """

    def __init__(
            self,
            start: float = 0.0,
            fidelity: Fidelity = IDEAL,
            docked: bool = False,
            seed: int = 0,
            profile: RobotProfile = KACHAKA) -> None:
        """
        Stand still at the origin of odometry, with manual control off.

        :param start: the time now [s]
        :param fidelity: what keeps the robot from doing as it is told
        :param docked: whether it stands on its charging dock
        :param seed: of all noise: the same calls at the same times give the same answers
        :param profile: its limits, its hold and how long manual control lasts
        """
        self._profile = profile
        self._fidelity = fidelity
        self._drive = Drive(fidelity, start, seed)
        self._start = start
        self._seed = seed
        self._now = start
        self._is_docked = docked
        self._until: dict[_Phase, float] = {}

    def set_manual_control(self, enabled: bool, now: float) -> int:
        """
        Let the robot take velocities for a time from now on, or stop it and let it take none.

        On the dock, enabling makes the robot drive off first.

        :param enabled: whether velocities are taken from now on
        :param now: the time [s]
        :returns: 0
        """
        now = self._pass(now)
        if enabled:
            self._until[_Phase.MANUAL_CONTROL] = now + self._profile.manual_control_timeout
            self._leave_dock(now)
        elif _Phase.MANUAL_CONTROL in self._until:
            self._end(_Phase.MANUAL_CONTROL, now)
        return SUCCESS

    def set_robot_velocity(self, linear: float, angular: float, now: float) -> int:
        """
        Drive with a velocity until the next one, or for the hold.

        Both parts go from -1 to 1.  What the robot does with more is not published; this one
        takes the most that it can do (chosen).  While it drives off its dock it takes nothing,
        without an error (chosen).

        :param linear: forward velocity, as a part of the largest
        :param angular: turning velocity, as a part of the largest
        :param now: the time [s]
        :returns: 0, or the code of the error; with an error nothing changes
        """
        now = self._pass(now)
        if not (math.isfinite(linear) and math.isfinite(angular)):
            return ERROR_NOT_A_VELOCITY
        if _Phase.MANUAL_CONTROL not in self._until:
            return ERROR_NO_MANUAL_CONTROL
        if _Phase.UNDOCKING not in self._until:
            self._until[_Phase.HOLD] = now + self._profile.hold
            self._drive.aim(self._demanded(linear, angular), now)
        return SUCCESS

    def manual_control(self, now: float) -> bool:
        """
        Return whether the robot takes velocities.

        :param now: the time [s]
        :returns: whether manual control is on
        """
        self._pass(now)
        return _Phase.MANUAL_CONTROL in self._until

    def is_docked(self, now: float) -> bool:
        """
        Return whether the robot stands on its charging dock.

        :param now: the time [s]
        :returns: whether it does; not any more once it drives off
        """
        self._pass(now)
        return self._is_docked

    def next_change(self, now: float) -> float:
        """
        Return when the robot changes next if nobody tells it anything.

        :param now: the time [s]
        :returns: the time [s]; infinite if nothing is under way
        """
        self._pass(now)
        return min(self._until.values(), default=math.inf)

    def state(self, now: float) -> tuple[Pose, Velocity]:
        """
        Return where the robot truly is, in the frame of its start, and how fast.

        :param now: the time [s]
        :returns: pose and velocity
        """
        return self._drive.at(self._pass(now))

    def odometry(self, now: float) -> tuple[Pose, Velocity]:
        """
        Return where the robot thinks it is, and how fast.

        :param now: the time [s]
        :returns: pose and velocity; the true ones but for the noise of odometry
        """
        pose, velocity = self.state(now)
        fidelity = self._fidelity
        if fidelity.odometry_noise > 0.0 or fidelity.heading_noise > 0.0:
            noise = self._odometry_noise()
            pose = Pose(
                pose.x + noise.gauss(0.0, fidelity.odometry_noise),
                pose.y + noise.gauss(0.0, fidelity.odometry_noise),
                pose.theta + noise.gauss(0.0, fidelity.heading_noise))
        return pose, velocity

    def _pass(self, now: float) -> float:
        """Let time pass; what ends meanwhile ends at its own time, in order."""
        self._now = max(self._now, now)
        while self._until:
            phase, end = min(self._until.items(), key=lambda item: item[1])
            if end > self._now:
                break
            self._end(phase, end)
        return self._now

    def _end(self, phase: _Phase, now: float) -> None:
        # Whatever ends, the robot stops; but the way off the dock is driven to its end (chosen).
        del self._until[phase]
        if _Phase.UNDOCKING not in self._until:
            self._drive.aim(ZERO, now)

    def _leave_dock(self, now: float) -> None:
        if self._is_docked:
            self._is_docked = False
            velocity = self._fidelity.undock_velocity
            self._until[_Phase.UNDOCKING] = now + self._fidelity.undock_distance / velocity
            self._drive.aim(Velocity(linear_x=velocity), now)

    def _demanded(self, linear: float, angular: float) -> Velocity:
        limits = self._profile.limits
        return Velocity(
            max(-1.0, min(linear, 1.0)) * limits.max_linear_velocity,
            max(-1.0, min(angular, 1.0)) * limits.max_angular_velocity)

    def _odometry_noise(self) -> random.Random:
        # Of the time alone, so that asking more often does not change what is answered.
        reading = int((self._now - self._start) / ODOMETRY_PERIOD)
        return random.Random(f'{self._seed} {reading}')
