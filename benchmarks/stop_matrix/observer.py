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
"""Record the velocities sent to robots, and their odometry, in an independent node."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
import time

from geometry_msgs.msg import Twist
from listener import InfoExecutor, QUALITY, SentVelocity
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from spinning import SpinThread
from std_srvs.srv import SetBool, Trigger
from waiting import poll

#: The longest time until a client discovers a service, and the time until the service has
#: discovered the client [s].
SERVICE_TIMEOUT, DISCOVERY_TIME = 5.0, 0.5


class OtherPublisher:
    """Another publisher of velocities for a robot that a program already drives."""

    def __init__(self, node: Node, topic: str) -> None:
        self._node = node
        self._publisher = node.create_publisher(Twist, topic, 10)

    def send(self, velocity: float) -> float:
        """Publish a velocity."""
        message = Twist()
        message.linear.x = velocity
        now = time.time()
        self._publisher.publish(message)
        return now

    def close(self) -> None:
        """Destroy the publisher."""
        self._node.destroy_publisher(self._publisher)


class RobotRecorder:
    """
    Records the velocities sent to one robot, and its odometry.

    Times are the source timestamps of DDS, so that delays of this process do not matter.
    """

    def __init__(self, node: Node, namespace: str) -> None:
        self._node = node
        self.namespace = namespace
        self._topic = f'/{namespace}/manual_control/cmd_vel'
        self._velocities: list[SentVelocity] = []
        self._odometry: list[bytes] = []
        self._subscriptions = [
            node.create_subscription(Twist, self._topic, self._on_velocity, QUALITY),
            # Raw messages, because there are many and only few are read.
            node.create_subscription(
                Odometry, f'/{namespace}/odometry/odometry', self._on_odometry,
                qos_profile_sensor_data, raw=True)]
        self._set_enabled = node.create_client(
            SetBool, f'/{namespace}/manual_control/set_enabled')

    def clear(self) -> None:
        """Discard all recorded data, before another program starts."""
        self._velocities.clear()
        self._odometry.clear()

    def wait_for(
            self, condition: Callable[[SentVelocity], bool], since: float,
            timeout: float) -> SentVelocity | None:
        """
        Wait for a velocity that meets a condition.

        :returns: the first matching velocity; None after the timeout
        """
        return poll(lambda: next(filter(condition, self.sent_since(since)), None), timeout)

    def sent_since(self, since: float) -> list[SentVelocity]:
        """Return the velocities sent after a time [s, system clock], in order of time."""
        return sorted((one for one in [*self._velocities] if one.time > since),
                      key=lambda one: one.time)

    @property
    def odometry_count(self) -> int:
        """Return the number of odometry messages."""
        return len(self._odometry)

    def distance_since(self, since: float, new_robot: bool = False) -> float | None:
        """
        Return the distance that the robot drove along x.

        :returns: the length of the path [m]; None without odometry after the start time
        """
        positions = sorted(map(_position, [*self._odometry]))
        before = [x for at, x in positions if at <= since]
        after = [x for at, x in positions if at > since]
        if not after:
            return None
        path = after if new_robot else [*before[-1:], *after]
        return sum(abs(two - one) for one, two in pairwise(path))

    def disable_manual_control(self) -> None:
        """Disable manual control from this node, without waiting for the response."""
        self._set_enabled.call_async(SetBool.Request(data=False))

    def add_publisher(self) -> OtherPublisher:
        """Return another publisher of velocities for the robot."""
        return OtherPublisher(self._node, self._topic)

    def _on_velocity(self, message: Twist, info: dict[str, int]) -> None:
        self._velocities.append(SentVelocity(
            info['source_timestamp'] / 1e9, message.linear.x, message.angular.z))

    def _on_odometry(self, message: bytes, _info: dict[str, int]) -> None:
        self._odometry.append(message)


class Observer:
    """A node that spins in its own thread, in its own ROS domain."""

    def __init__(self, domain: int) -> None:
        self._context = Context()
        self._context.init(args=[], domain_id=domain)
        self._node = Node(
            'observer', context=self._context, enable_rosout=False,
            start_parameter_services=False)
        self._clock = self._node.create_publisher(Clock, '/clock', 1)
        executor = InfoExecutor(context=self._context)
        executor.add_node(self._node)
        self._spinning = SpinThread(executor)
        self._spinning.start()

    def close(self) -> None:
        """Destroy the node, and leave the domain."""
        self._spinning.close()
        self._node.destroy_node()
        self._context.try_shutdown()

    def record(self, namespace: str) -> RobotRecorder:
        """Return a recorder of the robot in a namespace."""
        return RobotRecorder(self._node, namespace)

    def request(self, service: str) -> float:
        """Call a service without waiting for the response; return when [s, system clock]."""
        client = self._node.create_client(Trigger, service)
        if not client.wait_for_service(SERVICE_TIMEOUT):
            raise RuntimeError(f'there is no service {service}')
        # The service may discover the client later than the client the service.
        time.sleep(DISCOVERY_TIME)
        now = time.time()
        client.call_async(Trigger.Request())
        return now

    def publish_clock(self) -> None:
        """Publish one message on ``/clock``, for nodes that use simulated time."""
        self._clock.publish(Clock())


def _position(raw: bytes) -> tuple[float, float]:
    """Return the time stamp [s] and the x position [m] of a serialized odometry message."""
    message = deserialize_message(raw, Odometry)
    stamp = message.header.stamp
    return stamp.sec + 1e-9 * stamp.nanosec, message.pose.pose.position.x
