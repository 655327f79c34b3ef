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
"""Keys at the terminal of a drive: they pause, resume, change the speed and stop."""

import os
import signal
import sys
import termios

from kachaka_simple_control.display import terminal
from kachaka_simple_control.display.terminal import LINE_MODES, LOCAL_MODES
from kachaka_simple_control.errors import MotionRefusedError
from program import COMMAND
import pytest
from terminals import at_terminal

pytestmark = [pytest.mark.ros, pytest.mark.needs('rich', 'rclpy', 'nav_msgs', 'jsonschema')]

MOTION = """\
name: long
rate: 20 Hz
steps:
  - repeat:
      times: 20
      steps:
        - forward: 1 m
        - turn: 180 deg
"""
#: Runs a command in the background of the terminal, and in its foreground after SIGUSR1.
SHELL = """
import os, signal, sys
job = os.fork()
if job == 0:
    os.setpgid(0, 0)
    os.execv(sys.argv[1], sys.argv[1:])
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
signal.signal(signal.SIGUSR1, lambda *_: os.tcsetpgrp(0, os.getpgid(job)))
while True:
    _, status = os.waitpid(job, os.WUNTRACED)
    if os.WIFSTOPPED(status):
        print('SUSPENDED', flush=True)
    else:
        os.tcsetpgrp(0, os.getpgrp())
        sys.exit(os.waitstatus_to_exitcode(status))
"""


@pytest.fixture
def motion(tmp_path):
    """Return the path of a long motion."""
    file = tmp_path / 'long.yaml'
    file.write_text(MOTION)
    return str(file)


def collects_lines(shown):
    """Return whether the terminal collects lines and shows what is typed."""
    return termios.tcgetattr(shown.leader)[LOCAL_MODES] & LINE_MODES == LINE_MODES


def test_keys_pause_resume_change_the_speed_and_stop(motion):
    with at_terminal([*COMMAND, motion, '--sim'], 130, 30) as shown:
        shown.wait_for_text('space pauses, + - speed, q stops')
        shown.wait_for_text('DRIVING   step 1 of 40')
        assert not collects_lines(shown)
        shown.press(b' ')
        shown.wait_for_text('PAUSED   step 1 of 40: forward 1 m')
        shown.wait_for_text('r resumes, + - speed, q stops')
        shown.wait_for_text('odometry     0.000 m/s')
        shown.press(b' --x')
        shown.wait_for_text('PAUSED   step 1 of 40: forward 1 m (speed 80 %)')
        shown.press(b'r')
        shown.wait_for_text('DRIVING   step 1 of 40: forward 1 m (speed 80 %)')
        shown.press(b'++')
        shown.wait_for_text('step 2 of 40: turn 180 deg', 30.0)
        assert not any('%)' in line for line in shown.screen.lines)
        shown.press(b'q')
        assert shown.end() == 130
        assert collects_lines(shown)


def test_in_the_background_nothing_is_read_and_nothing_is_suspended(motion):
    command = [sys.executable, '-c', SHELL, *COMMAND, motion, '--sim']
    with at_terminal(command, 130, 30) as shown:
        shown.wait_for_text('` stops the robot')
        shown.wait_for_text('DRIVING')
        assert collects_lines(shown)
        shown.press(b' ')  # for the shell
        shown.read_for(1.0)
        assert not any('PAUSED' in line or 'SUSPENDED' in line for line in shown.screen.lines)
        os.kill(shown.process.pid, signal.SIGUSR1)  # fg
        shown.wait_for_text('+ - speed, q stops')
        shown.press(b' ')
        shown.wait_for_text('PAUSED')
        shown.press(b'q')
        assert shown.end() == 130
        assert collects_lines(shown)


def test_a_pause_before_the_start_is_shown_and_holds_the_motion(motion):
    with at_terminal([*COMMAND, motion, '--sim', '--wait'], 130, 30) as shown:
        shown.wait_for_text('space pauses, + - speed, q stops')
        shown.press(b' ')
        shown.wait_for_text('r resumes, + - speed, q stops')
        shown.press(b'\n')
        shown.wait_for_text('The motion is held at its start (paused): resume to go on')
        shown.wait_for_text('PAUSED   step 1 of 40')
        shown.press(b'r')
        shown.wait_for_text('DRIVING   step 1 of 40')
        shown.press(b'q')
        assert shown.end() == 130


def test_an_enter_that_was_typed_before_starts_no_motion(motion):
    with at_terminal([*COMMAND, motion, '--sim', '--wait'], 130, 30) as shown:
        shown.press(b'\n\n')
        shown.wait_for_text('Standing by: Enter starts the motion')
        shown.read_for(2.0)
        assert 'DRIVING' not in str(shown)
        shown.press(b'\n')
        shown.wait_for_text('DRIVING   step 1 of 40')
        shown.press(b'q')
        assert shown.end() == 130


def test_the_warning_of_a_key_that_is_held_comes_once(monkeypatch):
    def refuse():
        raise MotionRefusedError('the robot was moved')

    warnings = []
    keyboard = terminal.Keyboard({'r': refuse}, warnings.append)
    monkeypatch.setattr(terminal.os, 'read', lambda *_: b'rrr')
    for _ in range(3):
        assert keyboard._read('')
    assert warnings == ['the robot was moved']
    keyboard._warned -= terminal.WARN_PERIOD
    keyboard._read('')
    assert warnings == 2 * ['the robot was moved']
