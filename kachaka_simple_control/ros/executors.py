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
"""Executors in threads of their own, and a hook before a context is shut down."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import sys
import threading
import time
from types import FrameType
from typing import Any, Protocol

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription

#: How long the thread may take to end [s].
THREAD_EXIT_TIMEOUT = 2.0
#: How long it pauses after a callback has failed [s]: the next may fail as well.
PAUSE_AFTER_ERROR = 0.02


class BackgroundExecutor:
    """
    Spins a node in one background thread, unless somebody else does.

    The thread is there from the beginning, for from Python 3.12 on none can be started any more
    once the main thread has ended, while another may still drive.  It is joined before the program
    ends: a thread that still spins while Python is taken down aborts it.
    """

    def __init__(self, node: Node, on_error: Callable[[BaseException], None]) -> None:
        """
        Make a spinner that serves nobody yet.

        :param node: whose callbacks are served
        :param on_error: called, in the background thread, with what a callback raised
        """
        self._node = node
        self._on_error = on_error
        self._executor = SingleThreadedExecutor(context=node.context)
        self._thread = threading.Thread(target=self._spin, name='spinner', daemon=True)
        self._thread.start()

    def ensure_spinning(self, take_over: bool = False) -> None:
        """
        See to it that the node's callbacks are served.

        :param take_over: serve them here even if the node is in somebody else's executor
        """
        if take_over or not self._is_served():
            self._executor.add_node(self._node)

    def is_executor_thread(self) -> bool:
        """
        Tell whether the calling thread is the one that serves the node's callbacks.

        :returns: true inside a callback of this node's executor: who waits there for another
            callback waits for ever
        """
        if threading.current_thread() is self._thread:
            return True
        return self._is_served() and not self._is_ours() and _inside_executor()

    def stop(self) -> None:
        """Spin no more, and return when the thread has ended."""
        self._executor.shutdown(timeout_sec=0.0)
        if threading.current_thread() is not self._thread:
            self._thread.join(THREAD_EXIT_TIMEOUT)

    def _is_ours(self) -> bool:
        return self._node.executor is self._executor

    def _is_served(self) -> bool:
        # A node keeps its reference to an executor that has removed it.
        executor = self._node.executor
        return executor is not None and self._node in executor.get_nodes()

    def _spin(self) -> None:
        while (error := _failure(self._executor)) is not None:
            # Then it goes on: the answer to giving the robot back needs to be heard, too.
            self._on_error(error)
            time.sleep(PAUSE_AFTER_ERROR)


def _failure(executor: SingleThreadedExecutor) -> BaseException | None:
    """Spin until the executor ends, or a callback raises what is returned."""
    try:
        executor.spin()
    except ExternalShutdownException:
        return None
    except BaseException as error:
        return error
    return None


def wake_main_thread() -> None:
    """
    Make a main thread that waits in an executor return to Python for a moment.

    Python runs signal handlers in its main thread, and only there; a wait in C++ keeps it away.
    """
    for frame in _executor_frames(sys._current_frames().get(threading.main_thread().ident or 0)):
        executor = frame.f_locals.get('self')
        if isinstance(executor, Executor):
            executor.wake()
            return


def _inside_executor() -> bool:
    return any(True for _ in _executor_frames(sys._getframe()))


def _executor_frames(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        if frame.f_globals.get('__name__') == Executor.__module__:
            yield frame
        frame = frame.f_back


#: After a message, the thread that it was for is let go first [s].
YIELD_TIME = 5e-5
FOREVER = -1


class ExecutorLoop(Protocol):
    """Serves something."""

    def run(self) -> None:
        """Serve until it is stopped."""

    def stop(self) -> None:
        """Make ``run`` return, or not begin; once, from any thread."""


class NodeExecutor:
    """Serves a node in rclpy's way, without what a ``SubscriptionExecutor`` has taken."""

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


class SubscriptionExecutor:
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
                time.sleep(YIELD_TIME)

    def stop(self) -> None:
        """Make ``run`` return, or not begin; once, from any thread."""
        self._over.set()
        self._wake.trigger()

    def _empty(self) -> None:
        take, kind = self._subscription.handle.take_message, self._subscription.msg_type
        # A publisher that is quicker than this must not keep it from its end.
        while not self._over.is_set() and (taken := take(kind, False)) is not None:
            self._hear(taken[0])


def before_shutdown(context: Context, callback: Callable[[], None]) -> None:
    """
    Call a function before a context is shut down, in the thread that shuts it down.

    rclpy's own ``Context.on_shutdown`` comes after the fact, when nothing can be published any
    more (ros2/rclpy issue 1077), so the context's two ways to shut down are wrapped.

    :param context: the context, as ``rclpy.shutdown`` will find it
    :param callback: what to call; it may be called more than once
    """
    for name in ('shutdown', 'try_shutdown'):
        setattr(context, name, _preceded(getattr(context, name), callback))


def _preceded(function: Callable[..., Any], callback: Callable[[], None]) -> Callable[..., Any]:
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        callback()
        return function(*args, **kwargs)
    return wrapped
