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
"""Tell one program's publishers and subscriptions from another's."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
import uuid

from geometry_msgs.msg import Twist
from rclpy.node import Node

#: The first bytes of an endpoint's GID name its participant: one program, or one context of it.
PREFIX = 12


def participants(infos: Iterable[Any]) -> list[bytes]:
    """
    Return whose endpoints these are.

    Names of nodes would not do: not every pair of distros tells them to each other.

    :param infos: what rclpy tells of endpoints (``TopicEndpointInfo``)
    :returns: the participant of each
    """
    return [bytes(info.endpoint_gid[:PREFIX]) for info in infos]


def own_participant(node: Node) -> bytes:
    """
    Return what a node's own endpoints have in common.

    rclpy does not tell a publisher's GID, so that one is made on a topic that nobody else has.

    :param node: the node
    :returns: its participant
    """
    topic = f'/_kachaka_simple_control/participant_{uuid.uuid4().hex}'
    publisher = node.create_publisher(Twist, topic, 1)
    (own,) = participants(node.get_publishers_info_by_topic(topic))
    node.destroy_publisher(publisher)
    return own
