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
"""Start a simulated robot with a gRPC server and its bridge to ROS 2, as two processes."""

from __future__ import annotations

import math
import subprocess

from grpc_client_support import SimulatedRobot
from kachaka_simple_control.motion.geometry import Pose
from program import environment
from ros_support import BridgeProcess

#: The longest response time of the robot [s].
RESPONSE_TIMEOUT = 5.0


class GrpcRobot:
    """
    The processes ``kachaka_sim`` and ``kachaka_bridge --address``; ``close`` ends both.

    :param namespace: the ROS namespace of the robot
    :param domain: the bridge's ROS domain
    :raises AssertionError: if the robot does not start
    """

    def __init__(self, namespace: str, domain: int) -> None:
        self._robot = SimulatedRobot()
        #: the address of the robot, ``HOST:PORT``
        self.address = self._robot.address
        # The bridge ends with this process, which holds the other end of its standard input.
        self._bridge = BridgeProcess(
            '--address', self.address, '--namespace', namespace, '--with-parent',
            stdin=subprocess.PIPE, env=environment(ROS_DOMAIN_ID=str(domain)))

    def send(self, signum: int) -> float:
        """Send the bridge a signal; return the time of the signal [s, system clock]."""
        return self._bridge.send(signum)

    def pose(self) -> Pose:
        """
        Request the odometry of the robot over gRPC; the heading is between -pi and pi.

        :raises RuntimeError: if the robot does not respond
        """
        from kachaka_simple_control.kachaka.grpc_client.client import RobotClient
        from kachaka_simple_control.kachaka.program import Address
        client = RobotClient(Address.parse(self.address))
        result, response = client.odometry(0, RESPONSE_TIMEOUT)
        client.close()
        if response is None:
            raise RuntimeError(f'the robot does not say where it is: {result.text}')
        pose = response.odometry.pose.pose
        theta = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        return Pose(pose.position.x, pose.position.y, math.remainder(theta, math.tau))

    def close(self, timeout: float = 0.0, signum: int = 0) -> None:
        """End both processes, the bridge first; do nothing if they have ended."""
        for process in (self._bridge, self._robot):
            process.close(timeout, signum)
