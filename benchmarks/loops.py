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
The contenders: ours, three loops that people write, and the floor.

The three are written as well as their means allow.  The first message leaves at once, and the
end is taken from the clock before the timer or the rate is made, so that the last period is not
one too many.  Like the lesson, they keep time by the ROS clock and log each movement.
"""

from __future__ import annotations

import contextlib
import threading
import time
from typing import Protocol

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

from benchmarks.nanosleep import BILLION, sleep_until  # noqa: I100

TOPIC = 'manual_control/cmd_vel'
SERVICE = 'manual_control/set_enabled'
#: How long zeros are sent before what is measured, so that the reader has surely matched [s].
ACQUAINTANCE = 1.0


class Loop(Protocol):
    """One way to hold a velocity for a time."""

    @property
    def has_matched(self) -> bool:
        """Return whether the program knows of the robot all that it needs to move it."""

    def meet(self) -> None:
        """Wait until the robot listens; not a part of what is measured."""

    def move(self, velocity: float, duration: float) -> None:
        """
        Hold a velocity for a time, then send a zero.

        :param velocity: forward [m/s]
        :param duration: how long [s]
        """

    def stop(self) -> None:
        """Do what the program does on its way out."""

    def renew(self) -> None:
        """Be able to move again after a movement was given up."""

    def close(self) -> None:
        """Take the node down."""


class Ours:
    """Our node, by its public interface alone."""

    def __init__(self, rate: float, namespace: str, **parameters: object) -> None:
        """
        Make the node.

        :param rate: how often a velocity is sent [Hz]
        :param namespace: where the robot is
        :param parameters: other parameters of the node
        """
        wanted = {'rate': rate, 'robot_namespace': f'/{namespace}', **parameters}
        self._parameters = [Parameter(name, value=value) for name, value in wanted.items()]
        self._service = f'/{namespace}/{SERVICE}'
        self.node = KachakaSimpleControl(parameter_overrides=self._parameters)

    @property
    def has_matched(self) -> bool:
        """Return whether node and guardian have a subscriber, and the robot's service is there."""
        services = [name for name, _ in self.node.get_service_names_and_types()]
        return self.node.is_heard and self._service in services

    def meet(self) -> None:
        """Let the first movement find the robot."""
        self.node.move_robot(0.0, 0.0, 0.2)

    def move(self, velocity: float, duration: float) -> None:
        """
        Hold a velocity for a time, then send a zero.

        :param velocity: forward [m/s]
        :param duration: how long [s]
        """
        self.node.move_robot(velocity, 0.0, duration)

    def stop(self) -> None:
        """Do what the program does on its way out."""
        self.node.stop_robot()

    def renew(self) -> None:
        """Make a new node: what the guardian has stopped never moves again."""
        self.close()
        self.node = KachakaSimpleControl(parameter_overrides=self._parameters)
        self.meet()

    def close(self) -> None:
        """Take the node down."""
        self.node.destroy_node()


class _LoopNode(Node):
    """What the loops of others share: a publisher, a first meeting and the lesson's ending."""

    def __init__(self, rate: float, namespace: str) -> None:
        super().__init__('kachaka_simple_control')
        self.publisher = self.create_publisher(Twist, f'/{namespace}/{TOPIC}', 10)
        self.period = 1.0 / rate
        self.get_logger().info('Robot control node has started')

    @property
    def has_matched(self) -> bool:
        return self.publisher.get_subscription_count() > 0

    def meet(self) -> None:
        while not self.has_matched:
            time.sleep(0.02)
        for _ in range(20):
            self.publisher.publish(Twist())
            time.sleep(ACQUAINTANCE / 20)

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

    def renew(self) -> None:
        pass

    def close(self) -> None:
        self.destroy_node()


class LessonLoop(_LoopNode):
    """Publish, spin once for at most a period, look at the clock: what the lesson does."""

    def hold(self, message: Twist, duration: float) -> None:
        """
        Publish until the time is over.

        :param message: what to publish
        :param duration: how long [s]
        """
        end = self.end_of(duration)
        while self.get_clock().now() < end:
            self.publisher.publish(message)
            rclpy.spin_once(self, timeout_sec=self.period)


class TimerLoop(_LoopNode):
    """Publish in the callback of an rclpy timer."""

    def hold(self, message: Twist, duration: float) -> None:
        """
        Publish until the time is over.

        :param message: what to publish
        :param duration: how long [s]
        """
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
    """Publish, then sleep by an rclpy Rate, while another thread spins the node."""

    def __init__(self, rate: float, namespace: str) -> None:
        """
        Make the node, and the thread that a Rate cannot do without.

        :param rate: how often a velocity is sent [Hz]
        :param namespace: where the robot is
        """
        super().__init__(rate, namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def hold(self, message: Twist, duration: float) -> None:
        """
        Publish until the time is over.

        :param message: what to publish
        :param duration: how long [s]
        """
        end = self.end_of(duration)
        rate = self.create_rate(1.0 / self.period)
        while self.get_clock().now() < end:
            self.publisher.publish(message)
            rate.sleep()
        self.destroy_rate(rate)

    def close(self) -> None:
        """Take the node down, after the thread that spins it."""
        self._executor.shutdown(timeout_sec=0.0)
        self._thread.join(5.0)
        self.destroy_node()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()


class Floor(_LoopNode):
    """
    The least that a Python program can do: the kernel's own sleep, and ready-made bytes.

    It cannot be interrupted, checks nothing and logs nothing; no contender can be below it.
    """

    def move(self, velocity: float, duration: float) -> None:
        """
        Hold a velocity for a time, then send a zero.

        :param velocity: forward [m/s]
        :param duration: how long [s]
        """
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
#: What a loop may raise when a movement is given up.
GIVEN_UP = ControlError
