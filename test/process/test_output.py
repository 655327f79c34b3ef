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
"""Output without a reader delays neither the robot's stop nor the program's exit."""

import os
import pty
import select
import signal
import socket
import subprocess
import sys
import time

from kachaka_simple_control.process.output import FLUSH_TIMEOUT
from kachaka_simple_control.process.processes import is_running
from program import COMMAND, environment, fill, Program, QUICK_COMMAND, quick_drive
import pytest
from terminals import at_terminal
from waiting import wait_until

pytestmark = pytest.mark.real_time

BEGIN = """
import os, sys, time
from kachaka_simple_control.process.output import make_nonblocking
"""


class Piped(Program):
    """A program whose output, or the streams named, go to a pipe that may be left unread."""

    def __init__(self, command, *full):
        """Start it; what does not go to the pipe goes to a file."""
        self.reader, self._pipe = os.pipe()
        super().__init__(
            command, **dict.fromkeys(full or ('stdout', 'stderr'), self._pipe),
            # A buffer is what Python has to empty in the end.
            env=environment(PYTHONUNBUFFERED=''))

    def fill(self):
        """Fill the pipe."""
        fill(self._pipe)

    def read(self):
        """Return what the program and its children wrote, once they are gone."""
        self._close('_pipe')
        text = b''
        while select.select([self.reader], [], [], 5.0)[0] and (
                part := os.read(self.reader, 65536)):
            text += part
        return text.decode()

    def close(self, timeout=0.0, signum=0):
        """End it and its children, and close the pipe."""
        super().close(timeout, signum)
        self._close('_pipe')
        self._close('reader')

    def _close(self, name):
        descriptor = getattr(self, name)
        setattr(self, name, -1)
        if descriptor >= 0:
            os.close(descriptor)


def code(text):
    """Return the command that runs a program."""
    return [sys.executable, '-c', BEGIN + text]


def run(text, **options):
    """Run a program to its end."""
    return subprocess.run(code(text), env=environment(), timeout=20.0, check=True, **options)


def test_unread_text_is_dropped_after_one_wait():
    begun = time.monotonic()
    with Piped(code("""
make_nonblocking(1, 2)
for line in range(2000):
    print('x' * 99)
    print('y' * 99, file=sys.stderr)
sys.exit(7)
""")) as started:
        assert started.end(20.0) == 7
    assert time.monotonic() - begun < 2 * FLUSH_TIMEOUT + 2.0


def test_a_slow_reader_receives_everything():
    with Piped(code("""
make_nonblocking(1, 2)
for line in range(5000):
    print(f'{line:09}\\n', end='')
    print(f'{line:09}\\n', end='', file=sys.stderr, flush=True)
""")) as started:
        time.sleep(FLUSH_TIMEOUT)
        lines = started.read().split()
    assert sorted(lines) == sorted(2 * [f'{line:09}' for line in range(5000)])


def test_the_terminal_or_pipe_of_a_shell_stays_blocking():
    """The flag belongs to all that share an open file."""
    leader, follower = pty.openpty()
    reader, writer = os.pipe()
    for shared in (follower, writer):
        run("""
make_nonblocking(1, 2)
assert not os.get_blocking(1) and not os.get_blocking(2)
assert os.get_blocking(0)
""", stdin=shared, stdout=shared, stderr=shared)
        assert os.get_blocking(shared)
    for descriptor in (leader, follower, reader, writer):
        os.close(descriptor)


def test_a_socket_is_blocking_again_in_the_end():
    """It cannot be opened anew, so that it is non-blocking for all that share it meanwhile."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        run("""
make_nonblocking(2)
assert not os.get_blocking(2)
print('x' * 10 ** 6)
print('y' * 10 ** 6, file=sys.stderr)
""", stdout=theirs, stderr=theirs)
        assert os.get_blocking(theirs.fileno())


def test_files_are_left_as_they_are(tmp_path):
    """Opened anew, one would be written from its beginning."""
    file = tmp_path / 'log.txt'
    with file.open('w') as log:
        log.write('before\n')
        log.flush()
        run("""
make_nonblocking(1, 2)
assert os.get_blocking(1) and os.get_blocking(2)
print('after')
""", stdout=log, stderr=log)
    assert file.read_text() == 'before\nafter\n'


needs_ros = pytest.mark.ros
SCRIPT = """
import sys, threading, time
import rclpy
from kachaka_simple_control import KachakaSimpleControl
rclpy.init()
node = KachakaSimpleControl()
"""
#: How long a program may take to end [s].
SOON = 8.0


def assert_stopped_and_released(listener, since):
    """Assert that the whole stop was sent, and manual control released."""
    zeros = [velocity.time for velocity in listener.received
             if not velocity.moves and velocity.time > since]
    assert len(zeros) >= 15
    assert zeros[-1] - zeros[0] > 0.35
    assert len(listener.released) == 1
    assert listener.released[0] > zeros[-1]


def moving(listener):
    """Wait until the robot moves; return the time [s, system clock]."""
    listener.wait_for(lambda velocity: velocity.moves)
    time.sleep(0.2)
    return time.time()


@needs_ros
def test_ros_s_logger_does_not_block_python():
    """It writes in C, and keeps the interpreter's lock meanwhile."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    with Piped([sys.executable, '-c', SCRIPT + """
beats = [time.monotonic()]
def beat():
    while True:
        time.sleep(0.02)
        beats.append(time.monotonic())
threading.Thread(target=beat, daemon=True).start()
print('ready', flush=True)
time.sleep(1.0)
node.get_logger().info('for nobody')
time.sleep(0.1)
print('gap', max(two - one for one, two in zip(beats, beats[1:])), flush=True)
"""], 'stderr') as started:
        started.wait_for_text('ready')
        started.fill()
        assert started.end(20.0) == 0
    assert float(started.text.split()[-1]) < 0.5


@needs_ros
@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize('signum, code', [(None, 0), (signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_the_command_stops_the_robot_and_exits_without_a_reader(
        listener, tmp_path, signum, code):
    with Piped(quick_drive(tmp_path, duration=2.0)) as started:
        moved = moving(listener)
        started.fill()
        if signum is not None:
            started.process.send_signal(signum)
        assert started.end(SOON) == code
    assert_stopped_and_released(listener, moved)


@needs_ros
def test_the_result_and_the_last_line_delay_no_exit(tmp_path):
    """With --sim a table follows; without a robot, an error line."""
    pytest.importorskip('rclpy', reason='needs ROS 2')
    pytest.importorskip('nav_msgs', reason='needs nav_msgs')
    pytest.importorskip('jsonschema', reason='needs jsonschema')
    pytest.importorskip('jinja2', reason='needs Jinja2')
    report = tmp_path / 'report'
    with Piped(quick_drive(tmp_path, '--sim', '--report', str(report))) as started:
        os.read(started.reader, 4096)
        started.fill()
        assert started.end(40.0) == 0
    assert (report / 'report.html').exists()
    with Piped([*QUICK_COMMAND, '-p', 'robot_timeout:=1.0']) as started:
        os.read(started.reader, 4096)
        started.fill()
        assert started.end(12.0) == 3


@needs_ros
@pytest.mark.parametrize('text', [
    # In the middle of a print, and with some text left for Python to print in the end.
    'while True:\n    print("x" * 99)',
    'time.sleep(2.0)\nfor line in range(40):\n    print("x" * 99)\ntime.sleep(30.0)'])
def test_a_print_that_waits_for_its_reader_does_not_delay_ctrl_c(listener, text):
    with Piped([sys.executable, '-c', SCRIPT + f"""
threading.Thread(target=node.move_robot, args=(0.1, 0.0, 30.0), daemon=True).start()
{text}
"""], 'stdout') as started:
        moved = moving(listener)
        started.fill()
        time.sleep(2.5)
        started.process.send_signal(signal.SIGINT)
        assert started.end(SOON) == 130
    assert_stopped_and_released(listener, moved)


@needs_ros
def test_after_ctrl_s_a_drive_ends_and_leaves_the_terminal_clean(listener):
    pytest.importorskip('rich', reason='needs rich')
    with at_terminal([*COMMAND, 'square'], 130, 30) as shown:
        shown.wait_for_text('DRIVING')
        display = shown.display()
        shown.press(b'\x13')
        time.sleep(1.0)
        interrupted = time.time()
        shown.process.send_signal(signal.SIGINT)
        assert shown.process.wait(SOON) == 130
        assert_stopped_and_released(listener, interrupted)
        shown.press(b'\x11')
        shown.read_for(1.0)
        assert shown.screen.bottom == shown.screen.rows
        assert shown.screen.cursor_is_shown
        assert not any('Ctrl+C' in line for line in shown.screen.lines)
        wait_until(lambda: not is_running(display), 5.0)
