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
"""What serves a node in threads of its own until it is told to stop."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time
from typing import Any, Protocol

from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription

#: After a message, the thread that it was for is let go first [s].
COURTESY = 5e-5
FOREVER = -1


class Spinner(Protocol):
    """Serves something."""

    def run(self) -> None:
        """Serve until it is stopped."""

    def stop(self) -> None:
        """Make ``run`` return, or not begin; once, from any thread."""


class NodeSpinner:
    """Serves all that a node has, in rclpy's way, but for what an ``Ear`` has taken."""

    def __init__(self, node: Node) -> None:
        """
        Serve nothing yet.

        :param node: the node
        """
        self._over = threading.Event()
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def run(self) -> None:
        """Serve until it is stopped."""
        while not self._over.is_set():
            self._executor.spin_once()
        self._executor.shutdown()

    def stop(self) -> None:
        """Make ``run`` return, or not begin; once, from any thread."""
        # A task wakes the executor; shutting it down under way would pull away what it waits on.
        self._executor.create_task(self._over.set)


class Ear:
    """
    Serves one subscription and nothing else of its node, at a fraction of what an executor costs.

    It waits as ``rclpy.wait_for_message`` does, again and again.
    """

    def __init__(
            self, node: Node, subscription: Subscription, hear: Callable[[Any], None]) -> None:
        """
        Hear nothing yet.

        :param node: the node
        :param subscription: its subscription, in a callback group of its own
        :param hear: called with each message, the oldest first
        """
        self._context = node.context
        self._subscription = subscription
        self._hear = hear
        self._over = threading.Event()
        group = subscription.callback_group
        # The node destroys it, but only after ``run``, which holds it.
        self._wake = node.create_guard_condition(lambda: None, callback_group=group)
        # At work on it for ever: so no executor serves the group or waits for it.  Its events
        # neither: to wait for them, DDS wakes the executor at each message.  They would tell of
        # a quality of service that does not fit; with best effort, any fits.
        group.beginning_execution(subscription)

    def run(self) -> None:
        """Hear until it is stopped."""
        heard, wake, context = self._subscription.handle, self._wake.handle, self._context.handle
        assert context is not None, 'ROS is running'
        with heard, wake, context:
            wait_set = rclpy_implementation.WaitSet(1, 1, 0, 0, 0, 0, context)
            while not self._over.is_set():
                wait_set.clear_entities()
                wait_set.add_subscription(heard)
                wait_set.add_guard_condition(wake)
                wait_set.wait(FOREVER)
                self._empty()
                time.sleep(COURTESY)

    def stop(self) -> None:
        """Make ``run`` return, or not begin; once, from any thread."""
        self._over.set()
        self._wake.trigger()

    def _empty(self) -> None:
        take, kind = self._subscription.handle.take_message, self._subscription.msg_type
        # A publisher that is quicker than this must not keep it from its end.
        while not self._over.is_set() and (taken := take(kind, False)) is not None:
            self._hear(taken[0])
