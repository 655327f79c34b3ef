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
"""The bridge node of a real robot, and the conversion of its odometry to ROS messages."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.bridge_node import BridgeNode
from kachaka_simple_control.kachaka.grpc_client.client import ConnectedRobot
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import velocity_command
from kachaka_simple_control.kachaka.grpc_client.robot_driver import (
    Fetch,
    HEALTH_EXIT_TIMEOUT,
    HealthPoller,
    LogThread,
    ODOMETRY_DEADLINE,
    OdometryPoller,
    RobotDriver,
)
from kachaka_simple_control.kachaka.robot_status import connection_status, robot_status
from kachaka_simple_control.kachaka.simulator.drive_model import ODOMETRY_FRAME, ROBOT_FRAME
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.ros import conversions
from kachaka_simple_control.ros.executors import ExecutorLoop, SubscriptionExecutor
from kachaka_simple_control.ros.names import DIAGNOSTICS
from kachaka_simple_control.telemetry.diagnosis import Level
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher

BILLION = 1_000_000_000


def odometry(source: Any, now: Time, frame_prefix: str) -> Odometry:
    """
    Convert the robot's odometry to a ROS message.

    :param source: the robot's odometry, a RosOdometry message of the SDK
    :param now: the time stamp to use if the robot's odometry has no time stamp
    :param frame_prefix: the prefix of the frame names; no separator is added
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


def _copy(source: Any, target: Any, names: str) -> None:
    for name in names:
        setattr(target, name, getattr(source, name))


class GrpcBridge(BridgeNode):
    """
    The bridge node of a real robot, driven over gRPC.

    One executor, which has its own thread, receives the velocities.  A second executor serves the
    rest of the node, for example the service.  Odometry and diagnostics are published by the
    threads that poll the robot.

    :param robot: the connected robot
    :param namespace: the namespace of the topics and the service
    :param frame_prefix: the prefix of the frame names; no separator is added
    :param give_up: called with the reason when a motion is aborted
    :param on_conflict: called if another bridge with the same topic names is discovered later,
        with a description of that bridge
    :raises RobotTakenError: if another bridge already uses the same topic names
    """

    def __init__(
            self, robot: ConnectedRobot, namespace: str, frame_prefix: str = '',
            give_up: Callable[[str], None] = lambda _: None,
            on_conflict: Callable[[str], None] = lambda _: None) -> None:
        self._log_thread = LogThread(self._log)
        super().__init__(namespace, on_conflict)
        self._robot = robot
        self._frame_prefix = frame_prefix
        client = robot.client
        self._driver = RobotDriver(
            client, KACHAKA.command_timeout, robot.texts, self._log_thread.log, give_up)
        self._health = HealthPoller(
            client, self._driver, self._log_thread.log, self._publish_diagnostics)
        self._diagnostics = self.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)
        self._pollers = [
            self._odometry_poller(publisher, fetch)
            for publisher, fetch in zip(self._odometry, (client.odometry, client.wheel_odometry))]
        self._health.poll()
        for poller in (self._health, *self._pollers):
            poller.start()

    def executors(self) -> list[ExecutorLoop]:
        """Return the executors of the node; the caller runs each of them in its own thread."""
        return [
            SubscriptionExecutor(self, self._subscription, self.on_velocity), *super().executors()]

    @property
    def summary(self) -> str:
        """Return the robot, its address, the topics and the service as text, in one line."""
        return f'{self._robot.identity} at {self._robot.address}: {super().summary}'

    def drive(self, velocity: Velocity, now: float) -> None:
        """
        Queue a velocity for the robot, and return at once.

        A velocity that is infinite or NaN is not sent, but a warning is logged.
        """
        try:
            command = velocity_command(velocity, KACHAKA.limits, now)
        except ValueError as error:
            self._log_thread.log(Level.WARN, f'the robot refused: {error}')
            return
        self._driver.drive(command)

    def set_manual_control(self, enabled: bool) -> str:
        """
        Switch manual control on or off.

        :param enabled: whether to switch manual control on
        :returns: the reason if the call fails, else an empty text
        """
        result = self._driver.set_manual_control(enabled)
        return '' if result.is_success else self._driver.describe(result) or 'no reason given'

    def close(self) -> None:
        """Stop the robot, switch off manual control and end all threads, within a limited time."""
        for poller in self._pollers:
            poller.stop()
        # Close the driver first; this also cancels the calls of the other threads.
        self._driver.close()
        self._health.stop()
        self._health.join(HEALTH_EXIT_TIMEOUT)
        for poller in self._pollers:
            poller.join(ODOMETRY_DEADLINE)
        self._log_thread.close()

    def _odometry_poller(self, publisher: Publisher, fetch: Fetch) -> OdometryPoller:
        def publish(source: Any) -> None:
            now = self.get_clock().now().to_msg()
            publisher.publish(odometry(source, now, self._frame_prefix))

        return OdometryPoller(
            publisher.topic_name, fetch, lambda: publisher.get_subscription_count() > 0, publish,
            self._driver.on_result)

    def _publish_diagnostics(self) -> None:
        # Each status name starts with the namespace, which distinguishes several robots.
        driver, robot = self._driver, self.get_namespace().strip('/')
        self._diagnostics.publish(conversions.diagnostics(
            {f'{robot}: link': connection_status(
                driver.connection, str(self._robot.address), driver.round_trip, driver.dropped,
                time.monotonic()),
             f'{robot}: robot': robot_status(
                 driver.connection, self._health.codes, driver.texts)},
            self.get_clock().now().to_msg(), self._robot.identity))

    def _log(self, level: Level, text: str) -> None:
        # One call for each level, because rclpy refuses different levels from one line of code.
        if level is Level.OK:
            self.get_logger().info(text)
        elif level is Level.WARN:
            self.get_logger().warning(text)
        else:
            self.get_logger().error(text)
