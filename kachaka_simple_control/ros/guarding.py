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
"""Start the guardian of a node."""

from __future__ import annotations

from kachaka_simple_control.execution import child
from kachaka_simple_control.execution.guardian import Guardian, Unguarded
from kachaka_simple_control.robot.robot_profile import RobotProfile
from kachaka_simple_control.ros.settings import Settings
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.node import Node


def guard(
        node: Node, publisher: VelocityPublisher, profile: RobotProfile, settings: Settings,
        claim: int) -> Guardian | Unguarded:
    """
    Start a guardian for a publisher, unless none is wanted.

    :param node: the node that publishes
    :param publisher: the publisher of velocities; the guardian's is of the same kind
    :param profile: the kind of robot
    :param settings: whether a guardian is wanted
    :param claim: a descriptor that it keeps open as long as it is there: the claim on the robot
    :returns: the guardian, or what stands in for it
    """
    if not settings.guardian:
        return Unguarded()
    arguments = [
        publisher.topic_name, node.context.get_domain_id(), profile.hold, profile.message_type,
        profile.frame]
    return Guardian(
        [*child.command('kachaka_simple_control.ros.guardian_process'), *map(str, arguments)],
        child.environment(), claim)
