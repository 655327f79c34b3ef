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
"""All that a node shows of itself to the tools people have; none of it in the way of a drive."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.audience.audience import Audience, Hearer
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.report.events import Answered, Began, Event
from kachaka_simple_control.robot.robot_profile import RobotProfile
from kachaka_simple_control.ros.aside import Aside
from kachaka_simple_control.ros.condition import Condition, condition
from kachaka_simple_control.ros.echo import Echo, TOPIC
from kachaka_simple_control.ros.standing import Lookout
from kachaka_simple_control.ros.tally import Tally
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher

if TYPE_CHECKING:
    from kachaka_simple_control.ros.diagnostics import Diagnostics

#: How often a diagnosis is made [s].
PERIOD = 1.0

Show = Callable[[Any], None]


class Showing:
    """
    The topics beside the velocities: paths, commanded velocity, diagnostics.

    Whatever fails in it is told once and left away from then on; the drive goes on.
    """

    def __init__(self, node: Node, velocities: VelocityPublisher, profile: RobotProfile) -> None:
        """
        Publish nothing yet.

        :param node: whose topics they are
        :param velocities: the publisher that moves the robot
        :param profile: the kind of robot
        :raises UsageError: if a topic is remapped to where it would move the robot
        """
        self._node = node
        self._tally = Tally()
        self._lookout: Lookout | None = None
        self._aside = Aside(lambda: self._is_open)
        self._aside.on_error = self._could_not
        self._failed: set[str] = set()
        self._plans: list[Show] = []
        self._frames: list[Show] = []
        self._events: dict[type, list[Show]] = {}
        #: told everything, at any time: quick, and careful on their own
        self._hearers: list[Hearer] = [
            self._safe(TOPIC, Echo(node, velocities, self._aside, profile.frame).hear)]
        self._show_paths(velocities)
        self._show_diagnostics(velocities, profile.name)

    def follow(self, audience: Audience, lookout: Lookout) -> None:
        """
        Show what happens from now on.

        :param audience: tells it
        :param lookout: looks at the session with the robot
        """
        self._lookout = lookout
        for hearer in (*self._hearers, self._hear):
            audience.join(hearer)

    def expect(self, plan: Plan) -> None:
        """
        Show a plan that is driven next.

        :param plan: the plan
        """
        for show in self._plans:
            show(plan)

    def in_frame(self, frame: str) -> None:
        """
        Take note of the frame that odometry is in.

        :param frame: its name
        """
        for show in self._frames:
            show(frame)

    def close(self) -> None:
        """Publish nothing more."""
        self._aside.close()

    @property
    def _is_open(self) -> bool:
        return self._lookout is not None and not self._lookout.is_closed

    def _hear(self, event: Event) -> None:
        shows = self._events.get(type(event))
        if shows and self._is_open:
            for show in shows:
                show(event)

    def _show_paths(self, velocities: VelocityPublisher) -> None:
        # Imported here: a drive needs no nav_msgs, it only shows less of itself.
        try:
            from kachaka_simple_control.ros.paths import (
                DRIVEN,
                DrivenPathTopic,
                PLANNED,
                PlannedPathTopic,
            )
        except ImportError:
            return
        planned = PlannedPathTopic(self._node, velocities, self._aside)
        driven = DrivenPathTopic(self._node, velocities, self._aside)
        self._plans.append(self._safe(PLANNED, planned.expect))
        self._frames += [
            self._safe(PLANNED, planned.in_frame), self._safe(DRIVEN, driven.in_frame)]
        self._events[Began] = [self._safe(PLANNED, planned.begin)]
        self._events[Answered] = [
            self._safe(PLANNED, planned.hear), self._safe(DRIVEN, driven.hear)]

    def _show_diagnostics(self, velocities: VelocityPublisher, robot: str) -> None:
        try:
            from kachaka_simple_control.ros.diagnostics import Diagnostics
        except ImportError:
            return
        diagnostics = Diagnostics(
            self._node, velocities, self._aside, robot, self._condition)
        self._plans.append(self._tally.expect)
        self._hearers.append(self._tally.hear)
        # A timer would otherwise follow /clock, which may stand still while the robot drives.
        self._timer = self._node.create_timer(
            PERIOD, self._safe('/diagnostics', lambda _: self._diagnose(diagnostics)),
            clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _diagnose(self, diagnostics: Diagnostics) -> None:
        self._tally.count()
        diagnostics.publish()

    def _condition(self) -> Condition | None:
        if self._lookout is None or self._lookout.is_closed:
            return None
        now = time.monotonic()
        return condition(self._tally, self._lookout.look(now), now)

    def _safe(self, name: str, show: Show) -> Show:
        """Return what shows something, but fails only once and ends nothing."""
        has_failed = False

        def guarded(what: Any = None) -> None:
            nonlocal has_failed
            if has_failed:
                return
            try:
                show(what)
            except Exception as error:  # whatever it is, the robot comes first
                has_failed = True
                self._node.get_logger().warning(
                    f'{name} is shown no more: {type(error).__name__}: {error}')
        return guarded

    def _could_not(self, publisher: Publisher, error: Exception) -> None:
        name = str(publisher.topic_name)
        if self._is_open and name not in self._failed:
            self._failed.add(name)
            self._node.get_logger().warning(
                f'{name} could not be shown: {type(error).__name__}: {error}')
