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
"""A simulated robot behind its bridge, in a process of its own that may be frozen or killed."""

from __future__ import annotations

from pathlib import Path
import re
import subprocess
import sys
import tempfile

from benchmarks import ROOT
from kachaka_simple_control.control import processes

#: How long it may take to end [s].
EXIT_TIMEOUT = 2.0
#: What the bridge logs when manual control is released, with the time [s, system clock].
RELEASED = re.compile(r'\[([\d.]+)\] \[[\w./]+\]: manual control disabled')


class RobotProcess:
    """
    The bridge of the package with its simulated robot, or the slow bridge.

    :param namespace: of the robot
    :param domain: its ROS domain
    :param log: where the slow bridge writes the velocities it executes; None for the package's
    """

    def __init__(self, namespace: str, domain: int, log: Path | None = None) -> None:
        bridge = [*processes.python_command('kachaka_simple_control.kachaka.bridge_command'),
                  '--sim', '--with-parent', '--namespace', namespace]
        slow = [sys.executable, '-m', 'benchmarks.stop_matrix.slow_bridge', namespace, str(log)]
        # Append mode: this process reads from the same open file.
        self._log = tempfile.TemporaryFile('a+')  # noqa: SIM115 (as long as the process)
        # Only this process holds the other end of its standard input: it ends with us.
        self._process = subprocess.Popen(
            slow if log else bridge, cwd=ROOT, stdin=subprocess.PIPE,
            env={**processes.child_environment(), 'ROS_DOMAIN_ID': str(domain)}, stderr=self._log,
            start_new_session=True)

    def send(self, signum: int) -> None:
        """Send it a signal."""
        self._process.send_signal(signum)

    def released_since(self, since: float) -> bool:
        """Return whether manual control was disabled after a time [s, system clock]."""
        self._log.seek(0)
        return any(float(at) > since for at in RELEASED.findall(self._log.read()))

    def end(self) -> None:
        """End it; harmless if it has ended."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.terminate()
        try:
            self._process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()
