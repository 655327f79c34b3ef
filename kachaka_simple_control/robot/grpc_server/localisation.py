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
"""Where the robot believes to be on its map."""

from __future__ import annotations

import math

from kachaka_simple_control.motion.kinematics import ORIGIN, Pose


class Localisation:
    """
    The place of odometry on the map: the same, until somebody corrects it.

    :param offset: where odometry begins on the map
    """

    def __init__(self) -> None:
        """Let map and odometry be the same."""
        self.offset = ORIGIN

    def to_map(self, pose: Pose) -> Pose:
        """
        Return where something is on the map.

        :param pose: where it is in odometry
        :returns: the same pose on the map
        """
        return _after(self.offset, pose)

    def to_odometry(self, pose: Pose) -> Pose:
        """
        Return where something is in odometry.

        :param pose: where it is on the map
        :returns: the same pose in odometry
        """
        return _after(_inverse(self.offset), pose)

    def correct(self, believed: Pose, pose: Pose) -> None:
        """
        Let the robot believe that it is somewhere.

        :param believed: where, on the map
        :param pose: where it is in odometry
        """
        self.offset = _after(believed, _inverse(pose))


def _after(first: Pose, second: Pose) -> Pose:
    """Return the second pose, seen from where the first one is seen from."""
    cosine, sine = math.cos(first.theta), math.sin(first.theta)
    return Pose(
        first.x + cosine * second.x - sine * second.y,
        first.y + sine * second.x + cosine * second.y,
        first.theta + second.theta)


def _inverse(pose: Pose) -> Pose:
    cosine, sine = math.cos(pose.theta), math.sin(pose.theta)
    return Pose(
        -cosine * pose.x - sine * pose.y, sine * pose.x - cosine * pose.y, -pose.theta)
