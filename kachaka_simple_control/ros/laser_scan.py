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
Read the scans of a robot's laser, and let the laser run.

Tested by test/ros/test_laser_scan.py.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
import struct
import time

from kachaka_simple_control.control.scans import points_of, ScanClock
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.cdr import read_laser_scan
from kachaka_simple_control.motion.geometry import Point, Pose
from kachaka_simple_control.ros.endpoints import with_qos_overrides
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.task import Future
from std_srvs.srv import Trigger


class LaserReader:
    """
    Reads the scans of a robot's laser.

    :param laser: the pose of the laser in the frame of the robot
    :param group: that of the thread for odometry, which no other executor serves
    :ivar on_scan: called with the time of arrival and the time when the scan was taken [s on the
        steady clock], and with what it has seen in the frame of the robot, if the scan counts
    :raises UsageError: if sensor_msgs is not installed, or a ROS parameter sets an invalid QoS
    """

    def __init__(self, node: Node, topic: str, laser: Pose, group: CallbackGroup) -> None:
        self.topic = topic
        self._laser = laser
        self._clock = ScanClock()
        self.on_scan: Callable[[float, float, tuple[Point, ...]], None] = lambda *_: None
        # Optional: only a watch needs it.
        try:
            from sensor_msgs.msg import LaserScan
        except ImportError:
            raise UsageError('watch needs sensor_msgs, which is not installed') from None
        # Best effort, as lasers publish: a reliable subscription would not match.
        self.subscription = with_qos_overrides(lambda options: node.create_subscription(
            LaserScan, topic, lambda _: None, copy(qos_profile_sensor_data),
            callback_group=group, qos_overriding_options=options))

    def on_message(self, data: bytes) -> None:
        """Read a serialized scan."""
        now = time.monotonic()
        try:
            scan = read_laser_scan(data)
        except (ValueError, struct.error) as error:
            raise ValueError(f'a scan on {self.topic} cannot be read: {error}') from None
        taken = self._clock.taken(now, scan.stamp)
        points = None if taken is None else points_of(scan, self._laser)
        if taken is not None and points is not None:
            self.on_scan(now, taken, points)


class LaserActivation:
    """Asks the bridge of a Kachaka to let the laser run for 5 s, which only ours can."""

    def __init__(self, node: Node, service: str) -> None:
        self._client = node.create_client(
            Trigger, service, callback_group=MutuallyExclusiveCallbackGroup())
        self._newest: Future | None = None

    def request(self) -> None:
        """Ask, if there is such a service, and do not wait for the answer."""
        if self._client.service_is_ready():
            if self._newest is not None:
                # An answer that is lost must not be kept for ever.
                self._client.remove_pending_request(self._newest)
            self._newest = self._client.call_async(Trigger.Request())
