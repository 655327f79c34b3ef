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
What a node does when a signal or an exception ends the program.

Tested by test/ros/test_stop.py.
"""

from __future__ import annotations

import signal

from kachaka_simple_control.errors import (
    MotionRefusedError,
    MotionRunningError,
    MotionStoppedError,
)
from kachaka_simple_control.ros.commander import Commander
from kachaka_simple_control.ros.executors import wake_main_thread
from rclpy.node import Node


class NodeSignalHandler:
    """Stops the robot of a node when a signal or an exception ends the program."""

    def __init__(self, node: Node, commander: Commander) -> None:
        self._node, self._commander = node, commander
        self._guard_condition = node.create_guard_condition(lambda: None)

    def on_signal(self, signum: int) -> None:
        """Stop the robot at once, and refuse all later motions; called in a separate thread."""
        name = signal.Signals(signum).name
        self._commander.stop_permanently(MotionStoppedError(f'stopped by {name}'))

    def wake(self) -> None:
        """
        Wake the main thread if it waits in an executor of rclpy.

        Python runs its signal handlers only in the main thread, and only if that thread does not
        wait in C++ code.
        """
        self._guard_condition.trigger()
        wake_main_thread()

    def uncaught(self, error: BaseException) -> None:
        """
        Stop the robot after an uncaught exception, and refuse all later motions.

        The robot must be stopped, because another thread can still be driving it.  After a
        ``MotionRunningError``, the robot is not stopped: this error means that a motion of another
        thread must continue.
        """
        if isinstance(error, MotionRunningError):
            return
        if isinstance(error, KeyboardInterrupt):
            self._node.get_logger().info('Program was interrupted')
        self._commander.stop_permanently(
            MotionRefusedError(f'the program ended by {error!r}'))
