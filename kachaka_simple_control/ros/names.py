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
"""The names under which a robot is found."""

from __future__ import annotations

from dataclasses import dataclass

from kachaka_simple_control.robot.robot_profile import RobotProfile


@dataclass(frozen=True)
class RobotNames:
    """
    Absolute names of one robot, before remapping.

    :param velocity: the topic it takes velocities on
    :param odometry: the topic it tells its odometry on; None if it tells none
    :param manual_control: the service that switches manual control; None if it needs none
    """

    velocity: str
    odometry: str | None
    manual_control: str | None


def names_of(profile: RobotProfile, namespace: str, manual_control: bool) -> RobotNames:
    """
    Put a robot's names together.

    :param profile: the kind of robot
    :param namespace: the ROS namespace of this one
    :param manual_control: whether to use its manual control, if it has one
    :returns: its names
    """
    def absolute(name: str | None) -> str | None:
        return f'/{namespace.strip("/")}/{name}'.replace('//', '/') if name else None

    velocity = absolute(profile.velocity_topic)
    assert velocity is not None
    return RobotNames(
        velocity=velocity,
        odometry=absolute(profile.odometry_topic),
        manual_control=absolute(profile.manual_control_service) if manual_control else None)
