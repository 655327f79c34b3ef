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
"""Where the robot is to go, and where it went."""

from __future__ import annotations

from kachaka_simple_control.motion.geometry import ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.report.paths import MAX_POSES, PathSerializer, PoseHistory, sample_path
from kachaka_simple_control.ros.debug_topics import create_debug_publisher, PublisherThread
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.telemetry.events import MotionStarted, OdometryReceived
from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

PLANNED, DRIVEN = '~/planned_path', '~/driven_path'
#: The frame of odometry where nobody tells another one.
FRAME = 'odom'
#: The driven path is not published more often than this [s].
PERIOD = 0.5


class PlannedPathPublisher:
    """Publishes where the newest plan goes, before the robot moves; kept for who comes later."""

    def __init__(self, node: Node, velocities: VelocityPublisher, aside: PublisherThread) -> None:
        """
        Publish nothing yet.

        :param node: whose topic it is
        :param velocities: the publisher that moves the robot
        :param aside: publishes without holding anybody up
        :raises UsageError: if the topic is remapped to where it would move the robot
        """
        self._publisher = create_debug_publisher(
            node, velocities, Path, PLANNED,
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self._aside = aside
        self._clock = node.get_clock()
        self._bytes = PathSerializer(FRAME)
        self._pose: Pose | None = None
        #: what was published for a robot of which nobody knew yet where it is
        self._placeless: Plan | None = None

    def in_frame(self, frame: str) -> None:
        """
        Take note of the frame of odometry.

        :param frame: its name
        """
        self._bytes = PathSerializer(frame)

    def on_plan(self, plan: Plan) -> None:
        """
        Publish where a plan goes.

        :param plan: what is driven next
        """
        self._placeless = plan if self._pose is None else None
        self._publish(plan, self._pose or ORIGIN)

    def on_motion_started(self, began: MotionStarted) -> None:
        """
        Leave the plan as it was published: the robot moves.

        :param began: when
        """
        del began
        self._placeless = None

    def on_odometry(self, answered: OdometryReceived) -> None:
        """
        Take note of where the robot is.

        :param answered: where
        """
        self._pose = answered.pose
        plan, self._placeless = self._placeless, None
        if plan is not None:
            self._publish(plan, answered.pose)

    def _publish(self, plan: Plan, start: Pose) -> None:
        poses = [self._bytes.pose(pose) for pose in sample_path(plan, start)]
        path = self._bytes.path(poses, self._clock.now().nanoseconds)
        self._aside.publish(self._publisher, lambda: path)


class DrivenPathPublisher:
    """Publishes where odometry saw the robot, from its first pose on, to whoever subscribes."""

    def __init__(self, node: Node, velocities: VelocityPublisher, aside: PublisherThread) -> None:
        """
        Publish nothing yet.

        :param node: whose topic it is
        :param velocities: the publisher that moves the robot
        :param aside: publishes without holding anybody up
        :raises UsageError: if the topic is remapped to where it would move the robot
        """
        self._publisher = create_debug_publisher(
            node, velocities, Path, DRIVEN, QoSProfile(depth=1))
        self._aside = aside
        self._clock = node.get_clock()
        self._published = float('-inf')
        self.in_frame(FRAME)

    def in_frame(self, frame: str) -> None:
        """
        Begin anew in another frame.

        :param frame: the frame of odometry
        """
        self._bytes = PathSerializer(frame)
        self._trail = PoseHistory(
            MAX_POSES, lambda pose: self._bytes.pose(pose, self._clock.now().nanoseconds))

    def on_odometry(self, answered: OdometryReceived) -> None:
        """
        Take note of where the robot is, and publish where it was when it is time to.

        :param answered: where
        """
        self._trail.add(answered.pose)
        if (answered.time - self._published >= PERIOD
                and self._publisher.get_subscription_count()):
            self._published = answered.time
            path = self._bytes.path(self._trail.kept, self._clock.now().nanoseconds)
            self._aside.publish(self._publisher, lambda: path)
