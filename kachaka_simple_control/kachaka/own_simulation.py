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
"""The simulated robot that ``KachakaSimpleControl(sim=True)`` starts."""

from __future__ import annotations

import gc
from typing import ClassVar

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.robot_profile import RobotProfile
from kachaka_simple_control.kachaka.bridge_process import BridgeProcess
from kachaka_simple_control.report.text_tables import drive_table, terminal_columns
from kachaka_simple_control.ros.dds_transport import (
    can_still_be_localhost_only,
    is_range_chosen,
    use_localhost_only,
)
import rclpy
from rclpy.node import Node


def start_on_this_machine(own: Node) -> None:
    """
    Restrict ROS to this machine, and initialise ROS if needed.

    A simulated robot has the same names as a real robot.  If other machines could see it, their
    drives of a real robot would end.

    :param own: the node that is being created
    :raises UsageError: if it is too late to restrict ROS to this machine
    """
    if rclpy.ok() and not is_range_chosen():
        # rclpy has already read its environment variables.  Only the DDS profile is read later,
        # when the first node is created.
        others = (found for found in gc.get_objects()
                  if issubclass(type(found), Node) and found is not own)
        if not can_still_be_localhost_only() or next(others, None) is not None:
            raise UsageError(
                'sim=True comes too late to keep the simulated robot on this machine: make this '
                'node first, before rclpy.init(), which it then calls itself; or set '
                'ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST (on Humble ROS_LOCALHOST_ONLY=1)')
    use_localhost_only()
    if not rclpy.ok():
        rclpy.init()


class OwnSimulation:
    """
    A simulated robot in a child process, and the table of results printed at its end.

    :param profile: the robot that the node drives
    :param namespace: the ROS namespace of the robot
    :raises UsageError: if the node does not drive a Kachaka, or if an earlier node of this program
        still has a simulated robot in the namespace
    """

    #: the namespaces of the running robots
    _running: ClassVar[set[str]] = set()

    def __init__(self, profile: RobotProfile, namespace: str) -> None:
        if not profile.is_kachaka:
            raise UsageError(f'sim=True starts a simulated kachaka, not a {profile.name}')
        if namespace in self._running:
            raise UsageError(
                f'an earlier node of this program has the simulated robot {namespace}: call its '
                'destroy_node() first, or choose another robot_namespace')
        self._running.add(namespace)
        self._namespace = namespace
        self._bridge: BridgeProcess | None = BridgeProcess(['--sim', '--namespace', namespace])
        #: returns the robot's DDS participant, for ``Session.require_robot()``
        self.require_participant = self._bridge.require_participant

    def end(self, drive_log: DriveLog, stop_confirmed_after: float | None) -> None:
        """
        End the robot, and print a table of the requested, sent and driven motions.

        A second call has no effect.

        :param drive_log: the log of the drive
        :param stop_confirmed_after: the time from the stop to the standstill in odometry [s]; None
            if odometry did not show a standstill
        """
        bridge, self._bridge = self._bridge, None
        if bridge is None:
            return
        bridge.end()
        self._running.discard(self._namespace)
        if drive_log.steps:
            print(drive_table(drive_log, stop_confirmed_after, terminal_columns()), flush=True)
