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
"""A simulated robot that speaks gRPC and the bridge that shows it to ROS 2, as processes."""

from __future__ import annotations

import subprocess

from kachaka_simple_control.control import processes
from kachaka_simple_control.motion.geometry import Pose

from benchmarks.process import ROOT

#: How long each of the two may take to end [s].
PATIENCE = 3.0
#: How long the robot may take to say where it is [s].
ANSWER = 5.0


class GrpcRobot:
    """``kachaka_sim`` and ``kachaka_bridge --address``; ``end`` leaves nothing of them."""

    def __init__(self, namespace: str, domain: int) -> None:
        """
        Start both.

        :param namespace: where the bridge shows the robot
        :param domain: the bridge's ROS domain
        :raises RuntimeError: if the robot does not start
        """
        self._domain = domain
        self._processes: list[subprocess.Popen[str]] = []
        robot = self._start('simulator.command', '--grpc-port', '0')
        assert robot.stdout is not None
        # "ready: ... at HOST:PORT", or nothing if it ended.
        ready = robot.stdout.readline().split()
        if not ready:
            self.end()
            raise RuntimeError('the simulated robot did not start')
        #: where the robot listens
        self.address = ready[-1]
        self._bridge = self._start(
            'bridge_command', '--address', self.address, '--namespace', namespace)

    def send(self, signum: int) -> None:
        """
        Send the bridge a signal.

        :param signum: the signal
        """
        self._bridge.send_signal(signum)

    def pose(self) -> Pose:
        """
        Ask the robot itself where it is by its odometry.

        :returns: the pose, its heading between -pi and pi
        :raises RuntimeError: if it does not tell
        """
        from kachaka_simple_control.kachaka.grpc_client.address import Address
        from kachaka_simple_control.kachaka.grpc_client.client import RobotClient
        from kachaka_simple_control.ros import conversions
        client = RobotClient(Address.parse(self.address))
        outcome, answer = client.odometry(0, ANSWER)
        client.close()
        if answer is None:
            raise RuntimeError(f'the robot does not say where it is: {outcome.text}')
        return conversions.pose(answer.odometry)

    def end(self) -> None:
        """End both, the bridge first; harmless if they are over."""
        for process in reversed(self._processes):
            process.terminate()
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            for pipe in (process.stdin, process.stdout):
                assert pipe is not None
                pipe.close()
        self._processes.clear()

    def _start(self, module: str, *options: str) -> subprocess.Popen[str]:
        # Its standard input is a pipe that only this process holds: it ends with us.
        process = subprocess.Popen(
            [*processes.python_command(f'kachaka_simple_control.kachaka.{module}'), *options,
             '--with-parent'],
            cwd=ROOT, env={**processes.child_environment(), 'ROS_DOMAIN_ID': str(self._domain)},
            text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            start_new_session=True)
        self._processes.append(process)
        return process
