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
"""What odometry makes of where the robot is."""

from __future__ import annotations

import random

from kachaka_simple_control.motion.kinematics import Pose
from kachaka_simple_control.robot.fidelity import Fidelity

#: Odometry is as new as this [s]: the official bridge asks for it every 20 ms.
ODOMETRY_PERIOD = 0.02


class Odometer:
    """Adds noise to a pose; of the time alone, so that asking more often changes nothing."""

    def __init__(self, fidelity: Fidelity, start: float, seed: int) -> None:
        """
        Begin.

        :param fidelity: how much noise
        :param start: the time now [s]
        :param seed: of the noise
        """
        self._fidelity = fidelity
        self._start = start
        self._seed = seed

    def read(self, pose: Pose, now: float) -> Pose:
        """
        Return where the robot thinks it is.

        :param pose: where it truly is
        :param now: the time [s]
        :returns: the pose with noise
        """
        fidelity = self._fidelity
        if fidelity.odometry_noise == 0.0 and fidelity.heading_noise == 0.0:
            return pose
        reading = int((now - self._start) / ODOMETRY_PERIOD)
        noise = random.Random(f'{self._seed} {reading}')
        return Pose(
            pose.x + noise.gauss(0.0, fidelity.odometry_noise),
            pose.y + noise.gauss(0.0, fidelity.odometry_noise),
            pose.theta + noise.gauss(0.0, fidelity.heading_noise))
