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
"""The topics on which a node shows what it does: paths, commanded velocity, diagnostics."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.control.events import (
    Event,
    EventHandler,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SpeedFactorChanged,
)
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.ros.debug_topics import (
    CommandedVelocityPublisher,
    DiagnosticsPublisher,
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
from kachaka_simple_control.ros.session_status import diagnose, StatusReader
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.telemetry.diagnosis import Diagnosis
from kachaka_simple_control.telemetry.event_bus import EventBus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher

if TYPE_CHECKING:
    from kachaka_simple_control.ros.path_topics import PlannedPathPublisher

#: How often a diagnosis is made [s].
DIAGNOSTICS_PERIOD = 1.0

#: Takes a frame or an event.
Handler = Callable[[Any], None]


class IntrospectionPublishers:
    """
    The topics on which a node shows what it does.

    If one fails, that is logged once and it publishes nothing from then on; the drive goes on.

    :param velocities: the publisher that moves the robot
    :raises UsageError: if a topic is remapped to where it would move the robot
    """

    def __init__(self, node: Node, velocities: VelocityPublisher, profile: RobotProfile) -> None:
        self._node = node
        self._status_reader: StatusReader | None = None
        self._thread = PublisherThread(lambda: self._is_open, self._log_error)
        self._failed: set[str] = set()
        self._on_frame: list[Handler] = []
        #: by type of event; called only while the session is open
        self._on_event: dict[type, list[Handler]] = {}
        #: called with all events, at any time: they return at once
        self._always: list[EventHandler] = [self._failing_once(
            COMMANDED_VELOCITY, CommandedVelocityPublisher(
                node, velocities, self._thread, profile.frame).on_sent)]
        self._speed_factor = SpeedFactorPublisher(node, velocities, self._thread)
        self._on_event[SpeedFactorChanged] = [self._failing_once(
            SPEED_FACTOR, lambda event: self._speed_factor.publish(event.product))]
        self._add_paths(velocities)
        self._add_diagnostics(velocities, profile.name)

    def attach(self, event_bus: EventBus, status_reader: StatusReader) -> None:
        """Publish what happens from now on."""
        self._status_reader = status_reader
        for handler in (*self._always, self._handle):
            event_bus.subscribe(handler)
        self._speed_factor.publish(1.0)

    def set_frame(self, frame: str) -> None:
        """Use the frame that odometry is in."""
        for handler in self._on_frame:
            handler(frame)

    def close(self) -> None:
        """Publish nothing more."""
        self._thread.close()

    @property
    def _is_open(self) -> bool:
        return self._status_reader is not None and not self._status_reader.is_closed

    def _handle(self, event: Event) -> None:
        handlers = self._on_event.get(type(event))
        if handlers and self._is_open:
            for handler in handlers:
                handler(event)

    def _add_paths(self, velocities: VelocityPublisher) -> None:
        # Optional: without nav_msgs a drive works, and only shows less of itself.
        try:
            from kachaka_simple_control.ros.path_topics import (
                DrivenPathPublisher,
                PlannedPathPublisher,
            )
        except ImportError:
            return
        planned = PlannedPathPublisher(self._node, velocities, self._thread)
        driven = DrivenPathPublisher(self._node, velocities, self._thread)
        self._on_event[MotionPlanned] = [
            self._failing_once(PLANNED_PATH, lambda _: self._publish_plan(planned))]
        self._on_frame += [self._failing_once(PLANNED_PATH, planned.set_frame),
                           self._failing_once(DRIVEN_PATH, driven.set_frame)]
        self._on_event[MotionStarted] = [
            self._failing_once(PLANNED_PATH, planned.on_motion_started)]
        self._on_event[OdometryReceived] = [self._failing_once(PLANNED_PATH, planned.on_odometry),
                                            self._failing_once(DRIVEN_PATH, driven.on_odometry)]

    def _publish_plan(self, publisher: PlannedPathPublisher) -> None:
        plan = None if self._status_reader is None else self._status_reader.progress.plan
        if plan is not None:
            publisher.on_plan(plan)

    def _add_diagnostics(self, velocities: VelocityPublisher, robot: str) -> None:
        # Optional, as for the paths.
        try:
            diagnostics = DiagnosticsPublisher(
                self._node, velocities, self._thread, robot, self._diagnose)
        except ImportError:
            return
        # A timer would otherwise follow /clock, which may stand still while the robot drives.
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
        """Return a handler that logs its first error, and does nothing from then on."""
        has_failed = False

        def guarded(argument: Any = None) -> None:
            nonlocal has_failed
            if has_failed:
                return
            try:
                handler(argument)
            except Exception as error:  # whatever it is, it must not end the drive
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
