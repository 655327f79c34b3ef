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
"""Serve a node's callbacks while a motion runs in another thread."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import sys
import threading
import time
from types import FrameType

from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

#: How long the thread may take to end [s].
PATIENCE = 2.0
#: How long it pauses after a callback has failed [s]: the next may fail as well.
PAUSE = 0.02


class BackgroundSpinner:
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

    def ensure(self, take_over: bool = False) -> None:
        """
        See to it that the node's callbacks are served.

        :param take_over: serve them here even if the node is in somebody else's executor
        """
        if take_over or not self._is_served():
            self._executor.add_node(self._node)

    def blocks_here(self) -> bool:
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
            self._thread.join(PATIENCE)

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
            time.sleep(PAUSE)


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
