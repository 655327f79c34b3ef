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
"""
What a node asks the ROS graph, for all its robots.

Tested by test/ros/test_robot_discovery.py.
"""

from __future__ import annotations

from kachaka_simple_control.ros.endpoints import own_participant, participants
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

#: A publisher or a subscription of a topic, and the DDS participant to which it belongs.
Endpoint = tuple[bytes, TopicEndpointInfo]


class Graph:
    """
    Asks the ROS graph about topics; one object for all robots of a node.

    Each call may have to wait for DDS.  Topics are given by their full names, after remapping.

    :ivar participant: the DDS participant of the node.  A context gets a new one if all its nodes
        are destroyed and another one is made, so this is asked once for a node.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.participant = own_participant(node)

    # By the handle a count takes 1 us.  The methods of the node check the name each time, and take
    # four times as long; a list of endpoints takes 25 times as long.

    def count_publishers(self, topic: str) -> int:
        """Return how many publishers a topic has, with those of this node."""
        handle = self.node.handle
        with handle:
            return int(handle.get_count_publishers(topic))

    def count_subscriptions(self, topic: str) -> int:
        """Return how many subscriptions a topic has, with those of this node."""
        handle = self.node.handle
        with handle:
            return int(handle.get_count_subscribers(topic))

    def publishers(self, topic: str) -> list[Endpoint]:
        """Return the publishers of a topic, with those of this node."""
        infos = self.node.get_publishers_info_by_topic(topic)
        return [*zip(participants(infos), infos)]

    def subscriptions(self, topic: str) -> list[Endpoint]:
        """Return the subscriptions of other nodes; that of ``ForeignMessages`` is left out."""
        infos = self.node.get_subscriptions_info_by_topic(topic)
        own = self.participant, self.node.get_name(), self.node.get_namespace()
        return [(participant, info) for participant, info in zip(participants(infos), infos)
                if (participant, info.node_name, info.node_namespace) != own]
