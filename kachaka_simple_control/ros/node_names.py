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
"""The names of the node that drives, looked at before it is made."""

from __future__ import annotations

from typing import Any

from kachaka_simple_control.robot.robot_profile import profile_of
from kachaka_simple_control.ros.names import names_of
from kachaka_simple_control.ros.rehearsal import check_node_names, rehearsal
from kachaka_simple_control.ros.settings import declare, declare_robot

#: What the node has of its own.
TOPICS = ('~/planned_path', '~/driven_path', '~/commanded_velocity', '/diagnostics')
SERVICES = ('~/stop', '~/run')


def check_names(name: str, **node_options: Any) -> None:
    """
    Make sure that a node can be made, with its topics and services and those of its robot.

    :param name: of the node
    :param node_options: options of ``rclpy.node.Node``
    :raises UsageError: if it cannot
    """
    with rehearsal(name, **node_options) as node:
        profile = profile_of(declare_robot(node))
        settings = declare(node, profile)
        names = names_of(profile, settings.robot_namespace, settings.manual_control)
        check_node_names(node, names, TOPICS, SERVICES)
