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
"""Look at what a node shows, as RViz and the like do: a node of its own that subscribes."""

from __future__ import annotations

import threading

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from ros_support import PATIENCE, wait_until

NODE = '/kachaka_simple_control'
ODOMETRY = '/kachaka/odometry/odometry'
VELOCITY = '/kachaka/manual_control/cmd_vel'
SHOWN = ('~/planned_path', '~/driven_path', '~/commanded_velocity', '/diagnostics')
KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Watcher:
    """Subscribes to topics, and keeps what comes."""

    def __init__(self):
        """Join the domain."""
        self._context = Context()
        self._context.init(args=[])
        self.node = Node('watcher', context=self._context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)

    def __enter__(self):
        """Look."""
        self._thread.start()
        return self

    def __exit__(self, *error):
        """Look no more."""
        self._executor.shutdown(timeout_sec=0.0)
        self._thread.join(5.0)
        self.node.destroy_node()
        self._context.try_shutdown()

    def watch(self, kind, topic, quality, matched=True):
        """Return a list that grows by what comes; by default once somebody publishes it."""
        seen = []
        self.node.create_subscription(kind, topic, seen.append, quality)
        if matched:
            assert wait_until(lambda: self.node.count_publishers(topic)), topic
        return seen

    def planned(self, node=NODE, **more):
        """Watch the planned path."""
        return self.watch(Path, f'{node}/planned_path', KEPT, **more)

    def driven(self, node=NODE, **more):
        """Watch the driven path."""
        return self.watch(Path, f'{node}/driven_path', 1, **more)

    def velocities(self, node=NODE, **more):
        """Watch the velocities that were sent."""
        return self.watch(
            TwistStamped, f'{node}/commanded_velocity', qos_profile_sensor_data, **more)

    def diagnoses(self, **more):
        """Watch the diagnostics."""
        return self.watch(DiagnosticArray, '/diagnostics', 10, **more)

    def call(self, kind, service, request):
        """Call a service, and return its answer."""
        client = self.node.create_client(kind, service)
        assert client.wait_for_service(PATIENCE), service
        future = client.call_async(request)
        assert wait_until(future.done), service
        return future.result()

    def tell_odometry(self, topic, x, y, z, w, frame):
        """Tell where a robot is, 20 times a second; return where to change it."""
        publisher = self.node.create_publisher(Odometry, topic, qos_profile_sensor_data)
        message = Odometry()
        message.header.frame_id = frame
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = z, w
        self.node.create_timer(0.05, lambda: publisher.publish(message))
        return message.pose.pose


def figures(diagnosis):
    """Return the figures of a diagnosis by name."""
    (status,) = diagnosis.status
    return {value.key: value.value for value in status.values}


def places(path):
    """Return where a path goes."""
    return [(pose.pose.position.x, pose.pose.position.y) for pose in path.poses]
