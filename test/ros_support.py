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
"""Processes and a node for tests with ROS."""

from __future__ import annotations

import math
import sys
import time

from kachaka_simple_control.process import processes
from kachaka_simple_control.ros.dds_transport import CHOICES
from program import Program
from waiting import poll, TIMEOUT, wait_until

BRIDGE = [sys.executable, '-m', 'kachaka_simple_control.kachaka.bridge_command']


class BridgeProcess(Program):
    """A bridge as a user starts it, and its log."""

    def __init__(self, *options, **more):
        """Start it; ``more`` goes to Popen."""
        super().__init__([*BRIDGE, *options], **more)

    @property
    def lines(self):
        """Return the lines of its log."""
        return self.text.splitlines()


def bridge(*options, **more):
    """Run a bridge to the simulated robot for the length of a block."""
    return BridgeProcess('--sim', *options, **more)


class Probe:
    """A node that sends velocities and receives odometry; it spins in a thread of its own."""

    def __init__(self):
        from geometry_msgs.msg import Twist
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from spinning import SpinThread
        from std_srvs.srv import SetBool
        self._twist, self._set_bool = Twist, SetBool
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('probe', context=self.context)
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self.node)
        self._spinning = SpinThread(executor)
        self._spinning.start()

    def close(self):
        """Destroy the node."""
        import rclpy
        self._spinning.close()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def publisher(self, namespace, process, refusal='the robot refused'):
        """Return a publisher of velocities that a bridge has matched for certain."""
        publisher = self.node.create_publisher(
            self._twist, f'{namespace}/manual_control/cmd_vel', 10)

        def has_matched():
            # The reader may match later than the writer.  NaN is refused with a log line, and
            # changes nothing.
            self.send(publisher, math.nan)
            return refusal in process.text

        wait_until(has_matched)
        return publisher

    def send(self, publisher, linear_x, angular_z=0.0):
        """Publish one velocity."""
        message = self._twist()
        message.linear.x, message.angular.z = linear_x, angular_z
        publisher.publish(message)

    def odometry(self, namespace, topic='odometry/odometry'):
        """Return a list that odometry is added to, with the time of its arrival."""
        from nav_msgs.msg import Odometry
        from rclpy.qos import qos_profile_sensor_data
        received = []
        self.node.create_subscription(
            Odometry, f'{namespace}/{topic}',
            lambda message: received.append((time.monotonic(), message)), qos_profile_sensor_data)
        wait_until(lambda: received)
        return received

    def scans(self, namespace):
        """Return a list that the laser's scans are added to."""
        from rclpy.qos import qos_profile_sensor_data
        from sensor_msgs.msg import LaserScan
        received = []
        self.node.create_subscription(
            LaserScan, f'{namespace}/lidar/scan', received.append, qos_profile_sensor_data)
        return received

    def set_enabled(self, namespace, enabled):
        """Call the service; return its response."""
        return self._call(self._set_bool, f'{namespace}/manual_control/set_enabled', data=enabled)

    def activate_laser(self, namespace):
        """Call the service; return its response."""
        from std_srvs.srv import Trigger
        return self._call(Trigger, f'{namespace}/lidar/activate')

    def _call(self, kind, name, **values):
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(TIMEOUT)
        # A killed bridge stays in the graph for 20 s: where it is all that was discovered yet, the
        # request goes to it alone.
        for _ in range(4):
            future = client.call_async(kind.Request(**values))
            if poll(future.done, TIMEOUT / 3.0):
                return future.result()
        raise AssertionError(f'{client.srv_name} does not answer')


def free_environment(**chosen):
    """Return an environment in which nothing but this is chosen of transport and range."""
    free = {name: value for name, value in processes.child_environment().items()
            if name not in CHOICES}
    return {**free, **chosen}
