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
The compared loops: this package, three common loops, and the lower bound.

The three common loops are well written: the first message is sent at once, and the end time is
computed before the timer or the rate is created, so that there is no extra period.  Like the
lesson, they use the ROS clock and log each movement.
"""

from __future__ import annotations

import contextlib
import threading
import time
from typing import TypeAlias

from benchmarks.resource_usage import BILLION, sleep_until  # noqa: I100
from geometry_msgs.msg import Twist
from kachaka_simple_control import ControlError, KachakaSimpleControl
import rclpy
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.task import Future
from rclpy.time import Time

TOPIC = 'manual_control/cmd_vel'
SERVICE = 'manual_control/set_enabled'
#: The time of sending zeros before a measurement, until the reader has certainly matched [s].
MATCH_TIME = 1.0


class Ours:
    """The node of this package, used through its public API."""

    def __init__(self, rate: float, namespace: str, **parameters: object) -> None:
        wanted = {'rate': rate, 'robot_namespace': f'/{namespace}', **parameters}
        self._parameters = [Parameter(name, value=value) for name, value in wanted.items()]
        self._service = f'/{namespace}/{SERVICE}'
        self.node = KachakaSimpleControl(parameter_overrides=self._parameters)

    @property
    def has_matched(self) -> bool:
        """Return whether node and guardian have a subscriber and the robot's service is ready."""
        services = [name for name, _ in self.node.get_service_names_and_types()]
        return self.node.is_heard and self._service in services

    def connect(self) -> None:
        """Make a short first movement, which waits for the robot."""
        self.node.move_robot(0.0, 0.0, 0.2)

    def move(self, velocity: float, duration: float) -> None:
        """Hold a forward velocity [m/s] for a duration [s], then send a zero."""
        self.node.move_robot(velocity, 0.0, duration)

    def stop(self) -> None:
        """Stop the robot as the program does at its end."""
        self.node.stop_robot()

    def recover(self) -> None:
        """Make a new node, because a node that its guardian has stopped cannot move again."""
        self.close()
        self.node = KachakaSimpleControl(parameter_overrides=self._parameters)
        self.connect()

    def close(self) -> None:
        """Destroy the node."""
        self.node.destroy_node()


class _LoopNode(Node):
    """The base class of the other loops: publisher, discovery and the lesson's stop."""

    def __init__(self, rate: float, namespace: str) -> None:
        super().__init__('kachaka_simple_control')
        self.publisher = self.create_publisher(Twist, f'/{namespace}/{TOPIC}', 10)
        self.period = 1.0 / rate
        self.get_logger().info('Robot control node has started')

    @property
    def has_matched(self) -> bool:
        return self.publisher.get_subscription_count() > 0

    def connect(self) -> None:
        while not self.has_matched:
            time.sleep(0.02)
        for _ in range(20):
            self.publisher.publish(Twist())
            time.sleep(MATCH_TIME / 20)

    def move(self, velocity: float, duration: float) -> None:
        message = Twist()
        message.linear.x = velocity
        self.hold(message, duration)
        self.stop()
        self.get_logger().info(
            f'Movement completed: Forward={velocity}, Rotation=0.0, Time={duration} seconds')

    def hold(self, message: Twist, duration: float) -> None:
        raise NotImplementedError

    def end_of(self, duration: float) -> Time:
        return self.get_clock().now() + Duration(seconds=duration)

    def stop(self) -> None:
        self.publisher.publish(Twist())
        self.get_logger().info('Robot has stopped')

    def recover(self) -> None:
        pass

    def close(self) -> None:
        self.destroy_node()


#: What holds a velocity for a time.
Loop: TypeAlias = Ours | _LoopNode


class LessonLoop(_LoopNode):
    """A loop like the lesson's: publish, spin once for at most a period, and check the time."""

    def hold(self, message: Twist, duration: float) -> None:
        """Publish a message for a duration [s]."""
        end = self.end_of(duration)
        while self.get_clock().now() < end:
            self.publisher.publish(message)
            rclpy.spin_once(self, timeout_sec=self.period)


class TimerLoop(_LoopNode):
    """A loop that publishes in the callback of an rclpy timer."""

    def hold(self, message: Twist, duration: float) -> None:
        """Publish a message for a duration [s]."""
        over = Future()
        end = self.end_of(duration)

        def tick() -> None:
            if self.get_clock().now() < end:
                self.publisher.publish(message)
            elif not over.done():
                over.set_result(None)

        timer = self.create_timer(self.period, tick)
        tick()
        rclpy.spin_until_future_complete(self, over)
        self.destroy_timer(timer)


class RateLoop(_LoopNode):
    """A loop that publishes and sleeps with an rclpy Rate, while another thread spins the node."""

    def __init__(self, rate: float, namespace: str) -> None:
        super().__init__(rate, namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def hold(self, message: Twist, duration: float) -> None:
        """Publish a message for a duration [s]."""
        end = self.end_of(duration)
        rate = self.create_rate(1.0 / self.period)
        while self.get_clock().now() < end:
            self.publisher.publish(message)
            rate.sleep()
        self.destroy_rate(rate)

    def close(self) -> None:
        """End the spinning thread, and destroy the node."""
        self._executor.shutdown(timeout_sec=0.0)
        self._thread.join(5.0)
        self.destroy_node()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()


class Floor(_LoopNode):
    """
    The lower bound for a Python program: a kernel sleep, and serialized messages.

    The loop cannot be interrupted, checks nothing and logs nothing.
    """

    def move(self, velocity: float, duration: float) -> None:
        """Hold a forward velocity [m/s] for a duration [s], then send a zero."""
        message = Twist()
        message.linear.x = velocity
        moving, zero = serialize_message(message), serialize_message(Twist())
        count = round(duration / self.period)
        start = time.monotonic_ns()
        for tick in range(count):
            self.publisher.publish(moving)
            sleep_until(start + round((tick + 1) * self.period * BILLION))
        self.publisher.publish(zero)


LOOPS = {'ours': Ours, 'lesson': LessonLoop, 'timer': TimerLoop, 'rate': RateLoop, 'floor': Floor}
#: The exceptions that end a movement.
GIVEN_UP = ControlError
