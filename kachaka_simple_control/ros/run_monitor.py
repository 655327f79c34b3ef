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
"""The fault checks during a run."""

from __future__ import annotations

import time

from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.manual_control_lease import LeaseRenewer
from kachaka_simple_control.control.stop import StandstillDetector
from kachaka_simple_control.control.timing import (
    GRAPH_CHECK_PERIOD,
    GRAPH_COUNT_PERIOD,
    SUBSCRIBER_CHECK_PERIOD,
)
from kachaka_simple_control.errors import RunFaultError
from kachaka_simple_control.ros.foreign_messages import ForeignMessages
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery


class RosRunMonitor:
    """
    Sends heartbeats, renews manual control and raises the faults that end a run.

    Called after each message and at least every 20 ms; each call is short.

    :param guardian: gets the heartbeats
    :param lease: renews manual control; None for a robot that needs none
    :param discovery: what the ROS graph tells of the robot
    :param foreign: listens to other publishers of velocities
    :param odometry: what odometry tells of the robot
    :param odometry_timeout: how long odometry may be silent [s]; 0 for no limit
    """

    def __init__(
            self, guardian: Guardian | NullGuardian, lease: LeaseRenewer | None,
            discovery: RobotDiscovery, foreign: ForeignMessages, odometry: StandstillDetector,
            odometry_timeout: float) -> None:
        self._guardian = guardian
        self._lease = lease
        self._discovery = discovery
        self._foreign = foreign
        self._odometry = odometry
        self._odometry_timeout = odometry_timeout
        self._subscriber_checked = self._graph_counted = self._graph_checked = float('-inf')

    def on_sent(self, rest: float) -> None:
        """
        Renew manual control when it is time to.

        :param rest: how long the plan stays at rest from here [s]; 0 while moving
        """
        if self._lease is not None:
            self._lease.on_sent(time.monotonic(), rest)

    def check(self) -> None:
        """
        Send a heartbeat, and look for faults.

        :raises RunFaultError: if the run must end
        """
        now = time.monotonic()
        self._guardian.heartbeat()
        if self._lease is not None:
            self._lease.poll(now)
        if now - self._subscriber_checked >= SUBSCRIBER_CHECK_PERIOD:
            self._subscriber_checked = now
            self._discovery.check_subscribed()
        if self.has_lost_robot(now):
            raise RunFaultError(
                f'odometry has been silent for {self._odometry.age(now):.1f} s: the robot or the '
                'link to it is lost')
        if now - self._graph_counted >= GRAPH_COUNT_PERIOD:
            self._graph_counted = now
            self._check_graph(now)

    def has_lost_robot(self, now: float) -> bool:
        """Return whether odometry, received before, has been silent for too long."""
        age = self._odometry.age(now)
        return age is not None and 0.0 < self._odometry_timeout < age

    def _check_graph(self, now: float) -> None:
        if self._discovery.has_changed() or now - self._graph_checked >= GRAPH_CHECK_PERIOD:
            self._graph_checked = now
            self._discovery.check_identity()
            self._discovery.check_exclusive()
            self._foreign.update()
