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
A real Kachaka robot, controlled over gRPC, on the node of a bridge.

Tested by test/kachaka/grpc_client/test_grpc_bridge.py.
"""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from kachaka_simple_control.control.diagnosis import Level
from kachaka_simple_control.files.cdr import laser_scan, Scan
from kachaka_simple_control.files.robot_profile import (
    KACHAKA,
    KACHAKA_LASER_FRAME,
    KACHAKA_LASER_TIME,
)
from kachaka_simple_control.kachaka.bridge_node import BridgedRobot, BridgeNode, pose_text
from kachaka_simple_control.kachaka.grpc_client.client import ConnectedRobot
from kachaka_simple_control.kachaka.grpc_client.command_arbiter import velocity_command
from kachaka_simple_control.kachaka.grpc_client.robot_driver import (
    Fetch,
    HEALTH_EXIT_TIMEOUT,
    HealthPoller,
    LogThread,
    READING_DEADLINE,
    ReadingPoller,
    RobotDriver,
)
from kachaka_simple_control.kachaka.robot_status import connection_status, robot_status
from kachaka_simple_control.kachaka.simulator.drive_model import ODOMETRY_FRAME, ROBOT_FRAME
from kachaka_simple_control.motion.geometry import Pose, Velocity, yaw
from kachaka_simple_control.ros import conversions
from kachaka_simple_control.ros.names import DIAGNOSTICS
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher

BILLION = 1_000_000_000


def odometry(source: Any, now: Time, frame_prefix: str) -> Odometry:
    """
    Convert an odometry message of the robot's SDK to a ROS message.

    :param frame_prefix: a text before the frame names; no separator is added
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


def serialized_scan(source: Any, now: int, frame_prefix: str) -> bytes:
    """
    Convert a scan of the robot's SDK to a serialized ROS message.

    :param now: the stamp of a scan without one [ns]
    :param frame_prefix: a text before the frame name; no separator is added
    """
    stamp, frame = source.header.stamp_nsec, source.header.frame_id or KACHAKA_LASER_FRAME
    return laser_scan(
        Scan(now if stamp <= 0 else stamp, source.angle_min, source.angle_increment,
             source.range_min, source.range_max, source.ranges),
        source.scan_time, frame_prefix + frame)


def planar_pose(source: Any) -> Pose:
    """Return the planar pose in an odometry message of the robot's SDK."""
    position, rotation = source.pose.pose.position, source.pose.pose.orientation
    return Pose(
        position.x, position.y, yaw(rotation.x, rotation.y, rotation.z, rotation.w))


def _copy(source: Any, target: Any, names: str) -> None:
    for name in names:
        setattr(target, name, getattr(source, name))


class GrpcRobot(BridgedRobot):
    """
    A real robot, controlled over gRPC, on the node of a bridge.

    One thread only receives velocities, one runs all other callbacks, further ones request
    odometry, scans and errors from the robot and publish them.  The pose is logged when manual
    control is switched off and in ``close()``, if there is newer odometry.

    :param frame_prefix: a text before the frame names in odometry; no separator is added
    :param give_up: called with the reason if a motion is aborted
    """

    def __init__(
            self, node: BridgeNode, name: str, robot: ConnectedRobot, frame_prefix: str = '',
            give_up: Callable[[str], None] = lambda _: None) -> None:
        super().__init__(node, name)
        self._log_thread = LogThread(self._log)
        self._robot = robot
        self._frame_prefix = frame_prefix
        client = robot.client
        self._driver = RobotDriver(
            client, KACHAKA.command_timeout, robot.texts, self._log_thread.log, give_up)
        self._health = HealthPoller(
            client, self._driver, self._log_thread.log, self._publish_diagnostics)
        #: the newest odometry message of the robot's SDK; None if it was logged or none has come
        self._newest: Any = None
        self._diagnostics = node.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)
        self._pollers = [
            *(self._odometry_poller(publisher, fetch) for publisher, fetch in zip(
                self._odometry, (client.odometry, client.wheel_odometry))),
            ReadingPoller(
                'scans', client.laser_scan, lambda: self.has_scan_readers, self._publish_scan,
                # A robot may be there and have no scans.
                lambda *_: None, takes_old=False)]
        self._health.poll()
        for poller in (self._health, *self._pollers):
            poller.start()

    @property
    def summary(self) -> str:
        """Return one line for the log about the robot, its address, topics and service."""
        return f'{self._robot.identity} at {self._robot.address}: {super().summary}'

    def drive(self, velocity: Velocity, arrival: float) -> None:  # noqa: ARG002
        """Queue a velocity, and return at once; one that is infinite or NaN is not sent."""
        try:
            command = velocity_command(velocity, KACHAKA.limits, time.monotonic())
        except ValueError as error:
            self._log_thread.log(Level.WARN, f'the robot refused: {error}')
            return
        self._driver.drive(command)

    def set_manual_control(self, enabled: bool) -> str:
        """Switch manual control on or off; return why it failed, or an empty text."""
        result = self._driver.set_manual_control(enabled)
        if result.is_success and not enabled:
            self._log_pose()
        return '' if result.is_success else self._driver.describe(result) or 'no reason given'

    def activate_laser(self) -> str:
        """Let the laser run for 5 s from now on; return why it failed, or an empty text."""
        result = self._robot.client.activate_laser(KACHAKA_LASER_TIME, READING_DEADLINE)
        return '' if result.is_success else self._driver.describe(result) or 'no reason given'

    def close(self) -> None:
        """
        Stop the robot if it may be moving, disconnect from it, and end all threads of the node.

        Manual control is switched off if the node switched it on.  Each wait has a time limit.
        """
        for poller in self._pollers:
            poller.stop()
        # Close the driver first; this also cancels the calls of the other threads.
        self._driver.close()
        self._health.stop()
        self._health.join(HEALTH_EXIT_TIMEOUT)
        for poller in self._pollers:
            poller.join(READING_DEADLINE)
        self._log_pose()
        self._log_thread.close()

    def _log_pose(self) -> None:
        newest, self._newest = self._newest, None
        if newest is not None:
            self._log_thread.log(
                Level.OK, pose_text(planar_pose(newest), 'by its newest odometry'))

    def _odometry_poller(self, publisher: Publisher, fetch: Fetch) -> ReadingPoller:
        def publish(response: Any) -> None:
            source = response.odometry
            if publisher is self._odometry[0]:
                self._newest = source
            now = self.node.get_clock().now().to_msg()
            publisher.publish(odometry(source, now, self._frame_prefix))

        return ReadingPoller(
            publisher.topic_name, fetch, lambda: publisher.get_subscription_count() > 0, publish,
            self._driver.on_result)

    def _publish_scan(self, response: Any) -> None:
        self.publish_scan(serialized_scan(
            response.scan, self.node.get_clock().now().nanoseconds, self._frame_prefix))

    def _publish_diagnostics(self) -> None:
        # Each status name starts with the namespace, which distinguishes several robots.
        driver, robot = self._driver, self.node.get_namespace().strip('/')
        identity = self._robot.identity
        self._diagnostics.publish(conversions.diagnostics(
            {(f'{robot}: link', identity): connection_status(
                driver.connection, str(self._robot.address), driver.round_trip, driver.dropped,
                time.monotonic()),
             (f'{robot}: robot', identity): robot_status(
                 driver.connection, self._health.codes, driver.texts)},
            self.node.get_clock().now().to_msg()))
        if self._health.battery is not None:
            self.publish_battery(self._health.battery)

    def _log(self, level: Level, text: str) -> None:
        # One call for each level, because rclpy refuses different levels from one line of code.
        if level is Level.OK:
            self.logger.info(text)
        elif level is Level.WARN:
            self.logger.warning(text)
        else:
            self.logger.error(text)
