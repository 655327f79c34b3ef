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
"""Stand where a robot stands, and note what is sent, when, and what is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import threading
import time

from geometry_msgs.msg import Twist
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_srvs.srv import SetBool, Trigger

#: Humble does not tell a callback when a message was sent; there the time of arrival must do.
KNOWS_SOURCE_TIME = hasattr(Subscription, 'CallbackType')

#: Best effort, as the bridge; but deeper than its 5, so that a busy machine loses nothing here.
QUALITY = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


@dataclass(frozen=True)
class Heard:
    """A velocity, and when it was sent [s, system clock]."""

    time: float
    linear_x: float
    angular_z: float

    @property
    def moves(self) -> bool:
        """Whether it asks for motion."""
        return self.linear_x != 0.0 or self.angular_z != 0.0


@dataclass(frozen=True)
class Held:
    """A velocity and how long it was held [s], in how many messages."""

    linear_x: float
    angular_z: float
    duration: float
    count: int


class Listener:
    """Subscribes as the official bridge does, and serves ``set_enabled``."""

    def __init__(
            self, namespace: str = 'kachaka', serves: bool = True, grants: bool = True,
            delay: float = 0.0, reason: str = 'not today',
            quality: QoSProfile = QUALITY) -> None:
        """
        Note nothing yet.

        :param namespace: where the robot is
        :param serves: whether there is a service at all
        :param grants: what the service answers
        :param delay: how long the service takes to answer [s]
        :param reason: what it says when it refuses
        :param quality: what the subscription asks for
        """
        self.heard: list[Heard] = []
        self.answered: list[tuple[float, bool]] = []
        self._grants, self._delay, self._reason = grants, delay, reason
        self._context = Context()
        self._context.init(args=[])
        self._node = Node(
            'listener', namespace=namespace, context=self._context,
            start_parameter_services=False)
        self._subscription = self._node.create_subscription(
            Twist, 'manual_control/cmd_vel',
            self._hear_with_info if KNOWS_SOURCE_TIME else self._hear, quality)
        if serves:
            self._node.create_service(SetBool, 'manual_control/set_enabled', self._answer)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def __enter__(self) -> Listener:
        """Listen."""
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Listen no more."""
        self._executor.shutdown(timeout_sec=0.0)
        self._thread.join(5.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def leave(self) -> None:
        """Say goodbye properly: the subscription goes away."""
        self._node.destroy_subscription(self._subscription)

    def call(self, name: str) -> Trigger.Response:
        """Call a service of the node under test; fail if it does not answer."""
        client = self._node.create_client(Trigger, f'/kachaka_simple_control/{name}')
        try:
            assert client.wait_for_service(10.0), f'there is no service {client.srv_name}'
            answer, end = client.call_async(Trigger.Request()), time.monotonic() + 10.0
            while not answer.done():
                assert time.monotonic() < end, f'{client.srv_name} does not answer'
                time.sleep(0.01)
            return answer.result()
        finally:
            self._node.destroy_client(client)

    def wait_for(
            self, condition: Callable[[Heard], bool], timeout: float = 20.0,
            after: int = 0) -> Heard:
        """Return the first velocity that fits, from a place on; fail if none comes in time."""
        end, seen = time.monotonic() + timeout, after
        while time.monotonic() < end:
            while seen < len(self.heard):
                if condition(self.heard[seen]):
                    return self.heard[seen]
                seen += 1
            time.sleep(0.002)
        raise AssertionError(f'no such velocity within {timeout} s')

    def held(self) -> list[Held]:
        """Fold equal velocities that follow each other, each held until the next."""
        runs: list[list[Heard]] = []
        for heard in self.heard:
            if runs and same(runs[-1][0], heard):
                runs[-1].append(heard)
            else:
                runs.append([heard])
        ends = [run[0].time for run in runs[1:]] + [runs[-1][-1].time] if runs else []
        return [Held(run[0].linear_x, run[0].angular_z, end - run[0].time, len(run))
                for run, end in zip(runs, ends)]

    def moves(self) -> list[Held]:
        """Return what was held, rests left out."""
        return [held for held in self.held() if held.linear_x or held.angular_z]

    @property
    def enabled(self) -> list[float]:
        """When manual control was granted [s, system clock]."""
        return [at for at, enabled in self.answered if enabled]

    @property
    def released(self) -> list[float]:
        """When manual control was taken back [s, system clock]."""
        return [at for at, enabled in self.answered if not enabled]

    def _hear(self, message: Twist) -> None:
        self.heard.append(Heard(time.time(), message.linear.x, message.angular.z))

    def _hear_with_info(self, message: Twist, info: dict[str, int]) -> None:
        self.heard.append(Heard(
            info['source_timestamp'] / 1e9, message.linear.x, message.angular.z))

    def _answer(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        time.sleep(self._delay)
        response.success, response.message = self._grants, '' if self._grants else self._reason
        self.answered.append((time.time(), request.data))
        return response

    def _spin(self) -> None:
        self._executor.spin()


def same(one: Heard, two: Heard) -> bool:
    """Tell whether two velocities are equal."""
    return (one.linear_x, one.angular_z) == (two.linear_x, two.angular_z)
