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
"""Detect from odometry whether the robot stands still, and whether a paused robot was moved."""

from __future__ import annotations

import math

from kachaka_simple_control.control.timing import (
    MAX_MOVED_ANGLE,
    MAX_MOVED_DISTANCE,
    ODOMETRY_MAX_AGE,
    REST_SETTLE_TIME,
    STANDSTILL_ANGULAR,
    STANDSTILL_LINEAR,
)
from kachaka_simple_control.errors import RobotMovedError
from kachaka_simple_control.motion.geometry import distance_between, Pose, Velocity


class StandstillDetector:
    """
    Detects from odometry whether the robot stands still.

    It does while its velocity is not above STANDSTILL_LINEAR and STANDSTILL_ANGULAR.  Odometry
    older than ODOMETRY_MAX_AGE shows neither standstill nor motion.
    """

    def __init__(self) -> None:
        self._received: float | None = None
        self._still_since: float | None = None

    def on_odometry(self, now: float, velocity: Velocity) -> None:
        """Process an odometry message."""
        self._received = now
        if (abs(velocity.linear_x) > STANDSTILL_LINEAR
                or abs(velocity.angular_z) > STANDSTILL_ANGULAR):
            self._still_since = None
        elif self._still_since is None:
            self._still_since = now

    def age(self, now: float) -> float | None:
        """Return how long ago the newest odometry arrived [s]; None if none has."""
        return None if self._received is None else now - self._received

    def is_moving(self, now: float) -> bool:
        """Return whether the newest odometry message is recent and shows that the robot moves."""
        return self._is_fresh(now) and self._still_since is None

    def still_since(self, now: float) -> float | None:
        """
        Return the time of the first message that showed standstill [s].

        :returns: None if the robot moves, or without recent odometry
        """
        return self._still_since if self._is_fresh(now) else None

    def is_still(self, now: float) -> bool | None:
        """Return whether odometry shows standstill; None without recent odometry."""
        return self._still_since is not None if self._is_fresh(now) else None

    def _is_fresh(self, now: float) -> bool:
        age = self.age(now)
        return age is not None and age <= ODOMETRY_MAX_AGE


class PausePose:
    """Measures how far somebody has moved the robot from where it came to rest in a pause."""

    def __init__(self) -> None:
        self._paused = False
        self._pose: Pose | None = None
        #: when the first odometry message of the pause arrived [s]; None before
        self._first: float | None = None
        #: the newest pose from odometry; None before the first
        self.newest: Pose | None = None

    def on_sent(self, is_paused: bool) -> None:
        """Record, after each velocity, whether it was zero because of a pause."""
        if is_paused != self._paused:
            self._paused, self._pose, self._first = is_paused, None, None

    def on_odometry(self, now: float, pose: Pose, still_since: float | None) -> None:
        """
        Process an odometry message; ``moved`` measures from the pose after REST_SETTLE_TIME.

        :param still_since: by the ``StandstillDetector``
        """
        self.newest = pose
        if not self._paused or self._pose is not None:
            return
        if (first := self._first) is None:
            first = self._first = now
        if still_since is not None and now - max(still_since, first) >= REST_SETTLE_TIME:
            self._pose = pose

    def accept(self) -> None:
        """Accept that the robot was moved: ``moved`` measures from its current pose now."""
        if self._pose is not None:
            self._pose = self.newest

    def moved(self) -> tuple[float, float]:
        """
        Return how far somebody has moved the robot in the pause: distance [m] and angle [rad].

        :returns: never negative; 0 and 0 if it is not paused, or its pose in the pause is unknown
        """
        if self._pose is None or self.newest is None:
            return 0.0, 0.0
        distance, angle = distance_between(self._pose, self.newest)
        return distance, abs(angle)

    def require_not_moved(self) -> None:
        """
        Check that nobody has moved the robot from the pose at which it was paused.

        :raises RobotMovedError: if it was moved more than MAX_MOVED_DISTANCE or MAX_MOVED_ANGLE
        """
        distance, angle = self.moved()
        if distance > MAX_MOVED_DISTANCE or angle > MAX_MOVED_ANGLE:
            raise RobotMovedError(
                f'the robot was moved by {distance * 100.0:.1f} cm and '
                f'{math.degrees(angle):.1f} deg while it was held, more than '
                f'{MAX_MOVED_DISTANCE * 100.0:g} cm or {math.degrees(MAX_MOVED_ANGLE):.0f} deg: '
                'the rest of the motion would end elsewhere')
