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
"""The bridge process: it runs for a block, and ends after it whatever happens."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

from kachaka_simple_control.errors import ControlError, RobotNotFoundError
from kachaka_simple_control.kachaka import bridge_process as module
from kachaka_simple_control.kachaka.bridge_process import simulated_bridge
from kachaka_simple_control.process import processes
from program import environment, ROOT
import pytest
from waiting import TIMEOUT, wait_until

needs_ros = pytest.mark.ros
#: Programs in place of the bridge, for what needs no ROS.
SLEEPING = 'import time; time.sleep(60)'
DEAF = (
    'import signal, sys, time; signal.signal(15, signal.SIG_IGN); '
    'print("deaf", file=sys.stderr, flush=True); time.sleep(60)')
FAILING = 'import sys; sys.exit("first\\nlast words")'

PARENT = """
import subprocess, sys, time
from kachaka_simple_control.kachaka.bridge_process import simulated_bridge
with simulated_bridge('/orphan') as process:
    sleeper = subprocess.Popen(['sleep', '60'], close_fds=False, stdout=subprocess.DEVNULL)
    print(process.pid, sleeper.pid, 'rclpy' in sys.modules, flush=True)
    time.sleep(60)
"""

#: A signal comes before the bridge serves; serving no node would raise an error.
ENDED_EARLY = """
import os, signal
from kachaka_simple_control.process.signals import ShutdownEvent
from kachaka_simple_control.kachaka.bridge_command import _serve
with ShutdownEvent() as shutdown:
    assert not shutdown.is_set
    os.kill(os.getpid(), signal.SIGINT)
    _serve(None, shutdown, False)
"""


@pytest.fixture
def stand_in(monkeypatch):
    """Return a function that puts another program in the bridge's place."""
    return lambda program: monkeypatch.setattr(processes, 'MAIN_CODE', program)


@needs_ros
def test_a_bridge_that_gets_a_signal_while_it_starts_is_never_ready():
    ended = subprocess.run(
        [sys.executable, '-c', ENDED_EARLY], check=False, cwd=ROOT, env=environment(),
        capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, '', '')


def test_process_runs_for_the_block_and_ends_after_it(stand_in):
    """In a session of its own, out of reach of the terminal's Ctrl+C."""
    stand_in(SLEEPING)
    with simulated_bridge() as process:
        process.check()
        assert os.getsid(process.pid) == process.pid != os.getsid(0)
    assert not processes.is_running(process.pid)


def test_process_that_ignores_sigterm_is_killed(stand_in, monkeypatch):
    """After the exit timeout."""
    stand_in(DEAF)
    monkeypatch.setattr(module, 'EXIT_TIMEOUT', 0.3)
    with simulated_bridge() as process:
        assert wait_until(lambda: process._last_line == 'deaf')
        asked = time.monotonic()
    assert not processes.is_running(process.pid)
    assert time.monotonic() - asked < TIMEOUT


def run_until_over(error=None, options=()):
    """Run a block that waits until the process has ended, and may raise."""
    with simulated_bridge(options=options) as process:
        assert wait_until(lambda: process.is_over)
        if error is not None:
            raise error


def test_early_end_is_an_error_with_its_last_line(stand_in):
    """Each ``check`` raises the same error."""
    stand_in(FAILING)
    process = module.BridgeProcess([])
    assert wait_until(lambda: process.is_over)
    with pytest.raises(ControlError, match=r'ended early \(exit code 1\): last words') as caught:
        process.check()
    with pytest.raises(ControlError, match='last words') as again:
        process.check()
    assert caught.value is again.value
    process.end()


@pytest.mark.parametrize('error', [None, RobotNotFoundError('nobody listens')])
def test_early_end_replaces_the_error_of_the_block(stand_in, error):
    """It is the reason of that error, and is raised without one, too."""
    stand_in(FAILING)
    with pytest.raises(ControlError, match='last words') as caught:
        run_until_over(error)
    assert caught.value.__cause__ is error


@needs_ros
@pytest.mark.parametrize('folder', [ROOT / 'kachaka_simple_control', ROOT / 'test'])
def test_death_of_the_parent_ends_the_robot(folder):
    """Even while another child of the parent lives on; from any folder, without ROS in it."""
    pytest.importorskip('rclpy')
    parent = subprocess.Popen(
        [sys.executable, '-c', 'import sys; del sys.path[0]\n' + PARENT], cwd=folder,
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    robot, sleeper, has_ros = parent.stdout.readline().split()
    try:
        assert 'ready' in parent.stderr.readline()
        assert has_ros == 'False'
        parent.send_signal(signal.SIGKILL)
        parent.wait(TIMEOUT)
        assert wait_until(lambda: not processes.is_running(robot), 3.0)
        assert processes.is_running(sleeper)
    finally:
        parent.kill()
        os.kill(int(sleeper), signal.SIGKILL)
        parent.stdout.close()
        parent.stderr.close()
