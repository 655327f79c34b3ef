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
"""The bridge node of the real robot, and its messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.bridge_node import BridgeNode
from kachaka_simple_control.kachaka.error_codes import (
    DiagnosticEntry,
    Level,
    link_status,
    robot_status,
)
from kachaka_simple_control.kachaka.grpc_client.address import Address
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import velocity_command
from kachaka_simple_control.kachaka.grpc_client.connection import ConnectedRobot
from kachaka_simple_control.kachaka.grpc_client.polling import (
    Fetch,
    HealthPoller,
    LogThread,
    OdometryPoller,
)
from kachaka_simple_control.kachaka.grpc_client.robot_driver import RobotDriver
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.ros.executors import ExecutorLoop, SubscriptionExecutor
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher

BILLION = 1_000_000_000
#: The frames of odometry, should the robot not name them.
ODOMETRY_FRAME = 'odom'
ROBOT_FRAME = 'base_footprint'


def odometry(source: Any, now: Time, frame_prefix: str) -> Odometry:
    """
    Return odometry as the robot tells it.

    :param source: a RosOdometry of the robot
    :param now: the stamp, if it has none
    :param frame_prefix: put before the names of frames as it is
    :returns: the message
    """
    message = Odometry()
    nanoseconds = source.header.stamp_nsec
    message.header.stamp = now if nanoseconds <= 0 else Time(
        sec=nanoseconds // BILLION, nanosec=nanoseconds % BILLION)
    message.header.frame_id = frame_prefix + (source.header.frame_id or ODOMETRY_FRAME)
    message.child_frame_id = frame_prefix + (source.child_frame_id or ROBOT_FRAME)
    pose, twist = message.pose, message.twist
    _copy(source.pose.pose.position, pose.pose.position, 'xyz')
    _copy(source.pose.pose.orientation, pose.pose.orientation, 'xyzw')
    _copy(source.twist.twist.linear, twist.twist.linear, 'xyz')
    _copy(source.twist.twist.angular, twist.twist.angular, 'xyz')
    for values, target in ((source.pose.covariance, pose), (source.twist.covariance, twist)):
        if len(values) == len(target.covariance):
            target.covariance = list(values)
    return message


def diagnostics(
        statuses: Sequence[DiagnosticEntry], stamp: Time, robot: str,
        hardware: str) -> DiagnosticArray:
    """
    Return diagnostics.

    :param statuses: the entries
    :param stamp: when they were true
    :param robot: put before their names, for there may be more robots than one
    :param hardware: which robot it is
    :returns: the message
    """
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        DiagnosticStatus(
            level=bytes([status.level]), name=f'{robot}: {status.name}', message=status.message,
            hardware_id=hardware,
            values=[KeyValue(key=key, value=value) for key, value in status.values.items()])
        for status in statuses]
    return message


def _copy(source: Any, target: Any, names: str) -> None:
    for name in names:
        setattr(target, name, getattr(source, name))


class RealBridge(BridgeNode):
    """
    Shows a robot that answers over gRPC.

    Velocities have a thread to themselves, and the rest of the node, the service for example,
    another; odometry and diagnostics are published from threads of their own.
    """

    def __init__(
            self, meeting: ConnectedRobot, namespace: str, frame_prefix: str = '',
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
        self._speaker = LogThread(self._log)
        super().__init__(namespace, on_rival)
        self._address: Address = meeting.address
        self._identity = meeting.identity
        self._frame_prefix = frame_prefix
        client = meeting.client
        self._robot = RobotDriver(client, KACHAKA.hold, meeting.texts, self._speaker.log, give_up)
        self._watch = HealthPoller(
            client, self._robot, self._speaker.log, self._publish_diagnostics)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._feeds = [
            self._feed(publisher, fetch)
            for publisher, fetch in zip(self._odometry, (client.odometry, client.wheel_odometry))]
        self._watch.poll()
        self._watch.start()
        for feed in self._feeds:
            feed.start()

    def spinners(self) -> list[ExecutorLoop]:
        """Return what to run, each in a thread of its own."""
        return [SubscriptionExecutor(self, self._subscription, self.hear), *super().spinners()]

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
            wanted = velocity_command(velocity, KACHAKA.limits, now)
        except ValueError as error:
            self._speaker.log(Level.WARN, f'the robot refused: {error}')
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

    def _feed(self, publisher: Publisher, fetch: Fetch) -> OdometryPoller:
        def publish(source: Any) -> None:
            now = self.get_clock().now().to_msg()
            publisher.publish(odometry(source, now, self._frame_prefix))

        return OdometryPoller(
            publisher.topic_name, fetch, lambda: publisher.get_subscription_count() > 0, publish,
            self._robot.note)

    def _publish_diagnostics(self) -> None:
        robot, now = self._robot, time.monotonic()
        self._diagnostics.publish(diagnostics(
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
