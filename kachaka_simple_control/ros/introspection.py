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
Publish the debug topics of a node: paths, sent velocities, speed factors and diagnostics.

Tested by test/ros/test_debug_topics.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import time
from typing import Any

from kachaka_simple_control.control.diagnosis import Diagnosis
from kachaka_simple_control.control.events import (
    Event,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SpeedFactorChanged,
    VelocitySent,
)
from kachaka_simple_control.ros.debug_topics import (
    CommandedVelocityPublisher,
    DiagnosticsPublisher,
    DrivenPathPublisher,
    PlannedPathPublisher,
    PublisherThread,
    SpeedFactorPublisher,
)
from kachaka_simple_control.ros.names import (
    COMMANDED_VELOCITY,
    DIAGNOSTICS,
    DRIVEN_PATH,
    of_robot,
    PLANNED_PATH,
    SPEED_FACTOR,
)
from kachaka_simple_control.ros.robot import Robot
from kachaka_simple_control.ros.robot_status import diagnose
from kachaka_simple_control.telemetry.event_bus import EventBus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher

#: Time between two diagnoses [s].
DIAGNOSTICS_PERIOD = 1.0

#: A function that is called with a frame or an event.
Handler = Callable[[Any], None]


class IntrospectionPublishers:
    """
    The publishers of all debug topics of a node, which show what its robots do.

    One that fails is logged once as a warning, and the drive continues.

    :raises UsageError: if a debug topic is remapped to that of a robot's velocities
    """

    def __init__(self, node: Node, robots: Sequence[Robot], event_bus: EventBus) -> None:
        self._node = node
        self._robots = robots
        self._thread = thread = PublisherThread(
            node, {str(robot.publisher.topic_name) for robot in robots},
            lambda: any(not robot.is_closed for robot in robots), self._log_error)
        self._failed: set[str] = set()
        for robot in robots:
            _RobotTopics(thread, robot, event_bus, self._failing_once)
        self._add_diagnostics()

    def close(self) -> None:
        """Send the debug messages that still wait in the queue, then stop publishing."""
        self._thread.close()

    def _add_diagnostics(self) -> None:
        # Optional, like the paths: diagnostic_msgs may be missing.
        try:
            diagnostics = DiagnosticsPublisher(self._thread, self._diagnose)
        except ImportError:
            return
        # With the default clock, the timer may follow /clock, and /clock may stop during a drive.
        self._timer = self._node.create_timer(
            DIAGNOSTICS_PERIOD,
            self._failing_once(DIAGNOSTICS, lambda _: diagnostics.publish()),
            clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _diagnose(self) -> dict[tuple[str, str], Diagnosis]:
        node, now = self._node.get_fully_qualified_name().lstrip('/'), time.monotonic()
        return {
            (f'{node}: {robot.name or "drive"}',
             f'{robot.settings.profile.name} on {robot.publisher.topic_name}'):
            diagnose(robot.status_reader.progress, robot.status_reader.read(now))
            for robot in self._robots if not robot.is_closed}

    def _failing_once(self, name: str, handler: Handler) -> Handler:
        """Return a function that calls a handler until its first error, which is logged."""
        has_failed = False

        def guarded(argument: Any = None) -> None:
            nonlocal has_failed
            if has_failed:
                return
            try:
                handler(argument)
            except Exception as error:  # any error: it must not end the drive
                has_failed = True
                self._node.get_logger().warning(
                    f'{name} is no longer published: {type(error).__name__}: {error}')
        return guarded

    def _log_error(self, publisher: Publisher, error: Exception) -> None:
        name = str(publisher.topic_name)
        if name not in self._failed and any(not robot.is_closed for robot in self._robots):
            self._failed.add(name)
            self._node.get_logger().warning(
                f'{name} could not be published: {type(error).__name__}: {error}')


class _RobotTopics:
    """The debug topics of one robot; the first message is a speed factor of 1."""

    def __init__(
            self, thread: PublisherThread, robot: Robot, event_bus: EventBus,
            failing_once: Callable[[str, Handler], Handler]) -> None:
        self._robot, self._failing_once = robot, failing_once
        #: the handlers by type of event; called only until the robot is released
        self._on_event: dict[type, list[Handler]] = {}
        commanded = CommandedVelocityPublisher(
            thread, of_robot(COMMANDED_VELOCITY, robot.name), robot.settings.profile.frame)
        factor = SpeedFactorPublisher(thread, of_robot(SPEED_FACTOR, robot.name))
        self._add(SpeedFactorChanged, SPEED_FACTOR, lambda event: factor.publish(event.product))
        self._add_paths(thread)
        event_bus.subscribe(
            failing_once(COMMANDED_VELOCITY, commanded.on_sent), kinds=(VelocitySent,),
            robot=robot.name, is_active=commanded.is_wanted)
        event_bus.subscribe(self._handle, kinds=self._on_event, robot=robot.name)
        factor.publish(1.0)

    def _add_paths(self, thread: PublisherThread) -> None:
        # Optional: without nav_msgs a drive works, but the path topics are not published.
        try:
            planned = PlannedPathPublisher(thread, of_robot(PLANNED_PATH, self._robot.name))
            driven = DrivenPathPublisher(thread, of_robot(DRIVEN_PATH, self._robot.name))
        except ImportError:
            return
        self._add(MotionPlanned, PLANNED_PATH, lambda event: planned.on_plan(event.plan))
        self._add(MotionStarted, PLANNED_PATH, planned.on_motion_started)
        self._add(OdometryReceived, PLANNED_PATH, planned.on_odometry)
        self._add(OdometryReceived, DRIVEN_PATH, driven.on_odometry)
        if self._robot.reader is not None:
            on_frame = [self._failing_once(PLANNED_PATH, planned.set_frame),
                        self._failing_once(DRIVEN_PATH, driven.set_frame)]
            self._robot.reader.on_frame = lambda frame: [set_to(frame) for set_to in on_frame]

    def _add(self, kind: type, topic: str, handler: Handler) -> None:
        self._on_event.setdefault(kind, []).append(self._failing_once(topic, handler))

    def _handle(self, event: Event) -> None:
        if not self._robot.is_closed:
            for handler in self._on_event.get(type(event), ()):
                handler(event)
