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
Run the callbacks of nodes, and call a function before a ROS context is shut down.

Tested by test/kachaka/test_bridge_executors.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
import contextlib
import sys
import threading
import time
from types import FrameType
from typing import Any, Protocol
from weakref import WeakKeyDictionary

from rclpy.context import Context
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription

#: How long the thread of an executor may take to end [s].
THREAD_EXIT_TIMEOUT = 2.0
#: Pause after a callback has failed [s]: the next callback may fail as well.
PAUSE_AFTER_ERROR = 0.02


class BackgroundExecutor:
    """
    Runs the callbacks of a node in a background thread, unless another executor runs them.

    ``ensure_spinning`` lets them run.  Call ``stop`` before the program ends: the interpreter
    aborts at its end if the thread still runs callbacks.

    :param on_error: called in the thread with what a callback has raised
    """

    def __init__(self, node: Node, on_error: Callable[[BaseException], None]) -> None:
        self._node = node
        self._on_error = on_error
        self._executor = SingleThreadedExecutor(context=node.context)
        self._thread = threading.Thread(target=self._run, name='executor', daemon=True)
        # Started here, because since Python 3.12 no thread can start after the main thread has
        # ended, and another thread can still be driving the robot then.
        self._thread.start()

    def ensure_spinning(self, take_over: bool = False) -> None:
        """
        Make this executor run the callbacks of its node, unless another executor runs them.

        :param take_over: whether to take the node from another executor
        """
        if take_over or not self._has_executor():
            self._executor.add_node(self._node)

    def is_executor_thread(self) -> bool:
        """
        Return whether the calling thread is the only one that runs callbacks of the node.

        Then it must not wait for another callback of the node: it would wait forever.
        """
        if threading.current_thread() is self._thread:
            return True
        executor = self._node.executor
        is_elsewhere = self._has_executor() and executor is not self._executor
        return is_elsewhere and executor is not None and not _has_threads(executor) and any(
            True for _ in _executor_frames(sys._getframe()))

    def stop(self) -> None:
        """End the thread; wait for it at most 2 s, and not in the thread itself."""
        self._executor.shutdown(timeout_sec=0.0)
        if threading.current_thread() is not self._thread:
            self._thread.join(THREAD_EXIT_TIMEOUT)

    def _has_executor(self) -> bool:
        # After an executor has removed a node, the node still has a reference to the executor.
        executor = self._node.executor
        return executor is not None and self._node in executor.get_nodes()

    def _run(self) -> None:
        # After an error go on: the response to the release of manual control must still come.
        spin_until_stopped(self._executor.spin, self._on_error)


def spin_until_stopped(
        spin: Callable[[], None], on_error: Callable[[BaseException], None]) -> None:
    """
    Run callbacks, also after errors, until ``spin`` returns or the context is shut down.

    :param spin: runs callbacks, like that of an rclpy executor; called again after each error
    :param on_error: called with each exception that a callback has raised
    """
    while (error := _error_of(spin)) is not None:
        on_error(error)
        time.sleep(PAUSE_AFTER_ERROR)


def _error_of(function: Callable[[], None]) -> BaseException | None:
    """Call a function, and return what it raises; None for ExternalShutdownException, too."""
    try:
        function()
    except ExternalShutdownException:
        return None
    except BaseException as error:
        return error
    return None


def _has_threads(executor: Executor) -> bool:
    """Return whether an executor runs callbacks in more than one thread."""
    pool = getattr(executor, '_executor', None)  # nothing public tells
    return isinstance(executor, MultiThreadedExecutor) and getattr(pool, '_max_workers', 1) > 1


def wake_main_thread() -> None:
    """Wake the main thread if it waits in the C++ code of an executor, to run signal handlers."""
    for frame in _executor_frames(sys._current_frames().get(threading.main_thread().ident or 0)):
        executor = frame.f_locals.get('self')
        if isinstance(executor, Executor):
            executor.wake()
            return


def _executor_frames(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        if frame.f_globals.get('__name__') == Executor.__module__:
            yield frame
        frame = frame.f_back


#: What is to be called before each context shuts down.
_before_shutdown: WeakKeyDictionary[Context, list[Callable[[], None]]] = WeakKeyDictionary()


def before_shutdown(context: Context, callback: Callable[[], None]) -> Callable[[], None]:
    """
    Make a ROS context call a function before it is shut down.

    ``shutdown`` and ``try_shutdown`` of the context are replaced, once: ``Context.on_shutdown``
    calls back when publishing is no longer possible (ros2/rclpy issue 1077).

    :param callback: called in the thread of each such call; the newest one first
    :returns: a function that takes it back
    """
    if context not in _before_shutdown:
        for name in ('shutdown', 'try_shutdown'):
            setattr(context, name, _preceded(getattr(context, name), context))
    callbacks = _before_shutdown.setdefault(context, [])
    callbacks.append(callback)

    def remove() -> None:
        with contextlib.suppress(ValueError):
            callbacks.remove(callback)
    return remove


def _preceded(function: Callable[..., Any], context: Context) -> Callable[..., Any]:
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        for callback in reversed([*_before_shutdown[context]]):
            callback()
        return function(*args, **kwargs)
    return wrapped


#: The pause after a message [s]: it lets the thread that handles the message run first.
YIELD_TIME = 5e-5
#: No message waits longer for its thread [s].
MAX_AGE = 1.0
#: The timeout value for a wait set that waits without a limit.
WAIT_FOREVER = -1


class NodeExecutor:
    """Runs the callbacks of a node, except those of a ``SubscriptionExecutor``."""

    def __init__(self, node: Node) -> None:
        self._stopped = threading.Event()
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def run(self) -> None:
        """Run the callbacks of the node in the calling thread, until ``stop`` is called."""
        while not self._stopped.is_set():
            self._executor.spin_once()
        self._executor.shutdown()

    def stop(self) -> None:
        """End ``run``, also a later one; call this once, from any thread."""
        # A task wakes the executor.  A shutdown here would destroy the objects it waits for.
        self._executor.create_task(self._stopped.set)


class SubscriptionExecutor:
    """
    Receives the messages of subscriptions, with much less CPU time than an rclpy executor.

    It waits in a loop, like ``rclpy.wait_for_message()``.

    :param subscription: in a callback group of its own, which no other executor serves
    :param on_message: called with each message, the oldest first
    :param timed: whether it is also called with the time of arrival [s on the steady clock]
    """

    def __init__(
            self, node: Node, subscription: Subscription, on_message: Callable[..., None],
            raw: bool = False, timed: bool = False) -> None:
        self._context = node.context
        self._subscriptions = [(subscription, on_message)]
        self._raw = raw
        self._timed = timed
        self._stopped = threading.Event()
        group = subscription.callback_group
        # The node destroys the guard condition, but only after run(), which holds a reference.
        self._guard_condition = node.create_guard_condition(lambda: None, callback_group=group)
        # Mark the group as busy, so that no executor waits for it.  The QoS events of the
        # subscription belong to the group: if an executor waited for them, DDS would wake it at
        # each message.  The events report incompatible QoS; best effort is compatible with every
        # publisher.
        group.beginning_execution(subscription)

    def add(self, subscription: Subscription, on_message: Callable[..., None]) -> None:
        """Add a subscription in the same callback group, before ``run``."""
        self._subscriptions.append((subscription, on_message))

    def run(self) -> None:
        """
        Receive messages in the calling thread, until ``stop`` is called.

        :raises ExternalShutdownException: if the ROS context was shut down
        """
        try:
            self._run()
        except Exception:
            if self._context.ok():
                raise
            raise ExternalShutdownException from None

    def stop(self) -> None:
        """End ``run``, also a later one; call this once, from any thread."""
        self._stopped.set()
        self._guard_condition.trigger()

    def _run(self) -> None:
        guard_condition, context = self._guard_condition.handle, self._context.handle
        assert context is not None, 'ROS is running'
        handles = [subscription.handle for subscription, _ in self._subscriptions]
        with contextlib.ExitStack() as used:
            for handle in (*handles, guard_condition, context):
                used.enter_context(handle)
            wait_set = rclpy_implementation.WaitSet(len(handles), 1, 0, 0, 0, 0, context)
            while not self._stopped.is_set():
                wait_set.clear_entities()
                for handle in handles:
                    wait_set.add_subscription(handle)
                wait_set.add_guard_condition(guard_condition)
                wait_set.wait(WAIT_FOREVER)
                ready = wait_set.get_ready_entities('subscription')
                for subscription, on_message in self._subscriptions:
                    if subscription.handle.pointer in ready:
                        self._take_all(subscription, on_message)
                time.sleep(YIELD_TIME)

    def _take_all(self, subscription: Subscription, on_message: Callable[..., None]) -> None:
        take, kind = subscription.handle.take_message, subscription.msg_type
        # A publisher faster than this loop must not prevent the end of the loop.
        while not self._stopped.is_set() and (taken := take(kind, self._raw)) is not None:
            if self._timed:
                on_message(taken[0], _arrival(taken[1]))
            else:
                on_message(taken[0])


def _arrival(info: Mapping[str, Any]) -> float:
    """Return when the middleware received a message [s on the steady clock]."""
    age = (time.time_ns() - info['received_timestamp']) * 1e-9
    # Not every middleware has this time.  If the system clock was set meanwhile, it says nothing.
    return time.monotonic() - (age if 0.0 < age < MAX_AGE else 0.0)


class PeriodicLoop:
    """
    Calls a function once in each period of the steady clock; a call that is missed is left out.

    A timer of rclpy costs more: its executor builds a wait set of all that the node has each time.

    :param period: [s]
    """

    def __init__(self, period: float, function: Callable[[], None]) -> None:
        self._period = period
        self._function = function
        self._stopped = threading.Event()

    def run(self) -> None:
        """Call the function in the calling thread, at once and until ``stop`` is called."""
        due = time.monotonic()
        while not self._stopped.wait(max(0.0, due - time.monotonic())):
            self._function()
            due = max(due + self._period, time.monotonic())

    def stop(self) -> None:
        """End ``run``, also a later one; any thread may call this."""
        self._stopped.set()


class ExecutorLoop(Protocol):
    """What works in the thread that calls ``run()``, until ``stop()``: one of the above."""

    def run(self) -> None:
        """Work in the calling thread, until ``stop`` is called."""

    def stop(self) -> None:
        """End ``run``, also a later one; call this once, from any thread."""


@contextlib.contextmanager
def running(
        loop: ExecutorLoop, on_end: Callable[[], object] = lambda: None) -> Iterator[None]:
    """
    Run a loop in a thread during a ``with`` block; raise what it has raised at its end.

    :param on_end: called when the loop has ended, also if it has raised an error
    """
    with ThreadPoolExecutor(max_workers=1) as threads:
        future = threads.submit(loop.run)
        future.add_done_callback(lambda _: on_end())
        try:
            yield
        finally:
            loop.stop()
        future.result()
