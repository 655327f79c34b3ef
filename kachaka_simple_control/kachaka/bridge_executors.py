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
"""The executors of a bridge: one for velocities, cheaper than rclpy's, one for all the rest."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time
from typing import Any, Protocol

from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription

#: Pause after a message [s]: the thread that it was for runs first.
YIELD_TIME = 5e-5
#: Timeout of a wait set without a timeout.
WAIT_FOREVER = -1


class ExecutorLoop(Protocol):
    """Serves callbacks in the thread that calls ``run``."""

    def run(self) -> None:
        """Serve until ``stop`` is called."""

    def stop(self) -> None:
        """Make ``run`` return, or not begin; to be called once, from any thread."""


class NodeExecutor:
    """An ``ExecutorLoop`` for a node, without what a ``SubscriptionExecutor`` serves."""

    def __init__(self, node: Node) -> None:
        self._stopped = threading.Event()
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def run(self) -> None:
        """Serve until ``stop`` is called."""
        while not self._stopped.is_set():
            self._executor.spin_once()
        self._executor.shutdown()

    def stop(self) -> None:
        """Make ``run`` return, or not begin; to be called once, from any thread."""
        # A task wakes the executor.  To shut it down here would destroy what it waits on.
        self._executor.create_task(self._stopped.set)


class SubscriptionExecutor:
    """
    An ``ExecutorLoop`` for one subscription, at a fraction of the cost of an executor.

    It waits as ``rclpy.wait_for_message`` does, in a loop.

    :param subscription: a subscription of the node, in a callback group of its own
    :param on_message: called with each message, the oldest first
    """

    def __init__(
            self, node: Node, subscription: Subscription, on_message: Callable[[Any], None],
    ) -> None:
        self._context = node.context
        self._subscription = subscription
        self._on_message = on_message
        self._stopped = threading.Event()
        group = subscription.callback_group
        # The node destroys it, but only after ``run``, which holds it.
        self._guard_condition = node.create_guard_condition(lambda: None, callback_group=group)
        # The group looks busy from now on, so no executor waits for it or serves it.  The events
        # of the subscription belong to it: while an executor waits for those, DDS wakes it at each
        # message.  They would report a quality of service that does not match; best effort
        # matches every publisher.
        group.beginning_execution(subscription)

    def run(self) -> None:
        """Serve until ``stop`` is called."""
        subscription, guard_condition = self._subscription.handle, self._guard_condition.handle
        context = self._context.handle
        assert context is not None, 'ROS is running'
        with subscription, guard_condition, context:
            wait_set = rclpy_implementation.WaitSet(1, 1, 0, 0, 0, 0, context)
            while not self._stopped.is_set():
                wait_set.clear_entities()
                wait_set.add_subscription(subscription)
                wait_set.add_guard_condition(guard_condition)
                wait_set.wait(WAIT_FOREVER)
                self._take_all()
                time.sleep(YIELD_TIME)

    def stop(self) -> None:
        """Make ``run`` return, or not begin; to be called once, from any thread."""
        self._stopped.set()
        self._guard_condition.trigger()

    def _take_all(self) -> None:
        take, kind = self._subscription.handle.take_message, self._subscription.msg_type
        # A publisher that is faster than this loop must not keep it from its end.
        while not self._stopped.is_set() and (taken := take(kind, False)) is not None:
            self._on_message(taken[0])
