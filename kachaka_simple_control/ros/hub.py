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
"""The threads, the graph and the events of a node.  Tested by test/ros/test_robot.py."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import threading

from kachaka_simple_control.control.stop import LateStops
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.ros.executors import BackgroundExecutor
from kachaka_simple_control.ros.graph import Graph
from kachaka_simple_control.ros.odometry import OdometryThread, Reader
from kachaka_simple_control.telemetry.event_bus import EventBus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node


class Hub:
    """
    Has the threads, the graph and the events that all robots of a node use.

    :ivar on_error: called, in any thread, with what a callback has raised
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.event_bus = EventBus(node.get_logger().warning)
        self.graph = Graph(node)
        self.on_error: Callable[[BaseException], None] = lambda _: None
        self.executor = BackgroundExecutor(node, self._report)
        self.late_stops = LateStops()
        #: that of the subscriptions to odometry
        self.odometry_group = MutuallyExclusiveCallbackGroup()
        self._odometry: OdometryThread | None = None
        #: why no robot may move again: the first reason given; None while they may move
        self.stopped_by: ControlError | None = None
        self._is_stopped = threading.Event()

    def logger(self, robot: str) -> RcutilsLogger:
        """Return what logs for a robot, with its name in each line; empty: for the node."""
        logger: RcutilsLogger = self.node.get_logger()
        if robot:
            logger = logger.get_child(robot)
        return logger

    def start_reading(self, readers: Sequence[Reader]) -> None:
        """Start to receive odometry and scans of all robots, if any has some; call this once."""
        if readers:
            self._odometry = OdometryThread(self.node, readers, self._report)

    def close(self) -> None:
        """End the threads, but not that of the events: the last ones are still passed on."""
        self.executor.stop()
        self.late_stops.close()
        if self._odometry is not None:
            self._odometry.stop()

    def stop_permanently(self, reason: ControlError) -> None:
        """Let no robot move again; for any thread."""
        self.stopped_by = self.stopped_by or reason
        self._is_stopped.set()

    def serve_until_stopped(self) -> None:
        """Run callbacks in the thread for them until no robot may move again."""
        self.executor.ensure_spinning()
        # Do not serve them in this thread: if a signal interrupts rclpy while it creates a message
        # for a callback, a TypeError is raised, and the node's callbacks stay blocked.
        self._is_stopped.wait()

    def _report(self, error: BaseException) -> None:
        self.on_error(error)
