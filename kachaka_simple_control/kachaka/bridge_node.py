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
"""The node that connects Kachakas to ROS 2, and what it has for each robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
import math
import time

from geometry_msgs.msg import Twist
from kachaka_simple_control.control.preparation import complete
from kachaka_simple_control.files.cdr import float64, read_twist
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.ros.executors import (
    ExecutorLoop,
    NodeExecutor,
    PeriodicLoop,
    running,
    SubscriptionExecutor,
)
from kachaka_simple_control.ros.graph import Graph
from kachaka_simple_control.ros.names import (
    BATTERY,
    DIAGNOSTICS,
    LASER_ACTIVATION,
    RobotNames,
)
from kachaka_simple_control.ros.robot_claim import RobotClaim
from kachaka_simple_control.ros.startup import check_node_names, one_line_errors
from kachaka_simple_control.text import pluralize
from nav_msgs.msg import Odometry
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

NODE = 'kachaka_bridge'
#: The two odometry topics of the official bridge.  The simulated robot publishes the same messages
#: on both topics.
ODOMETRY_TOPICS = ('odometry/odometry', 'wheel_odometry/wheel_odometry')
MANUAL_CONTROL = 'manual_control/set_enabled'
#: The topic of the scans has the name of the official bridge.
SCAN = 'lidar/scan'
#: The shortest time between two warnings about velocities above the limits [s].
LIMIT_WARN_PERIOD = 5.0
#: How many robots the log names.
MAX_NAMED = 5


def pose_text(pose: Pose, source: str) -> str:
    """Return the pose of a robot as a text for the log."""
    # Add 0.0 to print -0 as 0.
    return (f'pose: {round(pose.x, 4) + 0.0:.4f} m, {round(pose.y, 4) + 0.0:.4f} m, '
            f'{round(math.degrees(pose.theta), 2) + 0.0:.2f} deg (x, y, heading, {source})')


class BridgeNode(Node):
    """
    The node that connects Kachakas to ROS 2.

    :param robots: by name what makes each, when all are claimed.  The topics of ``r1`` are in
        ``r1/``; the only robot of a node needs no name: its topics are in the node's namespace
    :param update_period: how often each robot's ``update`` is called [s]; None: never
    :param on_conflict: called with the name of a robot and a text about a second bridge with the
        same topics, if one appears
    :raises RobotTakenError: if another bridge already uses the same topic names
    :raises UsageError: if a name is invalid, or two topics or services have the same name
    """

    def __init__(
            self, namespace: str,
            robots: Mapping[str, Callable[[BridgeNode, str], BridgedRobot]],
            update_period: float | None = None,
            on_conflict: Callable[[str, str], None] = lambda *_: None) -> None:
        with one_line_errors(NODE):
            super().__init__(NODE, namespace=namespace, start_parameter_services=False)
        names = [*map(_names, robots)]
        check_node_names(self, names, (
            *(topic_of(robot, topic) for robot in robots for topic in (
                *ODOMETRY_TOPICS[1:], SCAN, BATTERY)), DIAGNOSTICS),
            [topic_of(robot, LASER_ACTIVATION) for robot in robots])
        self.graph = Graph(self)
        self._claims = [
            RobotClaim(self.graph, self.resolve_topic_name(robot_names.velocity), 'bridge',
                       partial(on_conflict, name))
            for name, robot_names in zip(robots, names)]
        self._take_claims()
        #: of all velocities: one thread receives them
        self.velocity_group = MutuallyExclusiveCallbackGroup()
        self._update_period = update_period
        self.robots = [make(self, name) for name, make in robots.items()]

    @property
    def summary(self) -> str:
        """Return one line for the log: the topics and the service of one robot, or all names."""
        names = [robot.name for robot in self.robots if robot.name]
        if not names:
            return self.robots[0].summary
        more = len(names) - MAX_NAMED
        return (f'{pluralize(len(names), "simulated robot")}: {", ".join(names[:MAX_NAMED])}'
                f'{f" and {more} more" if more > 0 else ""}')

    def executors(self) -> list[ExecutorLoop]:
        """Return what receives velocities and does all else; each needs a thread of its own."""
        first, *others = self.robots
        velocities = SubscriptionExecutor(
            self, first.subscription, first.on_velocity, raw=True, timed=True)
        for robot in others:
            velocities.add(robot.subscription, robot.on_velocity)
        loops: list[ExecutorLoop] = [velocities, NodeExecutor(self)]
        if self._update_period is not None:
            loops.append(PeriodicLoop(self._update_period, self.update))
        return loops

    def update(self) -> None:
        """Call ``update`` of each robot."""
        now, stamp = time.monotonic(), self.get_clock().now().nanoseconds
        for robot in self.robots:
            robot.update(now, stamp)

    def close(self) -> None:
        """Disconnect from the robots; the caller must call this before ``destroy_node()``."""
        for robot in self.robots:
            robot.close()

    def destroy_node(self) -> None:
        """Release the topics for another bridge, and destroy the node."""
        complete([claim.release for claim in self._claims])
        super().destroy_node()

    def _take_claims(self) -> None:
        # No other executor runs the node yet, so the claims of other bridges are received here.
        try:
            with running(NodeExecutor(self)):
                complete([claim.take for claim in self._claims])
                for claim in self._claims:
                    claim.hold()
        except BaseException:
            self.destroy_node()
            raise


def topic_of(robot: str, name: str) -> str:
    """
    Return the name of a topic or service of a robot, relative to the node's namespace.

    :param robot: its name; empty for the only robot of a node
    """
    return f'{robot}/{name}' if robot else name


def _names(robot: str) -> RobotNames:
    return RobotNames(
        topic_of(robot, KACHAKA.velocity_topic), topic_of(robot, ODOMETRY_TOPICS[0]),
        topic_of(robot, MANUAL_CONTROL))


class BridgedRobot:
    """
    The base class of the robots of a bridge.

    It has the topics, service and QoS of the manufacturer's own bridge, and a service that lets
    the laser run.

    :param name: empty for the only robot of a node
    """

    def __init__(self, node: BridgeNode, name: str) -> None:
        self.node = node
        self.name = name
        # With a logger of its own, each robot has its own time between two warnings.
        self.logger = node.get_logger().get_child(name) if name else node.get_logger()
        self.subscription = node.create_subscription(
            Twist, topic_of(name, KACHAKA.velocity_topic), lambda _: None,
            qos_profile_sensor_data, callback_group=node.velocity_group, raw=True)
        self._service = node.create_service(
            SetBool, topic_of(name, MANUAL_CONTROL), self._on_set_enabled)
        self._odometry = [
            node.create_publisher(Odometry, topic_of(name, topic), qos_profile_sensor_data)
            for topic in ODOMETRY_TOPICS]
        self._battery = node.create_publisher(
            Float64, topic_of(name, BATTERY), qos_profile_sensor_data)
        self._scans = node.create_publisher(
            LaserScan, topic_of(name, SCAN), qos_profile_sensor_data)
        self._activation = node.create_service(
            Trigger, topic_of(name, LASER_ACTIVATION), self._on_activate)

    @property
    def summary(self) -> str:
        """Return one line of text for the log, with the names of its topics and service."""
        return (
            f'velocities on {self.subscription.topic_name}, '
            f'manual control at {self.node.resolve_service_name(self._service.srv_name)}, '
            f'odometry on {self._odometry[0].topic_name}')

    def on_velocity(self, data: bytes, arrival: float) -> None:
        """
        Send the velocity of a serialized message to the robot, which drives at its limit at most.

        A warning is logged if it is above it.

        :param arrival: when the message came [s]
        """
        velocity, limits = read_twist(data), KACHAKA.limits
        if (abs(velocity.linear_x) > limits.max_linear_velocity
                or abs(velocity.angular_z) > limits.max_angular_velocity):
            self._warn_of_cut(velocity)
        self.drive(velocity, arrival)

    def close(self) -> None:
        """Disconnect from the robot."""

    def update(self, now: float, stamp: int) -> None:
        """
        Do what is done in each period.

        :param stamp: the same time on the node's clock [ns]
        """

    def drive(self, velocity: Velocity, arrival: float) -> None:
        """
        Send a velocity to the robot, which must not follow it if it is infinite or NaN.

        :param arrival: when it came [s]; the system clock may make it some ms wrong
        """
        raise NotImplementedError

    def set_manual_control(self, enabled: bool) -> str:
        """Switch manual control on or off; return why it failed, or an empty text."""
        raise NotImplementedError

    def activate_laser(self) -> str:
        """Let the laser run for 5 s from now on; return why it failed, or an empty text."""
        raise NotImplementedError

    @property
    def has_scan_readers(self) -> bool:
        """Return whether anybody subscribes to the scans."""
        return self._scans.get_subscription_count() > 0

    def publish_scan(self, data: bytes) -> None:
        """Publish a serialized LaserScan message."""
        self._scans.publish(data)

    def publish_battery(self, charge: float) -> None:
        """Publish the charge of the battery, from 0 to 1."""
        self._battery.publish(float64(100.0 * charge))

    def _warn_of_cut(self, velocity: Velocity) -> None:
        cut = [(value, math.copysign(largest, value), unit) for value, largest, unit in (
            (velocity.linear_x, KACHAKA.limits.max_linear_velocity, 'm/s'),
            (velocity.angular_z, KACHAKA.limits.max_angular_velocity, 'rad/s'))
            if largest < abs(value) < math.inf]
        if cut:
            wanted = ' and '.join(f'{value:.4g} {unit}' for value, _, unit in cut)
            sent = ' and '.join(f'{largest:.4g} {unit}' for _, largest, unit in cut)
            self.logger.warning(
                f'a velocity of {wanted} is cut to {sent}, the most that a Kachaka does',
                throttle_duration_sec=LIMIT_WARN_PERIOD)

    def _on_set_enabled(
            self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.message = self.set_manual_control(request.data)
        response.success = not response.message
        return response

    def _on_activate(
            self, request: Trigger.Request, response: Trigger.Response,  # noqa: ARG002
            ) -> Trigger.Response:
        response.message = self.activate_laser()
        response.success = not response.message
        return response
