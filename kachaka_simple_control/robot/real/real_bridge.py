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
"""The node that shows a real robot to ROS 2 as the maker's own bridge does, and better."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from kachaka_simple_control.motion.kinematics import Velocity
from kachaka_simple_control.robot.bridge_node import BridgeNode
from kachaka_simple_control.robot.real import real_messages
from kachaka_simple_control.robot.real.address import Address
from kachaka_simple_control.robot.real.command import command
from kachaka_simple_control.robot.real.diagnosis import link_status, robot_status
from kachaka_simple_control.robot.real.error_texts import Level
from kachaka_simple_control.robot.real.meeting import Meeting
from kachaka_simple_control.robot.real.odometry_feed import Fetch, OdometryFeed
from kachaka_simple_control.robot.real.real_robot import RealRobot
from kachaka_simple_control.robot.real.speaker import Speaker
from kachaka_simple_control.robot.real.watch import Watch
from kachaka_simple_control.robot.robot_profile import KACHAKA
from kachaka_simple_control.robot.spinners import Ear, Spinner
from rclpy.publisher import Publisher


class RealBridge(BridgeNode):
    """
    Shows a robot that answers over gRPC.

    Velocities have a thread to themselves, and the rest of the node, the service for example,
    another; odometry and diagnostics are published from threads of their own.
    """

    def __init__(
            self, meeting: Meeting, namespace: str, frame_prefix: str = '',
            give_up: Callable[[str], None] = lambda _: None,
            on_rival: Callable[[str], None] = lambda _: None) -> None:
        """
        Show a robot from now on.

        :param meeting: the robot, which has answered
        :param namespace: where its topics and its service are
        :param frame_prefix: put before the names of the frames as it is
        :param give_up: called with the reason when motions are cut short
        :param on_rival: called when another bridge shows a robot under the same names
        :raises RobotTakenError: if another bridge does already
        """
        self._speaker = Speaker(self._log)
        super().__init__(namespace, on_rival)
        self._address: Address = meeting.address
        self._identity = meeting.identity
        self._frame_prefix = frame_prefix
        client = meeting.client
        self._robot = RealRobot(client, KACHAKA.hold, meeting.texts, self._speaker.tell, give_up)
        self._watch = Watch(client, self._robot, self._speaker.tell, self._publish_diagnostics)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._feeds = [
            self._feed(publisher, fetch)
            for publisher, fetch in zip(self._odometry, (client.odometry, client.wheel_odometry))]
        self._watch.look()
        self._watch.start()
        for feed in self._feeds:
            feed.start()

    def spinners(self) -> list[Spinner]:
        """Return what to run, each in a thread of its own."""
        return [Ear(self, self._subscription, self.hear), *super().spinners()]

    @property
    def summary(self) -> str:
        """Return what the bridge serves, in one line."""
        return f'{self._identity} at {self._address}: {super().summary}'

    def drive(self, velocity: Velocity, now: float) -> None:
        """
        Let the robot have a velocity; returns at once.

        :param velocity: the velocity; one that is not finite is refused
        :param now: when it came [s, steady clock]
        """
        try:
            wanted = command(velocity, KACHAKA.limits, now)
        except ValueError as error:
            self._speaker.tell(Level.WARN, f'the robot refused: {error}')
            return
        self._robot.drive(wanted)

    def set_manual_control(self, enabled: bool) -> str:
        """
        Let the robot take velocities, or none; returns when it has answered.

        :param enabled: whether it takes them
        :returns: why it refuses; nothing if it does not
        """
        outcome = self._robot.set_manual_control(enabled)
        if outcome.is_success:
            return ''
        return self._robot.describe(outcome) or 'no reason given'

    def close(self) -> None:
        """Leave the robot at rest, give it back, and publish no more; bounded in time."""
        for feed in self._feeds:
            feed.stop()
        # First of all the robot; then nobody has to wait for its answers any more.
        self._robot.close()
        self._watch.stop()
        for feed in self._feeds:
            feed.join()
        self._speaker.close()

    def _feed(self, publisher: Publisher, fetch: Fetch) -> OdometryFeed:
        def publish(source: Any) -> None:
            now = self.get_clock().now().to_msg()
            publisher.publish(real_messages.odometry(source, now, self._frame_prefix))

        return OdometryFeed(
            publisher.topic_name, fetch, lambda: publisher.get_subscription_count() > 0, publish,
            self._robot.note)

    def _publish_diagnostics(self) -> None:
        robot, now = self._robot, time.monotonic()
        self._diagnostics.publish(real_messages.diagnostics(
            (link_status(robot.link, str(self._address), robot.round_trip, robot.dropped, now),
             robot_status(robot.link, self._watch.codes, robot.texts)),
            self.get_clock().now().to_msg(), self.get_namespace().strip('/'), self._identity))

    def _log(self, level: Level, text: str) -> None:
        # Each level has its own line here: rclpy refuses another level from the same one.
        if level is Level.OK:
            self.get_logger().info(text)
        elif level is Level.WARN:
            self.get_logger().warning(text)
        else:
            self.get_logger().error(text)
