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

from kachaka_simple_control.control import processes

from benchmarks.process import ROOT

#: How long it may take to end [s].
PATIENCE = 2.0
#: What the bridge logs when manual control is given back, with the time [s, system clock].
RELEASED = re.compile(r'\[([\d.]+)\] \[[\w./]+\]: manual control disabled')


class RobotProcess:
    """The real bridge, or the slow one."""

    def __init__(self, namespace: str, domain: int, log: Path | None = None) -> None:
        """
        Start it.

        :param namespace: where the robot is
        :param domain: its ROS domain
        :param log: where the slow bridge tells what it plays; None for the real bridge
        """
        real = [*processes.python_command('kachaka_simple_control.kachaka.bridge_command'),
                '--sim', '--with-parent',
                '--namespace', namespace]
        slow = [sys.executable, '-m', 'benchmarks.stop_matrix.slow_bridge', namespace, str(log)]
        # To append: this process reads by the same opened file.
        self._log = tempfile.TemporaryFile('a+')  # noqa: SIM115 (as long as the process)
        # Its standard input is a pipe that only this process holds: it ends with us.
        self._process = subprocess.Popen(
            slow if log else real, cwd=ROOT, stdin=subprocess.PIPE,
            env={**processes.child_environment(), 'ROS_DOMAIN_ID': str(domain)}, stderr=self._log,
            start_new_session=True)

    def send(self, signum: int) -> None:
        """
        Send it a signal.

        :param signum: the signal
        """
        self._process.send_signal(signum)

    def given_back_since(self, since: float) -> bool:
        """
        Tell whether its manual control was switched off.

        :param since: after this time [s, system clock]
        :returns: whether it was, by its log
        """
        self._log.seek(0)
        return any(float(at) > since for at in RELEASED.findall(self._log.read()))

    def end(self) -> None:
        """End it; harmless if it is over."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.terminate()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()
