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
"""Publish the planned and the driven path of the robot."""

from __future__ import annotations

from kachaka_simple_control.analysis.paths import MAX_POSES, PoseHistory, sample_path
from kachaka_simple_control.control.events import MotionStarted, OdometryReceived
from kachaka_simple_control.motion.geometry import ORIGIN, Pose
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.ros.debug_topics import create_debug_publisher, PublisherThread
from kachaka_simple_control.ros.names import DRIVEN_PATH, PLANNED_PATH
from kachaka_simple_control.ros.velocity_publisher import VelocityPublisher
from kachaka_simple_control.telemetry.cdr import PathSerializer
from nav_msgs.msg import Path
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

#: The frame of the poses until odometry arrives and gives its frame.
FRAME = 'odom'
#: The shortest time between two messages of the driven path [s].
MIN_PUBLISH_PERIOD = 0.5


class PlannedPathPublisher:
    """
    Publishes the path of the newest plan before the robot moves.

    A late subscriber gets the newest path.

    :param velocities: the publisher of the velocities that move the robot
    :raises UsageError: if the topic is remapped to the velocity topic
    """

    def __init__(self, node: Node, velocities: VelocityPublisher, thread: PublisherThread) -> None:
        self._publisher = create_debug_publisher(
            node, velocities, Path, PLANNED_PATH,
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self._thread = thread
        self._clock = node.get_clock()
        self._serializer = PathSerializer(FRAME)
        self._pose: Pose | None = None
        #: the plan that was published from the origin, because the robot's pose was unknown
        self._plan_from_origin: Plan | None = None

    def set_frame(self, frame: str) -> None:
        """Use the frame of odometry for the published path."""
        self._serializer = PathSerializer(frame)

    def on_plan(self, plan: Plan) -> None:
        """Publish the path of the plan that is driven next."""
        self._plan_from_origin = plan if self._pose is None else None
        self._publish(plan, self._pose or ORIGIN)

    def on_motion_started(self, event: MotionStarted) -> None:
        """Keep the published path from now on, because the robot moves."""
        del event
        self._plan_from_origin = None

    def on_odometry(self, event: OdometryReceived) -> None:
        """Publish the path again from the robot's pose, if it was published from the origin."""
        self._pose = event.pose
        plan, self._plan_from_origin = self._plan_from_origin, None
        if plan is not None:
            self._publish(plan, event.pose)

    def _publish(self, plan: Plan, start: Pose) -> None:
        poses = [self._serializer.pose(pose) for pose in sample_path(plan, start)]
        path = self._serializer.path(poses, self._clock.now().nanoseconds)
        self._thread.publish(self._publisher, lambda: path)


class DrivenPathPublisher:
    """
    Publishes the path that odometry has measured since the first pose, if there are subscribers.

    :param velocities: the publisher of the velocities that move the robot
    :raises UsageError: if the topic is remapped to the velocity topic
    """

    def __init__(self, node: Node, velocities: VelocityPublisher, thread: PublisherThread) -> None:
        self._publisher = create_debug_publisher(
            node, velocities, Path, DRIVEN_PATH, QoSProfile(depth=1))
        self._thread = thread
        self._clock = node.get_clock()
        self._publish_time = float('-inf')
        self.set_frame(FRAME)

    def set_frame(self, frame: str) -> None:
        """Start a new path in the frame of odometry."""
        self._serializer = PathSerializer(frame)
        self._history = PoseHistory(
            MAX_POSES, lambda pose: self._serializer.pose(pose, self._clock.now().nanoseconds))

    def on_odometry(self, event: OdometryReceived) -> None:
        """Add a pose to the path, and publish the path at most once per MIN_PUBLISH_PERIOD."""
        self._history.add(event.pose)
        if (event.time - self._publish_time >= MIN_PUBLISH_PERIOD
                and self._publisher.get_subscription_count()):
            self._publish_time = event.time
            path = self._serializer.path(self._history.kept, self._clock.now().nanoseconds)
            self._thread.publish(self._publisher, lambda: path)
