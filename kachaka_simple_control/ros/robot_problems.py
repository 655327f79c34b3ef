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
Texts that say why no robot can be driven.

Tested by test/ros/test_robot_discovery.py.
"""

from __future__ import annotations

import os

from kachaka_simple_control.ros.dds_transport import is_localhost_only
from kachaka_simple_control.ros.endpoints import incompatibility
from kachaka_simple_control.ros.environment import DISCOVERY_SERVER
from kachaka_simple_control.ros.graph import Graph
from kachaka_simple_control.ros.velocity_publisher import TYPES, VelocityPublisher
from kachaka_simple_control.text import escaped, quoted

ROBOT_LEFT = 'the robot left: nobody subscribes to {topic} any more'
ROBOT_REPLACED = 'the robot left: who subscribes to {topic} now came later'
SEVERAL_ROBOTS = ('{count} robots publish {topic}, and each of them would obey; stop all but one, '
                  'or give each its own robot_namespace')
#: If a robot that this program has started is the only one to be driven.
OWN_ROBOT_SILENT = 'the robot that this program started does not publish {topic}'
ANOTHER_ROBOT = ('another robot publishes {topic}: stop its bridge, or name a robot_namespace for '
                 'this one')
NO_SERVICE = ('a subscriber is there, but not the service {service}; for a robot without it, set '
              'the parameter manual_control to false')
NO_ODOMETRY = (
    'a subscriber is there, but nobody publishes {topic}; for a robot without odometry write '
    '`odometry_topic: null`, and for one that may have none `odometry_required: false`, in its '
    'profile (--robot FILE)')
GUARDIAN_UNMATCHED = (
    'the guardian has not discovered the robot within {timeout:g} s, so nothing moved; the '
    'parameter guardian:=false drives without one')


def no_match(publisher: VelocityPublisher, graph: Graph) -> str:
    """Return a text that says why no subscription matches a velocity publisher."""
    own_type, topic = publisher.msg_type.__name__, publisher.topic_name
    infos = [info for _, info in graph.subscriptions(topic)]
    types = {info.topic_type for info in infos}
    same_type = [info for info in infos if info.topic_type.endswith('/' + own_type)]
    if types and not same_type:
        taken = ', '.join(sorted(types))
        remedy = next((f': write `message_type: {name}` in the profile of the robot (--robot '
                       'FILE)' for name in TYPES if taken.endswith(f'/{name}')), '')
        return f'its subscriber takes {escaped(taken)}, not {own_type}{remedy}'
    # Read both QoS profiles from the graph: a publisher returns 0 s for an unset deadline.
    offered = [info.qos_profile for participant, info in graph.publishers(topic)
               if participant == graph.participant]
    for info in same_type:
        if offered and (reason := incompatibility(offered[0], info.qos_profile)):
            return (f'a subscriber is there (node {escaped(info.node_name, 60)}), but its '
                    f'quality of service does not fit: {reason}; change that of the robot')
    return 'nobody subscribes to it'


def hint() -> str:
    """Return what to look at if no robot is found; not for one that this program has started."""
    text = ('. Is its bridge running, in the same ROS_DOMAIN_ID? Compare the name with `ros2 '
            'topic list`. Without a robot, try `kachaka_simple_control --sim`')
    if is_localhost_only():
        text += '. Only this machine is searched, as environment variables say'
    if server := os.environ.get(DISCOVERY_SERVER):
        text += f'. {DISCOVERY_SERVER} is {quoted(server, 100)}: does this server run?'
    return text
