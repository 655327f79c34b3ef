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
"""The nodes that show a robot to ROS 2 under the names of the official bridge."""

from __future__ import annotations

from collections.abc import Callable
import math
import time

from geometry_msgs.msg import Twist
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.bridge_executors import ExecutorLoop, NodeExecutor
from kachaka_simple_control.kachaka.error_codes import ERROR_NO_MANUAL_CONTROL, SUCCESS
from kachaka_simple_control.kachaka.simulator.drive_model import (
    ODOMETRY_FRAME,
    ODOMETRY_PERIOD,
    ROBOT_FRAME,
)
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.ros import conversions
from kachaka_simple_control.ros.names import DIAGNOSTICS, RobotNames
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.startup import check_node_names, one_line_errors
from nav_msgs.msg import Odometry
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_srvs.srv import SetBool

NODE = 'kachaka_bridge'
#: Both of the official bridge, from two sources; the simulated robot has only one odometry.
ODOMETRY_TOPICS = ('odometry/odometry', 'wheel_odometry/wheel_odometry')
#: How often a velocity above the limits is warned of at most [s].
LIMIT_WARN_PERIOD = 5.0


class BridgeNode(Node):
    """
    The topics, the service and the quality of service of the official bridge.

    :param namespace: the namespace of its topics and its service
    :param on_conflict: called with another bridge that shows a robot under the same names, if it
        is discovered later
    :raises RobotTakenError: if another bridge already does
    :raises UsageError: if a name is invalid, or taken by something else of the node
    """

    def __init__(
            self, namespace: str, on_conflict: Callable[[str], None] = lambda _: None) -> None:
        with one_line_errors(NODE):
            super().__init__(NODE, namespace=namespace, start_parameter_services=False)
        check_node_names(
            self, RobotNames(
                KACHAKA.velocity_topic, KACHAKA.odometry_topic, KACHAKA.manual_control_service),
            (*ODOMETRY_TOPICS[1:], DIAGNOSTICS), ())
        self._claim = RobotClaim(
            self, self.resolve_topic_name(KACHAKA.velocity_topic), 'bridge', on_conflict)
        self._take_claim()
        service = KACHAKA.manual_control_service
        assert service is not None, 'a Kachaka has one'
        self._subscription = self.create_subscription(
            Twist, KACHAKA.velocity_topic, self.on_velocity, qos_profile_sensor_data,
            callback_group=MutuallyExclusiveCallbackGroup())
        self._service = self.create_service(SetBool, service, self._on_set_enabled)
        self._odometry = [
            self.create_publisher(Odometry, topic, qos_profile_sensor_data)
            for topic in ODOMETRY_TOPICS]

    @property
    def summary(self) -> str:
        """Return what the bridge serves, in one line."""
        return (
            f'velocities on {self._subscription.topic_name}, '
            f'manual control at {self.resolve_service_name(self._service.srv_name)}, '
            f'odometry on {self._odometry[0].topic_name}')

    def executors(self) -> list[ExecutorLoop]:
        """Return the executors to run, each in a thread of its own."""
        return [NodeExecutor(self)]

    def on_velocity(self, twist: Twist) -> None:
        """Send the velocity of a message to the robot."""
        velocity = conversions.velocity(twist)
        for value, largest, unit in (
                (velocity.linear_x, KACHAKA.limits.max_linear_velocity, 'm/s'),
                (velocity.angular_z, KACHAKA.limits.max_angular_velocity, 'rad/s')):
            if largest < abs(value) < math.inf:
                self.get_logger().warning(
                    f'a velocity of {value:.4g} {unit} is cut to '
                    f'{math.copysign(largest, value):.4g} {unit}, the most that a Kachaka does',
                    throttle_duration_sec=LIMIT_WARN_PERIOD)
        self.drive(velocity, time.monotonic())

    def close(self) -> None:
        """Disconnect from the robot; called before ``destroy_node``."""

    def drive(self, velocity: Velocity, now: float) -> None:
        """
        Send a velocity to the robot.

        :param velocity: the velocity, which may not be finite
        :param now: when it was received [s, steady clock]
        """
        raise NotImplementedError

    def set_manual_control(self, enabled: bool) -> str:
        """Switch manual control; return why the robot refuses, empty if it does not."""
        raise NotImplementedError

    def _take_claim(self) -> None:
        # The claims of other bridges must be received before any other executor runs the node.
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self)
        try:
            self._claim.take(lambda: executor.spin_once(timeout_sec=0.0))
            self._claim.hold()
        finally:
            executor.remove_node(self)
            executor.shutdown()

    def _on_set_enabled(
            self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.message = self.set_manual_control(request.data)
        response.success = not response.message
        return response


class SimulatedBridge(BridgeNode):
    """
    Shows a simulated robot as the official bridge does.

    When manual control or the bridge ends, it logs where the robot is.

    In particular: a velocity while manual control is off switches it on and is itself lost, zero
    or not; the bridge limits nothing; the only watchdog is the robot's command timeout.

    :param robot: the robot
    :param namespace: the namespace of its topics and its service
    :param frame_prefix: put before the names of the frames, without a separator
    :param on_conflict: called when another bridge shows a robot under the same names
    :raises RobotTakenError: if another bridge already does
    """

    def __init__(
            self, robot: SimulatedKachaka, namespace: str, frame_prefix: str = '',
            on_conflict: Callable[[str], None] = lambda _: None) -> None:
        super().__init__(namespace, on_conflict)
        self._robot = robot
        #: whether the place of the robot was logged since manual control was enabled
        self._is_place_logged = True
        self._frame_id = frame_prefix + ODOMETRY_FRAME
        self._child_frame_id = frame_prefix + ROBOT_FRAME
        # On a steady clock: /clock may stand still while the robot drives.
        self._timer = self.create_timer(
            ODOMETRY_PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def drive(self, velocity: Velocity, now: float) -> None:
        """
        Send a velocity to the robot.

        :param velocity: the velocity, which may not be finite
        :param now: when it was received [s, steady clock]
        """
        limits = KACHAKA.limits
        code = self._robot.set_robot_velocity(
            velocity.linear_x / limits.max_linear_velocity,
            velocity.angular_z / limits.max_angular_velocity,
            now)
        if code == ERROR_NO_MANUAL_CONTROL:
            self.set_manual_control(True)
        elif code != SUCCESS:
            self.get_logger().warning(f'the robot refused {velocity}', throttle_duration_sec=1.0)

    def close(self) -> None:
        """Log where the robot is, if that is not done; called before ``destroy_node``."""
        if not self._is_place_logged:
            self._log_place(time.monotonic())

    def set_manual_control(self, enabled: bool) -> str:
        """Switch manual control; return why the robot refuses, empty if it does not."""
        now = time.monotonic()
        # A client may repeat its request, and renews it: only a change is logged.
        is_change = self._robot.manual_control(now) != enabled
        code = self._robot.set_manual_control(enabled, now)
        if is_change and code == SUCCESS:
            self.get_logger().info(f"manual control {'enabled' if enabled else 'disabled'}")
        if enabled and code == SUCCESS:
            self._is_place_logged = False
        elif not self._is_place_logged:
            self._log_place(now)
        return '' if code == SUCCESS else f'error {code}'

    def _log_place(self, now: float) -> None:
        self._is_place_logged = True
        pose, _ = self._robot.state(now)
        # 0.0 is added because -0 is 0 to people.
        which = 'true pose' if self._robot.has_wrong_odometry else 'pose'
        self.get_logger().info(
            f'{which}: {round(pose.x, 4) + 0.0:.4f} m, {round(pose.y, 4) + 0.0:.4f} m, '
            f'{round(math.degrees(pose.theta), 2) + 0.0:.2f} deg (x, y, heading, as seen '
            'from where it was started)')

    def _on_timer(self) -> None:
        # Also without a subscriber: a robot with a lag integrates its path step by step, and must
        # not have to catch up on minutes when a velocity comes.
        now, stamp = time.monotonic(), self.get_clock().now().to_msg()
        pose, velocity = self._robot.odometry(now)
        publishers = [
            publisher for publisher in self._odometry if publisher.get_subscription_count() > 0]
        if publishers:
            message = conversions.odometry(
                pose, velocity, stamp, self._frame_id, self._child_frame_id)
            for publisher in publishers:
                publisher.publish(message)
