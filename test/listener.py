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
"""A robot that records what is sent to it and requested of it, and when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import inspect
import time
from typing import Any

from geometry_msgs.msg import Twist
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from spinning import SpinThread
from std_srvs.srv import SetBool, Trigger
from waiting import poll

#: Best effort, as the bridge, but deeper than its 5: a loaded machine must lose nothing here.
QUALITY = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


@dataclass(frozen=True)
class SentVelocity:
    """A velocity, and when it was sent [s, system clock]."""

    time: float
    linear_x: float
    angular_z: float

    @property
    def moves(self) -> bool:
        """Whether it asks for motion."""
        return self.linear_x != 0.0 or self.angular_z != 0.0


@dataclass(frozen=True)
class HeldVelocity:
    """A velocity and how long it was held [s], in how many messages."""

    linear_x: float
    angular_z: float
    duration: float
    count: int


def takes_info(callback: Callable[..., object]) -> bool:
    """Return whether a callback takes a message's info, too, as later releases of rclpy decide."""
    try:
        inspect.signature(callback).bind(object())
    except TypeError:
        return True
    return False


class InfoExecutor(SingleThreadedExecutor):
    """Gives callbacks that take it the message's info, too, which Humble's own keeps back."""

    if not hasattr(Subscription, 'CallbackType'):
        def _take_subscription(self, sub: Subscription) -> tuple[Any, dict[str, int]] | None:
            with sub.handle:
                return sub.handle.take_message(sub.msg_type, sub.raw)

        async def _execute_subscription(
                self, sub: Subscription, taken: tuple[Any, dict[str, int]] | None) -> None:
            if taken is not None:
                sub.callback(*taken if takes_info(sub.callback) else taken[:1])


class Listener:
    """Subscribes as the official bridge does, and serves ``set_enabled``."""

    def __init__(
            self, namespace: str = 'kachaka', serves: bool = True, grants: bool = True,
            delay: float = 0.0, reason: str = 'not today',
            quality: QoSProfile = QUALITY,
            topic: tuple[str, type] = ('manual_control/cmd_vel', Twist)) -> None:
        """
        Make the node, which spins within the ``with`` block.

        :param delay: of its response [s]
        """
        self.received: list[SentVelocity] = []
        self.answered: list[tuple[float, bool]] = []
        self._grants, self._delay, self._reason = grants, delay, reason
        self._context = Context()
        self._context.init(args=[])
        self._node = Node(
            'listener', namespace=namespace, context=self._context,
            start_parameter_services=False)
        self._subscription = self._node.create_subscription(
            topic[1], topic[0], self._on_velocity, quality)
        if serves:
            self._node.create_service(SetBool, 'manual_control/set_enabled', self._answer)
        executor = InfoExecutor(context=self._context)
        executor.add_node(self._node)
        self._spinning = SpinThread(executor)

    def __enter__(self) -> Listener:
        """Spin."""
        self._spinning.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Destroy the node."""
        self._spinning.close()
        self._node.destroy_node()
        self._context.try_shutdown()

    def also(self, namespace: str) -> None:
        """Be another robot, too, of which nothing is recorded."""
        self._node.create_subscription(
            Twist, f'/{namespace}/manual_control/cmd_vel', lambda _: None, QUALITY)
        self._node.create_service(
            SetBool, f'/{namespace}/manual_control/set_enabled', self._answer)

    def leave(self) -> None:
        """Destroy the subscription."""
        self._node.destroy_subscription(self._subscription)

    def call(self, name: str) -> Trigger.Response:
        """Call a service of the node under test; fail without a response."""
        client = self._node.create_client(
            Trigger, name if name.startswith('/') else f'/kachaka_simple_control/{name}')
        try:
            assert client.wait_for_service(10.0), f'there is no service {client.srv_name}'
            answer = client.call_async(Trigger.Request())
            assert poll(answer.done, 10.0), f'{client.srv_name} does not answer'
            return answer.result()
        finally:
            self._node.destroy_client(client)

    def first(
            self, condition: Callable[[SentVelocity], bool], after: int,
            timeout: float) -> SentVelocity | None:
        """
        Wait for a velocity.

        :param timeout: how long to wait [s]
        :returns: the first that meets the condition; None if none came in time
        """
        return poll(lambda: next(filter(condition, self.received[after:]), None), timeout)

    def wait_for(
            self, condition: Callable[[SentVelocity], bool], timeout: float = 20.0,
            after: int = 0) -> SentVelocity:
        """Return the first velocity that meets a condition; fail if none comes in time."""
        velocity = self.first(condition, after, timeout)
        assert velocity is not None, f'no such velocity within {timeout} s, but {self.held()}'
        return velocity

    def held(self) -> list[HeldVelocity]:
        """Return runs of equal velocities, each held until the next velocity."""
        runs: list[list[SentVelocity]] = []
        for velocity in self.received:
            if runs and same(runs[-1][0], velocity):
                runs[-1].append(velocity)
            else:
                runs.append([velocity])
        ends = [run[0].time for run in runs[1:]] + [runs[-1][-1].time] if runs else []
        return [HeldVelocity(run[0].linear_x, run[0].angular_z, end - run[0].time, len(run))
                for run, end in zip(runs, ends)]

    def moves(self) -> list[HeldVelocity]:
        """Return the runs of velocities other than zero."""
        return [held for held in self.held() if held.linear_x or held.angular_z]

    @property
    def enabled(self) -> list[float]:
        """When manual control was granted [s, system clock]."""
        return [at for at, enabled in self.answered if enabled]

    @property
    def released(self) -> list[float]:
        """When manual control was released [s, system clock]."""
        return [at for at, enabled in self.answered if not enabled]

    def _on_velocity(self, message: Any, info: dict[str, int]) -> None:
        message = getattr(message, 'twist', message)
        self.received.append(SentVelocity(
            info['source_timestamp'] / 1e9, message.linear.x, message.angular.z))

    def _answer(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        time.sleep(self._delay)
        response.success, response.message = self._grants, '' if self._grants else self._reason
        self.answered.append((time.time(), request.data))
        return response


def same(one: SentVelocity, two: SentVelocity) -> bool:
    """Return whether two velocities are equal."""
    return (one.linear_x, one.angular_z) == (two.linear_x, two.angular_z)
