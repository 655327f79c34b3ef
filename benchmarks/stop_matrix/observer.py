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
"""Listens from outside: to all that is sent to the robots, and to their odometry."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
import threading
import time

from geometry_msgs.msg import Twist
from listener import Heard, KNOWS_SOURCE_TIME, QUALITY
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool


class Stranger:
    """Somebody who has a publisher of velocities for a robot that is driven already."""

    def __init__(self, node: Node, topic: str) -> None:
        """
        Have the publisher, and send nothing.

        :param node: whose it is
        :param topic: where the robot takes velocities
        """
        self._node = node
        self._publisher = node.create_publisher(Twist, topic, 10)

    def send(self, velocity: float) -> float:
        """
        Send a velocity.

        :param velocity: how fast [m/s]
        :returns: when [s, system clock]
        """
        message = Twist()
        message.linear.x = velocity
        now = time.time()
        self._publisher.publish(message)
        return now

    def leave(self) -> None:
        """Have no publisher any more."""
        self._node.destroy_publisher(self._publisher)


class Ears:
    """
    What is heard of one robot.

    Times are those that DDS stamps on a message when it is sent, so that how fast this process
    reads does not matter.
    """

    def __init__(self, node: Node, namespace: str) -> None:
        """
        Listen from now on.

        :param node: who listens
        :param namespace: where the robot is
        """
        self._node = node
        #: where the robot is
        self.namespace = namespace
        self._topic = f'/{namespace}/manual_control/cmd_vel'
        self.heard: list[Heard] = []
        self._odometry: list[bytes] = []
        self._subscriptions = [
            node.create_subscription(
                Twist, self._topic,
                self._hear_with_info if KNOWS_SOURCE_TIME else self._hear, QUALITY),
            # Raw, for there is much of it and little is looked at.
            node.create_subscription(
                Odometry, f'/{namespace}/odometry/odometry', self._odometry.append,
                qos_profile_sensor_data, raw=True)]
        self._control = node.create_client(
            SetBool, f'/{namespace}/manual_control/set_enabled')

    def forget(self) -> None:
        """Forget what was heard: another program comes."""
        self.heard.clear()
        self._odometry.clear()

    def wait(
            self, condition: Callable[[Heard], bool], since: float,
            timeout: float) -> Heard | None:
        """
        Wait for a velocity.

        :param condition: what fits
        :param since: sent after this time [s, system clock]
        :param timeout: how long to wait [s]
        :returns: the first that fits; None if none came in time
        """
        end = time.monotonic() + timeout
        while True:
            for heard in self.since(since):
                if condition(heard):
                    return heard
            if time.monotonic() > end:
                return None
            time.sleep(0.005)

    def since(self, since: float) -> list[Heard]:
        """
        Return what was sent from a time on, in order of time.

        :param since: the time [s, system clock]
        :returns: the velocities
        """
        return sorted(
            (heard for heard in [*self.heard] if heard.time > since), key=lambda one: one.time)

    @property
    def samples(self) -> int:
        """Return how often odometry was heard."""
        return len(self._odometry)

    def driven(self, since: float, alone: bool = False) -> float | None:
        """
        Return how far the robot drove.

        :param since: from when on [s, system clock]
        :param alone: whether another robot was there before that, whose place does not count
        :returns: the length of its way along x [m]; None if odometry says nothing from then on
        """
        places = sorted(map(_place, [*self._odometry]))
        before = [place for at, place in places if at <= since]
        after = [place for at, place in places if at > since]
        if not after:
            return None
        way = after if alone else [*before[-1:], *after]
        return sum(abs(two - one) for one, two in pairwise(way))

    def switch_off(self) -> float:
        """
        Switch manual control off from outside, without waiting for the answer.

        :returns: when [s, system clock]
        """
        now = time.time()
        self._control.call_async(SetBool.Request(data=False))
        return now

    def somebody_else(self) -> Stranger:
        """Return somebody else who has a publisher of velocities for the robot."""
        return Stranger(self._node, self._topic)

    def _hear(self, message: Twist) -> None:
        self.heard.append(Heard(time.time(), message.linear.x, message.angular.z))

    def _hear_with_info(self, message: Twist, info: dict[str, int]) -> None:
        self.heard.append(Heard(
            info['source_timestamp'] / 1e9, message.linear.x, message.angular.z))


class Observer:
    """A node of its own, which spins in a thread of its own."""

    def __init__(self, domain: int) -> None:
        """
        Join a domain.

        :param domain: its number
        """
        self._context = Context()
        self._context.init(args=[], domain_id=domain)
        self._node = Node(
            'observer', context=self._context, enable_rosout=False,
            start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._clock = self._node.create_publisher(Clock, '/clock', 1)
        self._thread.start()

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown(timeout_sec=0.0)
        self._thread.join(5.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def ears(self, namespace: str) -> Ears:
        """
        Listen to one more robot.

        :param namespace: where it is
        :returns: what is heard
        """
        return Ears(self._node, namespace)

    def tell_time(self) -> None:
        """Publish one message on ``/clock``, for whoever uses simulated time."""
        self._clock.publish(Clock())


def _place(raw: bytes) -> tuple[float, float]:
    message = deserialize_message(raw, Odometry)
    stamp = message.header.stamp
    return stamp.sec + 1e-9 * stamp.nanosec, message.pose.pose.position.x
