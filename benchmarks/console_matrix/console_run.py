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
"""The console with a simulated robot, in its own ROS domain, and an independent observer."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import sys
import time

from benchmarks import ROOT
from benchmarks.console_matrix.proxy import Proxy
from benchmarks.stop_matrix.observer import Observer
from kachaka_simple_control.process.processes import is_running
from program import children_of, environment, Program
from ros_domain import claim_domain, release_domain
from waiting import poll, wait_until

COMMAND = [sys.executable, '-m', 'kachaka_simple_control.console.console_command']
OPTIONS = ['--sim', '--no-browser', '--port=0', f'--allow-host={Proxy.ADDRESS}']
#: How long console and robot may take to start [s].
START_TIMEOUT = 40.0
#: How long the console has to end by itself [s].
EXIT_TIMEOUT = 12.0


class ConsoleRun:
    """A console with its drive process and robot, the proxy before it, and the observer."""

    def __init__(self, *options: str) -> None:
        self.domain = claim_domain()
        self.observer = Observer(self.domain)
        self.recorder = self.observer.record('kachaka')
        self.program = Program(
            [*COMMAND, *OPTIONS, *options], cwd=ROOT,
            env=environment(ROS_DOMAIN_ID=str(self.domain)))
        self.program.wait_for_text('ready: ', START_TIMEOUT)
        wait_until(lambda: self.program.text.count('\n') > len(options))
        found = re.search(r'ready: http://[^:/]+:(\d+)/(?:\?token=(\S+))?', self.program.text)
        assert found is not None, self.program
        self.port = int(found[1])
        #: the tokens of the links; empty without the option ``--token``
        self.driver = found[2] or ''
        viewer = re.search(r'to look and stop only: \S+token=(\S+)', self.program.text)
        self.viewer = viewer[1] if viewer else ''
        self.proxy = Proxy(self.port)

    @property
    def address(self) -> str:
        """Return the address of the page, through the proxy."""
        return f'http://{Proxy.ADDRESS}:{self.port}/'

    @property
    def is_alive(self) -> bool:
        """Return whether the console runs."""
        return not self.program.is_over

    def processes(self) -> list[int]:
        """Return the ids of all processes that the console has started, and theirs."""
        return descendants(self.program.process.pid)

    def signal(self, signum: int) -> float:
        """Send a signal to the console, and to no other process; return when [s]."""
        return float(self.program.send(signum))

    def kill(self) -> tuple[float, list[int]]:
        """Kill the console; return when [s, system clock], and what it has started."""
        children = self.processes()
        return self.signal(signal.SIGKILL), children

    def close(self) -> None:
        """End the console and all that it has started."""
        children = self.processes()
        if self.is_alive:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGINT)
            with contextlib.suppress(Exception):
                self.program.process.wait(EXIT_TIMEOUT)
        end_processes(children, 2.0)
        self.program.close()
        self.proxy.close()
        self.observer.close()
        release_domain(self.domain)


def descendants(pid: int) -> list[int]:
    """Return the ids of the children of a process, and of theirs, from the top down."""
    found: list[int] = children_of(pid)
    for child in tuple(found):
        found += descendants(child)
    return found


def end_processes(pids: list[int], timeout: float) -> list[int]:
    """Wait for the end of processes, and kill those that do not end."""
    poll(lambda: not any(map(is_running, pids)), timeout, 0.02)
    left = [*filter(is_running, pids)]
    for pid in left:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return left


def time_until(condition: object, began: float, timeout: float) -> float | None:
    """Return how long a condition took to become true [s]; None if it did not."""
    assert callable(condition)
    return time.time() - began if poll(condition, began + timeout - time.time()) else None
