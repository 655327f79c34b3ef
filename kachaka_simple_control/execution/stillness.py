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
"""Whether the robot stands still, as far as odometry tells; pure, told the time."""

from __future__ import annotations

from kachaka_simple_control.motion.kinematics import Velocity

#: Slower than this is still [m/s], [rad/s]: chosen, above the noise of wheel encoders.
STILL_LINEAR = 0.01
STILL_ANGULAR = 0.02
#: Odometry older than this says nothing of now [s]: chosen, ten of its samples and more.
FRESH = 0.3


class Stillness:
    """What odometry last said of the robot's velocity."""

    def __init__(self) -> None:
        """Have heard nothing yet."""
        self._heard: float | None = None
        self._still_since: float | None = None

    def hear(self, now: float, velocity: Velocity) -> None:
        """
        Take note of a velocity.

        :param now: when it arrived [s]
        :param velocity: the velocity that odometry tells
        """
        self._heard = now
        if abs(velocity.linear_x) > STILL_LINEAR or abs(velocity.angular_z) > STILL_ANGULAR:
            self._still_since = None
        elif self._still_since is None:
            self._still_since = now

    def silence(self, now: float) -> float | None:
        """
        Return for how long odometry has said nothing.

        :param now: the time [s]
        :returns: the time since it was last heard [s]; None if it never was
        """
        return None if self._heard is None else now - self._heard

    def moves(self, now: float) -> bool:
        """
        Tell whether the robot is seen to move.

        :param now: the time [s]
        :returns: true only if odometry is fresh and says so
        """
        silence = self.silence(now)
        return silence is not None and silence <= FRESH and self._still_since is None

    def still_since(self, now: float) -> float | None:
        """
        Return since when the robot is seen to stand still.

        :param now: the time [s]
        :returns: when the first sample said so that no moving one followed [s]; None if it moves
            or nobody can tell
        """
        silence = self.silence(now)
        return self._still_since if silence is not None and silence <= FRESH else None
