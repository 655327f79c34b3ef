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
"""A simulated robot with a gRPC server, and the bridge between it and ROS 2, as processes."""

from __future__ import annotations

import subprocess

from benchmarks import ROOT
from kachaka_simple_control.control import processes
from kachaka_simple_control.motion.geometry import Pose

#: How long each of the two may take to end [s].
EXIT_TIMEOUT = 3.0
#: How long the robot may take to respond [s].
RESPONSE_TIMEOUT = 5.0


class GrpcRobot:
    """
    ``kachaka_sim`` and ``kachaka_bridge --address``; ``end`` ends both.

    :param namespace: of the robot in ROS
    :param domain: the bridge's ROS domain
    :raises RuntimeError: if the robot does not start
    """

    def __init__(self, namespace: str, domain: int) -> None:
        self._domain = domain
        self._processes: list[subprocess.Popen[str]] = []
        robot = self._start('sim_command', '--grpc-port', '0')
        assert robot.stdout is not None
        # "ready: ... at HOST:PORT", or nothing if it ended.
        ready = robot.stdout.readline().split()
        if not ready:
            self.end()
            raise RuntimeError('the simulated robot did not start')
        #: of the robot, ``HOST:PORT``
        self.address = ready[-1]
        self._bridge = self._start(
            'bridge_command', '--address', self.address, '--namespace', namespace)

    def send(self, signum: int) -> None:
        """Send the bridge a signal."""
        self._bridge.send_signal(signum)

    def pose(self) -> Pose:
        """
        Request the odometry of the robot by gRPC; the heading is between -pi and pi.

        :raises RuntimeError: if it does not respond
        """
        from kachaka_simple_control.kachaka.grpc_client.address import Address
        from kachaka_simple_control.kachaka.grpc_client.client import RobotClient
        from kachaka_simple_control.ros import conversions
        client = RobotClient(Address.parse(self.address))
        result, response = client.odometry(0, RESPONSE_TIMEOUT)
        client.close()
        if response is None:
            raise RuntimeError(f'the robot does not say where it is: {result.text}')
        return conversions.pose(response.odometry)

    def end(self) -> None:
        """End both, the bridge first; harmless if they have ended."""
        for process in reversed(self._processes):
            process.terminate()
            try:
                process.wait(EXIT_TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            for pipe in (process.stdin, process.stdout):
                assert pipe is not None
                pipe.close()
        self._processes.clear()

    def _start(self, module: str, *options: str) -> subprocess.Popen[str]:
        # Only this process holds the other end of its standard input: it ends with us.
        process = subprocess.Popen(
            [*processes.python_command(f'kachaka_simple_control.kachaka.{module}'), *options,
             '--with-parent'],
            cwd=ROOT, env={**processes.child_environment(), 'ROS_DOMAIN_ID': str(self._domain)},
            text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            start_new_session=True)
        self._processes.append(process)
        return process
