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
"""What goes along with a run, and ends it when something is wrong."""

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
    Called by a run after each message, and at least every 20 ms; each call is short.

    :param guardian: who is shown signs of life
    :param renewal: what keeps manual control
    :param link: what the graph tells of the robot
    :param foreign: listens while others have a publisher of velocities
    :param odometry: what odometry tells
    :param odometry_timeout: how long odometry may be silent [s]; 0 for ever
    :param needs_renewal: whether this robot needs manual control at all
    """

    def __init__(
            self, guardian: Guardian | NullGuardian, renewal: LeaseRenewer, link: RobotDiscovery,
            foreign: ForeignMessages, odometry: StandstillDetector, odometry_timeout: float,
            needs_renewal: bool) -> None:
        """Have looked at nothing yet."""
        self._guardian = guardian
        self._renewal = renewal
        self._link = link
        self._foreign = foreign
        self._odometry = odometry
        self._odometry_timeout = odometry_timeout
        self._needs_renewal = needs_renewal
        self._looked = self._glanced = self._listened = float('-inf')

    def on_connected(self) -> None:
        """Take note that a robot has just been met."""
        self._link.remember_robot()

    def on_sent(self, rest: float) -> None:
        """
        Renew manual control when it is time to.

        :param rest: how long the plan stays at rest from here [s]; 0 while moving
        """
        if self._needs_renewal:
            self._renewal.on_sent(time.monotonic(), rest)

    def check(self) -> None:
        """
        Show a sign of life, and look around.

        :raises RunFaultError: if the run must end
        """
        now = time.monotonic()
        self._guardian.heartbeat()
        self._renewal.poll(now)
        if now - self._listened >= SUBSCRIBER_CHECK_PERIOD:
            self._listened = now
            self._link.check_subscribed()
        self._require_odometry(now)
        if now - self._glanced >= GRAPH_COUNT_PERIOD:
            self._glanced = now
            self._look(now)

    def has_lost_robot(self, now: float) -> bool:
        """
        Tell whether odometry has fallen silent, which was heard at least once.

        :param now: the time [s]
        :returns: whether it has been silent for longer than it may
        """
        silence = self._odometry.age(now)
        if silence is None or not self._odometry_timeout:
            return False
        return silence > self._odometry_timeout

    def _look(self, now: float) -> None:
        if self._link.has_changed() or now - self._looked >= GRAPH_CHECK_PERIOD:
            self._looked = now
            self._link.check_identity()
            self._link.check_exclusive()
            self._foreign.update()

    def _require_odometry(self, now: float) -> None:
        if self.has_lost_robot(now):
            silence = self._odometry.age(now)
            raise RunFaultError(
                f'odometry has been silent for {silence:.1f} s: the robot or the link to it is '
                'lost')
