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
Publish the debug topics of a node: paths, sent velocities, speed factor and diagnostics.

Tested by test/ros/test_debug_topics.py.
"""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from kachaka_simple_control.control.diagnosis import Diagnosis
from kachaka_simple_control.control.events import (
    Event,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SpeedFactorChanged,
)
from kachaka_simple_control.files.robot_profile import RobotProfile
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
    PLANNED_PATH,
    SPEED_FACTOR,
)
from kachaka_simple_control.ros.robot_status import diagnose, StatusReader
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
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
    The publishers of all debug topics of a node, which show what the node does.

    One that fails is logged once as a warning, and the drive continues.

    :raises UsageError: if a debug topic is remapped to the topic of ``velocities``
    """

    def __init__(self, node: Node, velocities: VelocityPublisher, profile: RobotProfile) -> None:
        self._node = node
        self._status_reader: StatusReader | None = None
        self._thread = thread = PublisherThread(
            node, velocities, lambda: self._is_open, self._log_error)
        self._failed: set[str] = set()
        self._on_frame: list[Handler] = []
        #: the handlers by type of event; called only while the session is open
        self._on_event: dict[type, list[Handler]] = {}
        self._commanded = CommandedVelocityPublisher(thread, profile.frame)
        self._speed_factor = SpeedFactorPublisher(thread)
        self._on_event[SpeedFactorChanged] = [self._failing_once(
            SPEED_FACTOR, lambda event: self._speed_factor.publish(event.product))]
        self._add_paths()
        self._add_diagnostics(f'{profile.name} on {velocities.topic_name}')

    def attach(self, event_bus: EventBus, status_reader: StatusReader) -> None:
        """Start to publish the debug topics; the first message is a speed factor of 1."""
        self._status_reader = status_reader
        event_bus.subscribe(
            self._failing_once(COMMANDED_VELOCITY, self._commanded.on_sent),
            wants=self._commanded.wants)
        event_bus.subscribe(self._handle, wants=lambda event: type(event) in self._on_event)
        self._speed_factor.publish(1.0)

    def set_frame(self, frame: str) -> None:
        """Use the frame of odometry for the planned path and the driven path."""
        for handler in self._on_frame:
            handler(frame)

    def close(self) -> None:
        """Send the debug messages that still wait in the queue, then stop publishing."""
        self._thread.close()

    @property
    def _is_open(self) -> bool:
        return self._status_reader is not None and not self._status_reader.is_closed

    def _handle(self, event: Event) -> None:
        handlers = self._on_event.get(type(event))
        if handlers and self._is_open:
            for handler in handlers:
                handler(event)

    def _add_paths(self) -> None:
        # Optional: without nav_msgs a drive works, but the path topics are not published.
        try:
            planned = PlannedPathPublisher(self._thread)
            driven = DrivenPathPublisher(self._thread)
        except ImportError:
            return
        self._on_event[MotionPlanned] = [
            self._failing_once(PLANNED_PATH, lambda event: planned.on_plan(event.plan))]
        self._on_frame += [self._failing_once(PLANNED_PATH, planned.set_frame),
                           self._failing_once(DRIVEN_PATH, driven.set_frame)]
        self._on_event[MotionStarted] = [
            self._failing_once(PLANNED_PATH, planned.on_motion_started)]
        self._on_event[OdometryReceived] = [self._failing_once(PLANNED_PATH, planned.on_odometry),
                                            self._failing_once(DRIVEN_PATH, driven.on_odometry)]

    def _add_diagnostics(self, robot: str) -> None:
        # Optional, like the paths: diagnostic_msgs may be missing.
        try:
            diagnostics = DiagnosticsPublisher(self._thread, robot, self._diagnose)
        except ImportError:
            return
        # With the default clock, the timer may follow /clock, and /clock may stop during a drive.
        self._timer = self._node.create_timer(
            DIAGNOSTICS_PERIOD,
            self._failing_once(DIAGNOSTICS, lambda _: diagnostics.publish()),
            clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _diagnose(self) -> Diagnosis | None:
        if self._status_reader is None or self._status_reader.is_closed:
            return None
        return diagnose(
            self._status_reader.progress, self._status_reader.read(time.monotonic()))

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
        if self._is_open and name not in self._failed:
            self._failed.add(name)
            self._node.get_logger().warning(
                f'{name} could not be published: {type(error).__name__}: {error}')
