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
"""A simulated Kachaka on the node of a bridge.  Tested by test/kachaka/test_bridge_node.py."""

from __future__ import annotations

import math
import threading
import time

from kachaka_simple_control.files.cdr import laser_scan, odometry
from kachaka_simple_control.files.robot_profile import (
    KACHAKA,
    KACHAKA_LASER_FRAME,
    KACHAKA_LASER_TIME,
)
from kachaka_simple_control.kachaka.bridge_node import BridgedRobot, BridgeNode, pose_text
from kachaka_simple_control.kachaka.robot_status import ERROR_NO_MANUAL_CONTROL, SUCCESS
from kachaka_simple_control.kachaka.simulator.contact import Contact
from kachaka_simple_control.kachaka.simulator.drive_model import ODOMETRY_FRAME, ROBOT_FRAME
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import compose, ORIGIN, Pose, Velocity

#: The period at which the charge of the battery is published [s].
BATTERY_PERIOD = 1.0
#: The charge of the simulated robot's battery, which is always full.
SIMULATED_CHARGE = 1.0
#: If a node has more robots, the log does not say where they are in the end.
MAX_PLACES = 10


class SimulatedRobot(BridgedRobot):
    """
    A simulated robot of a bridge.

    It behaves like the manufacturer's bridge: a velocity, even zero, that comes while manual
    control is off switches it on, and is not followed.  Of the only robot of a node the pose is
    logged when manual control is switched off, at the latest by ``close()``; of several only then.

    :param frame_prefix: a text before the frame names in odometry; no separator is added
    :param start: where it is at first on the floor, for the log of several; odometry begins at 0
    """

    def __init__(
            self, node: BridgeNode, name: str, robot: SimulatedKachaka, frame_prefix: str = '',
            start: Pose = ORIGIN) -> None:
        super().__init__(node, name)
        self._robot = robot
        self._start = start
        # One thread receives velocities, one serves requests, one publishes odometry.
        self._lock = threading.Lock()
        #: whether the robot's pose was logged after manual control was last enabled
        self._is_place_logged = True
        self._frames = frame_prefix + ODOMETRY_FRAME, frame_prefix + ROBOT_FRAME
        self._laser_frame = frame_prefix + KACHAKA_LASER_FRAME
        #: the contact that was logged; None before one
        self._contact: Contact | None = None
        #: when the charge of the battery was last published [s, steady clock]
        self._battery_time = -math.inf

    def drive(self, velocity: Velocity, arrival: float) -> None:
        """Send a velocity to the simulated robot; without manual control, only switch that on."""
        limits = KACHAKA.limits
        with self._lock:
            code = self._robot.set_robot_velocity(
                velocity.linear_x / limits.max_linear_velocity,
                velocity.angular_z / limits.max_angular_velocity, arrival)
        if code == ERROR_NO_MANUAL_CONTROL:
            self.set_manual_control(True)
        elif code != SUCCESS:
            self.logger.warning(
                f'the robot refused a velocity of {velocity.linear_x:.4g} m/s and '
                f'{velocity.angular_z:.4g} rad/s', throttle_duration_sec=1.0)

    def close(self) -> None:
        """Log the robot's pose if that is due."""
        if not self._is_place_logged and len(self.node.robots) <= MAX_PLACES:
            self._log_place(time.monotonic())

    def set_manual_control(self, enabled: bool) -> str:
        """Switch manual control on or off; return the robot's error code, or an empty text."""
        now = time.monotonic()
        with self._lock:
            # Log only changes, because clients repeat their request to renew manual control.
            is_change = self._robot.manual_control(now) != enabled
            code = self._robot.set_manual_control(enabled, now)
        if is_change and code == SUCCESS and not self.name:
            self.logger.info(f"manual control {'enabled' if enabled else 'disabled'}")
        if enabled and code == SUCCESS:
            self._is_place_logged = False
        elif not self._is_place_logged and not self.name:
            self._log_place(now)
        return '' if code == SUCCESS else f'error {code}'

    def activate_laser(self) -> str:
        """Let the laser run for 5 s from now on; return an empty text."""
        with self._lock:
            self._robot.activate_laser(KACHAKA_LASER_TIME, time.monotonic())
        return ''

    def update(self, now: float, stamp: int) -> None:
        """
        Publish odometry and scans, for those who subscribe, and each second the battery's charge.

        The contact of the robot with its floor is logged.
        """
        # Update the robot even without a subscriber.  A robot with a lag integrates its path in
        # small steps.  After minutes without an update, the next velocity would have to wait for
        # all these steps.
        if now - self._battery_time >= BATTERY_PERIOD:
            self._battery_time = now
            self.publish_battery(SIMULATED_CHARGE)
        has_scan_readers = self.has_scan_readers
        with self._lock:
            pose, velocity = self._robot.odometry(now)
            contact = self._robot.contact(now)
            scan = self._robot.take_scan(now) if has_scan_readers else None
        if contact is not None and self._contact is None:
            self._contact = contact
            self.logger.error(str(contact))
        publishers = [
            publisher for publisher in self._odometry if publisher.get_subscription_count() > 0]
        if publishers:
            data = odometry(pose, velocity, stamp, *self._frames)
            for publisher in publishers:
                publisher.publish(data)
        if scan is not None:
            self.publish_scan(laser_scan(
                scan._replace(stamp=stamp), self._robot.laser.period, self._laser_frame))

    def _log_place(self, now: float) -> None:
        self._is_place_logged = True
        with self._lock:
            pose, _ = self._robot.state(now)
        which = 'true ' if self.name or self._robot.parameters.floor is not None else ''
        self.logger.info(which + pose_text(
            compose(self._start, pose),
            'on the floor' if self.name else 'as seen from where it was started'))
