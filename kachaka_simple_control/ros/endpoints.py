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
"""DDS endpoints: whose they are, and which qualities of service match."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
import uuid

from geometry_msgs.msg import Twist
from rclpy.node import Node
from rclpy.qos import qos_check_compatible, QoSCompatibility, QoSProfile

#: Of a service.  The default queue holds ten requests; one that arrives while it is full is lost,
#: and its client waits forever.
SERVICE_QOS = QoSProfile(depth=1000)
#: Length of the part of a GID that identifies the participant: one context of one process [bytes].
PARTICIPANT_LENGTH = 12
#: Policies that have to match, as ``QoSProfile`` names them.
_POLICIES = ('reliability', 'durability', 'deadline', 'liveliness', 'liveliness_lease_duration')


def participants(infos: Iterable[Any]) -> list[bytes]:
    """
    Return the DDS participant of each endpoint (``TopicEndpointInfo``).

    Node names do not identify a program: between some ROS distributions they are not transmitted.
    """
    return [bytes(info.endpoint_gid[:PARTICIPANT_LENGTH]) for info in infos]


def own_participant(node: Node) -> bytes:
    """
    Return the DDS participant of a node.

    rclpy does not offer the GID of a publisher, so one is created on a topic with a unique name
    and looked up in the graph.
    """
    topic = f'/_kachaka_simple_control/participant_{uuid.uuid4().hex}'
    publisher = node.create_publisher(Twist, topic, 1)
    (participant,) = participants(node.get_publishers_info_by_topic(topic))
    node.destroy_publisher(publisher)
    return participant


def incompatibility(offered: QoSProfile, requested: QoSProfile) -> str:
    """
    Describe why a publisher and a subscription do not match.

    :param offered: the quality of service of the publisher
    :param requested: that of the subscription
    :returns: the policies that do not match, with both values; empty if all match
    """
    if _is_compatible(offered, requested):
        return ''
    # One policy at a time, with all others as the publisher offers them.
    return ', '.join(
        f'{policy} (it asks for {_text(requested, policy)}, and {_text(offered, policy)} is '
        'offered)'
        for policy in _POLICIES
        if not _is_compatible(offered, _with_policy(offered, requested, policy)))


def _is_compatible(offered: QoSProfile, requested: QoSProfile) -> bool:
    return bool(qos_check_compatible(offered, requested)[0] != QoSCompatibility.ERROR)


def _with_policy(base: QoSProfile, source: QoSProfile, policy: str) -> QoSProfile:
    profile = QoSProfile(depth=1, **{name: getattr(base, name) for name in _POLICIES})
    setattr(profile, policy, getattr(source, policy))
    return profile


def _text(profile: QoSProfile, policy: str) -> str:
    value = getattr(profile, policy)
    if hasattr(value, 'nanoseconds'):
        # A duration that is not set is infinite.
        seconds = value.nanoseconds / 1e9
        return f'{seconds:g} s' if 0.0 < seconds < 1e9 else 'none'
    return str(value.name).lower()
