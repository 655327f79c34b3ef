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
"""Receive the odometry of a robot in a separate thread.  Tested by test/ros/test_faults.py."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
import math
import threading
import time
from typing import Protocol

from kachaka_simple_control.files.cdr import read_odometry
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.ros import executors
from kachaka_simple_control.ros.endpoints import with_qos_overrides
from kachaka_simple_control.ros.names import RobotNames
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.subscription import Subscription


class OdometryReader:
    """
    Reads the odometry messages of a robot.

    :ivar on_odometry: called with the time of arrival [s on the steady clock], the pose, the
        velocity, and whether the message is new: its time stamp is later than the one before, or
        it has none
    """

    def __init__(self, subscription: Subscription) -> None:
        self.subscription = subscription
        self.on_odometry: Callable[[float, Pose, Velocity, bool], None] = lambda *_: None
        #: called with the frame of the poses, before the first pose in it
        self.on_frame: Callable[[str], object] = lambda _: None
        self._frame: bytes | None = None
        self._newest = 0

    def on_message(self, data: bytes) -> None:
        """Read a serialized message."""
        frame, stamp, pose, twist = read_odometry(data)
        if frame != self._frame:
            self._frame = frame
            self.on_frame(frame.decode(errors='replace'))
        is_new, self._newest = stamp > self._newest or not stamp, stamp
        # Ignore a message with a value that is NaN or infinite.
        if math.isfinite(pose.x + pose.y + pose.theta + twist.linear_x + twist.angular_z):
            self.on_odometry(time.monotonic(), pose, twist, is_new)


class Reader(Protocol):
    """Reads the serialized messages of a subscription."""

    subscription: Subscription

    def on_message(self, data: bytes) -> None:
        """Read a serialized message."""


class OdometryThread:
    """
    Receives odometry and scans of robots in one thread, with little CPU time for each message.

    An executor of rclpy would build a new wait set with all entities of the node for each, and
    convert all 72 covariance values.

    :param readers: at least one; their subscriptions are in one callback group
    :param on_error: called in the thread with what a function of a reader raises
    """

    def __init__(
            self, node: Node, readers: Sequence[Reader],
            on_error: Callable[[BaseException], None]) -> None:
        first, *others = readers
        self._executor = executors.SubscriptionExecutor(
            node, first.subscription, first.on_message, raw=True)
        for reader in others:
            self._executor.add(reader.subscription, reader.on_message)
        self._thread = threading.Thread(
            target=executors.spin_until_stopped, args=(self._executor.run, on_error),
            name='odometry', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread; wait for it at most 2 s, and not in the thread itself."""
        if self._thread.is_alive():
            self._executor.stop()
            if threading.current_thread() is not self._thread:
                self._thread.join(executors.THREAD_EXIT_TIMEOUT)


def subscribe_to_odometry(
        node: Node, names: RobotNames, group: CallbackGroup) -> OdometryReader | None:
    """
    Subscribe to odometry; None if the robot has none, or nav_msgs is not installed.

    :param group: that of the thread for odometry, which no other executor serves
    :raises UsageError: if a ROS parameter sets an invalid QoS
    """
    topic = names.odometry
    if topic is None:
        return None
    # Optional: without nav_msgs a drive works, but without the checks by odometry.
    try:
        from nav_msgs.msg import Odometry
    except ImportError:
        return None
    # Best effort, like the publisher of the robot: a reliable subscription would not match.
    subscription = with_qos_overrides(lambda options: node.create_subscription(
        Odometry, topic, lambda _: None, copy(qos_profile_sensor_data),
        callback_group=group, qos_overriding_options=options))
    return OdometryReader(subscription)
