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
"""The executor of a node in the background, and a hook before a context is shut down."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import sys
import threading
import time
from types import FrameType
from typing import Any

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

#: How long the thread of an executor may take to end [s].
THREAD_EXIT_TIMEOUT = 2.0
#: Pause after a callback has failed [s]: the next one may fail as well.
PAUSE_AFTER_ERROR = 0.02


class BackgroundExecutor:
    """
    Spins a node in one background thread, unless it is in another executor.

    The thread is started at once: from Python 3.12 on none can be started after the main thread
    has ended, while another thread may still drive.  It has to be stopped before the program ends:
    a thread that spins while the interpreter is finalized aborts it.

    :param node: the node whose callbacks are served
    :param on_error: called in the background thread with what a callback raised
    """

    def __init__(self, node: Node, on_error: Callable[[BaseException], None]) -> None:
        self._node = node
        self._on_error = on_error
        self._executor = SingleThreadedExecutor(context=node.context)
        self._thread = threading.Thread(target=self._run, name='executor', daemon=True)
        self._thread.start()

    def ensure_spinning(self, take_over: bool = False) -> None:
        """
        Add the node to this executor if it is in none.

        :param take_over: add it even if it is in another executor
        """
        if take_over or not self._has_executor():
            self._executor.add_node(self._node)

    def is_executor_thread(self) -> bool:
        """
        Return whether the calling thread is in a callback of the node's executor.

        To wait there for another callback would never end.
        """
        if threading.current_thread() is self._thread:
            return True
        is_elsewhere = self._has_executor() and self._node.executor is not self._executor
        return is_elsewhere and any(True for _ in _executor_frames(sys._getframe()))

    def stop(self) -> None:
        """Stop spinning, and join the thread."""
        self._executor.shutdown(timeout_sec=0.0)
        if threading.current_thread() is not self._thread:
            self._thread.join(THREAD_EXIT_TIMEOUT)

    def _has_executor(self) -> bool:
        # A node keeps its reference to an executor that has removed it.
        executor = self._node.executor
        return executor is not None and self._node in executor.get_nodes()

    def _run(self) -> None:
        while (error := self._spin()) is not None:
            # It goes on: the response to the release of manual control has to be received.
            self._on_error(error)
            time.sleep(PAUSE_AFTER_ERROR)

    def _spin(self) -> BaseException | None:
        """Spin until the executor is shut down, or a callback raises what is returned."""
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return None
        except BaseException as error:
            return error
        return None


def wake_main_thread() -> None:
    """
    Wake the executor that the main thread waits in, if it does.

    Python runs signal handlers in its main thread, between bytecodes; a wait in C++ delays them.
    """
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


def before_shutdown(context: Context, callback: Callable[[], None]) -> None:
    """
    Call a function before a context is shut down, in the thread that shuts it down.

    ``Context.on_shutdown`` of rclpy calls back afterwards, when nothing can be published any more
    (ros2/rclpy issue 1077), so the two methods that shut down are wrapped.

    :param context: the context, as ``rclpy.shutdown`` will find it
    :param callback: may be called more than once
    """
    for name in ('shutdown', 'try_shutdown'):
        setattr(context, name, _preceded(getattr(context, name), callback))


def _preceded(function: Callable[..., Any], callback: Callable[[], None]) -> Callable[..., Any]:
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        callback()
        return function(*args, **kwargs)
    return wrapped
