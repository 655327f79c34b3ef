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
"""Poses seen from other poses; pure."""

from __future__ import annotations

import math

from kachaka_simple_control.motion.kinematics import Pose


def composed(frame: Pose, pose: Pose) -> Pose:
    """
    Return a pose that is told as seen from another one.

    :param frame: the other one
    :param pose: the pose, seen from there
    :returns: the pose, seen from where the other one is seen from
    """
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    return Pose(
        frame.x + pose.x * cosine - pose.y * sine,
        frame.y + pose.x * sine + pose.y * cosine,
        frame.theta + pose.theta)


def seen_from(frame: Pose, pose: Pose) -> Pose:
    """
    Return a pose as seen from another one: what ``composed`` undoes.

    :param frame: the other one
    :param pose: the pose
    :returns: the pose, seen from there
    """
    cosine, sine = math.cos(frame.theta), math.sin(frame.theta)
    x, y = pose.x - frame.x, pose.y - frame.y
    return Pose(x * cosine + y * sine, y * cosine - x * sine, pose.theta - frame.theta)


def apart(one: Pose, two: Pose) -> tuple[float, float]:
    """
    Return how far two poses are apart.

    :param one: a pose
    :param two: another one
    :returns: the distance [m], and how far the second looks to the left of the first [rad],
        from -pi to pi
    """
    return (math.hypot(two.x - one.x, two.y - one.y),
            math.remainder(two.theta - one.theta, math.tau))
