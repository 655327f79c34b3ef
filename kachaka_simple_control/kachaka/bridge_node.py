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
"""The base class of the nodes that connect a Kachaka to ROS 2, and that of a simulated one."""

from __future__ import annotations

from collections.abc import Callable
import math
import time

from geometry_msgs.msg import Twist
from kachaka_simple_control.control.preparation import complete
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.robot_status import ERROR_NO_MANUAL_CONTROL, SUCCESS
from kachaka_simple_control.kachaka.simulator.drive_model import (
    ODOMETRY_FRAME,
    ODOMETRY_PERIOD,
    ROBOT_FRAME,
)
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.ros import conversions
from kachaka_simple_control.ros.executors import ExecutorLoop, NodeExecutor
from kachaka_simple_control.ros.graph import Graph
from kachaka_simple_control.ros.names import BATTERY, DIAGNOSTICS, RobotNames
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.startup import check_node_names, one_line_errors
from nav_msgs.msg import Odometry
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

NODE = 'kachaka_bridge'
#: The two odometry topics of the official bridge.  The simulated robot publishes the same messages
#: on both topics.
ODOMETRY_TOPICS = ('odometry/odometry', 'wheel_odometry/wheel_odometry')
#: The shortest time between two warnings about velocities above the limits [s].
LIMIT_WARN_PERIOD = 5.0
#: The period at which the charge of the battery is published [s].
BATTERY_PERIOD = 1.0
#: The charge of the simulated robot's battery, which is always full.
SIMULATED_CHARGE = 1.0


def pose_text(pose: Pose, source: str) -> str:
    """Return the pose of a robot as a text for the log."""
    # Add 0.0 to print -0 as 0.
    return (f'pose: {round(pose.x, 4) + 0.0:.4f} m, {round(pose.y, 4) + 0.0:.4f} m, '
            f'{round(math.degrees(pose.theta), 2) + 0.0:.2f} deg (x, y, heading, {source})')


class BridgeNode(Node):
    """
    The base class of the nodes that connect a Kachaka robot to ROS 2.

    It has the topics, service and QoS of the manufacturer's own bridge.

    :param on_conflict: called with a text about a second bridge with the same topics, if one
        appears
    :raises RobotTakenError: if another bridge already uses the same topic names
    :raises UsageError: if a name is invalid, or two topics or services have the same name
    """

    def __init__(
            self, namespace: str, on_conflict: Callable[[str], None] = lambda _: None) -> None:
        with one_line_errors(NODE):
            super().__init__(NODE, namespace=namespace, start_parameter_services=False)
        check_node_names(
            self, [RobotNames(
                KACHAKA.velocity_topic, KACHAKA.odometry_topic, KACHAKA.manual_control_service)],
            (*ODOMETRY_TOPICS[1:], DIAGNOSTICS, BATTERY), ())
        self.graph = Graph(self)
        self._claim = RobotClaim(
            self.graph, self.resolve_topic_name(KACHAKA.velocity_topic), 'bridge', on_conflict)
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
        self._battery = self.create_publisher(Float64, BATTERY, qos_profile_sensor_data)

    @property
    def summary(self) -> str:
        """Return one line of text for the log, with the names of the node's topics and service."""
        return (
            f'velocities on {self._subscription.topic_name}, '
            f'manual control at {self.resolve_service_name(self._service.srv_name)}, '
            f'odometry on {self._odometry[0].topic_name}')

    def executors(self) -> list[ExecutorLoop]:
        """Return the executors of the node's callbacks; each needs a thread of its own."""
        return [NodeExecutor(self)]

    def on_velocity(self, twist: Twist) -> None:
        """
        Send the velocity of a message to the robot, which drives at its limit at most.

        A warning is logged if they are above it.
        """
        velocity = conversions.velocity(twist)
        cut = [(value, math.copysign(largest, value), unit) for value, largest, unit in (
            (velocity.linear_x, KACHAKA.limits.max_linear_velocity, 'm/s'),
            (velocity.angular_z, KACHAKA.limits.max_angular_velocity, 'rad/s'))
            if largest < abs(value) < math.inf]
        if cut:
            wanted = ' and '.join(f'{value:.4g} {unit}' for value, _, unit in cut)
            sent = ' and '.join(f'{largest:.4g} {unit}' for _, largest, unit in cut)
            self.get_logger().warning(
                f'a velocity of {wanted} is cut to {sent}, the most that a Kachaka does',
                throttle_duration_sec=LIMIT_WARN_PERIOD)
        self.drive(velocity, time.monotonic())

    def close(self) -> None:
        """Disconnect from the robot; the caller must call this before ``destroy_node()``."""

    def destroy_node(self) -> None:
        """Release the topics for another bridge, and destroy the node."""
        complete([self._claim.release])
        super().destroy_node()

    def drive(self, velocity: Velocity, now: float) -> None:
        """Send a velocity to the robot, which must not follow it if it is infinite or NaN."""
        raise NotImplementedError

    def set_manual_control(self, enabled: bool) -> str:
        """Switch manual control on or off; return why it failed, or an empty text."""
        raise NotImplementedError

    def publish_battery(self, charge: float) -> None:
        """Publish the charge of the battery, from 0 to 1."""
        self._battery.publish(Float64(data=100.0 * charge))

    def _take_claim(self) -> None:
        # No other executor runs the node yet, so the claims of other bridges are received here.
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self)
        try:
            complete([self._claim.take], lambda: executor.spin_once(timeout_sec=0.0))
            self._claim.hold()
        except BaseException:
            self.destroy_node()
            raise
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
    The node that connects a simulated robot to ROS 2.

    It behaves like the manufacturer's bridge: a velocity, even zero, that comes while manual
    control is off switches it on, and is not followed.  The pose is logged when manual control is
    switched off, at the latest by ``close()``.

    :param frame_prefix: a text before the frame names in odometry; no separator is added
    :param on_conflict: as for ``BridgeNode``
    :raises RobotTakenError: if another bridge already uses the same topic names
    """

    def __init__(
            self, robot: SimulatedKachaka, namespace: str, frame_prefix: str = '',
            on_conflict: Callable[[str], None] = lambda _: None) -> None:
        super().__init__(namespace, on_conflict)
        self._robot = robot
        #: whether the robot's pose was logged after manual control was last enabled
        self._is_place_logged = True
        self._frame_id = frame_prefix + ODOMETRY_FRAME
        self._child_frame_id = frame_prefix + ROBOT_FRAME
        #: when the charge of the battery was last published [s, steady clock]
        self._battery_time = -math.inf
        # Use a steady clock, because /clock may stop while the robot drives.
        self._timer = self.create_timer(
            ODOMETRY_PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def drive(self, velocity: Velocity, now: float) -> None:
        """Send a velocity to the simulated robot; without manual control, only switch that on."""
        code = self._robot.set_robot_velocity(
            velocity.linear_x / KACHAKA.limits.max_linear_velocity,
            velocity.angular_z / KACHAKA.limits.max_angular_velocity, now)
        if code == ERROR_NO_MANUAL_CONTROL:
            self.set_manual_control(True)
        elif code != SUCCESS:
            self.get_logger().warning(
                f'the robot refused a velocity of {velocity.linear_x:.4g} m/s and '
                f'{velocity.angular_z:.4g} rad/s', throttle_duration_sec=1.0)

    def close(self) -> None:
        """Log the robot's pose if that is due; call this before ``destroy_node()``."""
        if not self._is_place_logged:
            self._log_place(time.monotonic())

    def set_manual_control(self, enabled: bool) -> str:
        """Switch manual control on or off; return the robot's error code, or an empty text."""
        now = time.monotonic()
        # Log only changes, because clients repeat their request to renew manual control.
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
        which = 'true ' if self._robot.parameters.floor is not None else ''
        self.get_logger().info(
            which + pose_text(pose, 'as seen from where it was started'))

    def _on_timer(self) -> None:
        # Update the robot even without a subscriber.  A robot with a lag integrates its path in
        # small steps.  After minutes without an update, the next velocity would have to wait for
        # all these steps.
        now, stamp = time.monotonic(), self.get_clock().now().to_msg()
        if now - self._battery_time >= BATTERY_PERIOD:
            self._battery_time = now
            self.publish_battery(SIMULATED_CHARGE)
        pose, velocity = self._robot.odometry(now)
        publishers = [
            publisher for publisher in self._odometry if publisher.get_subscription_count() > 0]
        if publishers:
            message = conversions.odometry(
                pose, velocity, stamp, self._frame_id, self._child_frame_id)
            for publisher in publishers:
                publisher.publish(message)
