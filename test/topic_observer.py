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
"""Subscribe to the topics of a node, as RViz does."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from spinning import SpinThread
from waiting import poll, TIMEOUT, wait_until

NODE = '/kachaka_simple_control'
ODOMETRY = '/kachaka/odometry/odometry'
VELOCITY = '/kachaka/manual_control/cmd_vel'
SHOWN = ('~/planned_path', '~/driven_path', '~/commanded_velocity', '/diagnostics')
TRANSIENT_LOCAL = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class TopicObserver:
    """A node that subscribes to topics, and keeps their messages."""

    def __init__(self):
        self._context = Context()
        self._context.init(args=[])
        self.node = Node('observer', context=self._context, start_parameter_services=False)
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self.node)
        self._spinning = SpinThread(executor)

    def __enter__(self):
        """Spin."""
        self._spinning.start()
        return self

    def __exit__(self, *error):
        """Destroy the node."""
        self._spinning.close()
        self.node.destroy_node()
        self._context.try_shutdown()

    def subscribe(self, kind, topic, quality, matched=True):
        """Return a list that messages are added to; by default, wait for a publisher."""
        seen = []
        self.node.create_subscription(kind, topic, seen.append, quality)
        if matched:
            wait_until(lambda: self.node.count_publishers(topic))
        return seen

    def planned(self, node=NODE, **more):
        """Subscribe to the planned path."""
        return self.subscribe(Path, f'{node}/planned_path', TRANSIENT_LOCAL, **more)

    def driven(self, node=NODE, **more):
        """Subscribe to the driven path."""
        return self.subscribe(Path, f'{node}/driven_path', 1, **more)

    def velocities(self, node=NODE, **more):
        """Subscribe to the sent velocities."""
        return self.subscribe(
            TwistStamped, f'{node}/commanded_velocity', qos_profile_sensor_data, **more)

    def diagnostics(self, **more):
        """Subscribe to the diagnostics."""
        return self.subscribe(DiagnosticArray, '/diagnostics', 10, **more)

    def call(self, kind, service, request):
        """Call a service; return its response."""
        client = self.node.create_client(kind, service)
        assert client.wait_for_service(TIMEOUT), service
        future = client.call_async(request)
        assert poll(future.done, TIMEOUT), service
        return future.result()

    def publish_odometry(self, topic, x, y, z, w, frame):
        """Publish a pose at 20 Hz; return it, to be changed."""
        publisher = self.node.create_publisher(Odometry, topic, qos_profile_sensor_data)
        message = Odometry()
        message.header.frame_id = frame
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = z, w
        self.node.create_timer(0.05, lambda: publisher.publish(message))
        return message.pose.pose


def figures(message):
    """Return the values of a diagnostic message by key."""
    (status,) = message.status
    return {value.key: value.value for value in status.values}


def positions(path):
    """Return the positions of a path."""
    return [(pose.pose.position.x, pose.pose.position.y) for pose in path.poses]
