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
"""What the tests of the real robot's bridge share: a robot over gRPC, and a publisher."""

from __future__ import annotations

import contextlib
from pathlib import Path
import subprocess
import sys
import threading
import time

from program import JsonProcess, Program
from ros_support import BridgeProcess


class FaultyRobot(JsonProcess):
    """The process of ``faulty_robot.py``, and commands to it."""

    def __init__(self):
        """Start the process."""
        super().__init__([sys.executable, str(Path(__file__).with_name('faulty_robot.py'))])
        self._lock = threading.Lock()
        self.address = f'127.0.0.1:{self.read()}'

    def ask(self, line):
        """Send a line, and return the response."""
        with self._lock:
            self.write(line)
            return self.read()

    def moves(self, since=0.0):
        """Return when it received motions [s]."""
        return [row[0] for row in self.ask('rows') if row[0] > since and row[1] and not row[3]]

    def stops(self, since=0.0):
        """Return when it received zeros [s]."""
        return [row[0] for row in self.ask('rows') if row[0] > since and not row[1]]

    @property
    def x(self):
        """Return its x [m]."""
        return self.ask('pose')[1]


class SimulatedRobot(Program):
    """The simulated robot over gRPC, which ends with us, and its address ``HOST:PORT``."""

    def __init__(self):
        """Start it at a free port."""
        super().__init__(
            [sys.executable, '-m', 'kachaka_simple_control.kachaka.sim_command',
             '--grpc-port', '0', '--with-parent'], stdin=subprocess.PIPE)
        self.wait_for_text('ready: ')
        self.address = self.text.split()[-1]


@contextlib.contextmanager
def real_bridge(address, *options):
    """Run a bridge to a robot for the length of a block, connected."""
    with BridgeProcess('--address', address, *options) as process:
        process.wait_for_text('ready')
        yield process


class Commander:
    """Publishes a velocity periodically, in a thread of its own."""

    def __init__(self, probe, publisher, rate=20.0):
        """Publish nothing yet."""
        self._probe, self._publisher, self._period = probe, publisher, 1.0 / rate
        self._linear = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def drive(self, linear):
        """Publish this from now on; None for nothing."""
        self._linear = linear
        return time.monotonic()

    def close(self):
        """End the thread."""
        self._over.set()
        self._thread.join()

    def _run(self):
        due = time.monotonic()
        while not self._over.is_set():
            if self._linear is not None:
                self._probe.send(self._publisher, self._linear)
            due += self._period
            self._over.wait(max(0.0, due - time.monotonic()))


@contextlib.contextmanager
def commander(probe, namespace, process, rate=20.0):
    """Run a commander that a bridge has matched, for the length of a block."""
    driver = Commander(probe, probe.publisher(namespace, process), rate)
    try:
        yield driver
    finally:
        driver.close()
