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
"""A simulated robot with its bridge, in its own process that a trial can freeze or kill."""

from __future__ import annotations

from pathlib import Path
import re
import subprocess
import sys

from benchmarks import ROOT
from program import environment, Program
from ros_support import BRIDGE

#: Matches the log line of the bridge for released manual control, and its time [s, system clock].
RELEASED = re.compile(r'\[([\d.]+)\] \[[\w./]+\]: manual control disabled')


class RobotProcess(Program):
    """
    The process of this package's bridge with a simulated robot, or of the slow bridge.

    :param namespace: the namespace of the robot
    :param domain: its ROS domain
    :param log: the file of the velocities that the slow bridge executes; None for this package's
        bridge
    """

    def __init__(self, namespace: str, domain: int, log: Path | None = None) -> None:
        bridge = [*BRIDGE, '--sim', '--with-parent', '--namespace', namespace]
        slow = [sys.executable, '-m', 'benchmarks.stop_matrix.slow_bridge', namespace, str(log)]
        # The bridge ends with this process, which holds the other end of its standard input.
        super().__init__(
            slow if log else bridge, cwd=ROOT, stdin=subprocess.PIPE,
            env=environment(ROS_DOMAIN_ID=str(domain)))

    def released_since(self, since: float) -> bool:
        """Return whether manual control was disabled after a time [s, system clock]."""
        return any(float(at) > since for at in RELEASED.findall(self.text))
