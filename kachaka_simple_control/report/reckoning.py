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
"""Where a robot gets to that does exactly as it is told; pure."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
import math

from kachaka_simple_control.motion.kinematics import integrate, ORIGIN, Pose, Velocity
from kachaka_simple_control.report.events import Sent


class Reckoning:
    """
    The way of a robot that keeps each velocity until the next, but not longer than its hold.

    It stands at the origin when the first message comes.
    """

    def __init__(self, messages: Sequence[Sent], hold: float) -> None:
        """
        Work it out.

        :param messages: what the robot is told, in order
        :param hold: how long it keeps a velocity without a new one [s]
        """
        #: when its velocity may have changed [s], and where it was
        self.times: list[float] = []
        self.poses: list[Pose] = []
        self._velocities: list[Velocity] = []
        self._hold = hold
        for sent in messages:
            if not self.times or sent.time >= self.times[-1]:
                self._hear(sent)

    def _hear(self, sent: Sent) -> None:
        if not self.times:
            pose = ORIGIN
        elif self._velocities[-1].is_zero:
            if sent.velocity.is_zero:
                return
            pose = self.poses[-1]
        else:
            pose = self._after(len(self.times) - 1, sent.time)
        self.times.append(sent.time)
        self.poses.append(pose)
        self._velocities.append(sent.velocity)

    def at(self, time: float) -> Pose:
        """
        Return where the robot is.

        :param time: when [s]; before the first message it is at the origin
        :returns: its pose
        """
        last = len(self.times) - 1
        index = last if last >= 0 and time >= self.times[last] else (
            bisect_right(self.times, time) - 1)
        if index < 0:
            return ORIGIN
        return self._after(index, time)

    def _after(self, index: int, time: float) -> Pose:
        velocity = self._velocities[index]
        if velocity.is_zero:
            return self.poses[index]
        return integrate(
            self.poses[index], velocity, min(time - self.times[index], self._hold))

    @property
    def end(self) -> Pose:
        """
        Return where it stands in the end: at the latest a hold after the last message.

        Without a hold nobody knows; then it is where the last message reached it.
        """
        if not self.times:
            return ORIGIN
        return self.at(self.times[-1] + (self._hold if math.isfinite(self._hold) else 0.0))
