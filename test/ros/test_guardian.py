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
"""What no handler can catch: killed, frozen, crashed. The guardian stops the robot."""

import os
import re
import signal
import subprocess
import time

from kachaka_simple_control.errors import HELD_UP_ADVICE
from kachaka_simple_control.process.processes import is_running, is_stopped
from program import children_of, COMMAND, find_process, program, script
import pytest
from waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy')]

BEGIN = """
import os, signal, sys, time
import rclpy
from kachaka_simple_control import KachakaSimpleControl
rclpy.init(args=['--ros-args', '-p', 'robot_timeout:=60.0'])
node = KachakaSimpleControl()
"""


def zeros_after(listener, since):
    """Return the times of the zeros that followed, and assert that no motion came after them."""
    time.sleep(1.0)
    after = [velocity for velocity in listener.received if velocity.time > since]
    zeros = [velocity.time for velocity in after if not velocity.moves]
    assert zeros
    assert not [velocity for velocity in after if velocity.moves and velocity.time > zeros[0]]
    return zeros


def assert_whole_stop(zeros):
    """Assert that the stop was front-loaded, and longer than the command timeout."""
    assert zeros[9] - zeros[0] < 0.2
    assert zeros[-1] - zeros[0] > 0.35


def guardian_of(started):
    """Return the process id of the guardian of a program."""
    guardian = find_process(children_of(started.process.pid), 'guardian_program')
    assert guardian is not None, 'it has no guardian'
    return guardian


@pytest.mark.parametrize('name, bound', [
    # The limits are 50 and 150 ms on a quiet machine; this one may be busy.
    ('SIGKILL', 0.25), ('SIGSEGV', 0.5), ('SIGQUIT', 0.5), ('SIGSTOP', 0.4)])
def test_the_robot_is_stopped_when_the_node_cannot(listener, tmp_path, name, bound):
    with program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        time.sleep(0.3)
        sent = started.send(signal.Signals[name])
        zeros = zeros_after(listener, sent)
        assert zeros[0] - sent < bound
        assert_whole_stop(zeros)


def test_the_guardian_does_not_outlive_its_node(listener, tmp_path):
    with program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        guardian = guardian_of(started)
        started.send(signal.SIGKILL)
        started.end()
        wait_until(lambda: not is_running(guardian), 3.0)


def test_a_frozen_node_is_stopped_once_and_sends_no_motion_when_it_resumes(listener, tmp_path):
    with program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        time.sleep(0.25)
        sent = started.send(signal.SIGSTOP)
        time.sleep(2.0)
        frozen = [velocity.time for velocity in listener.received if velocity.time > sent]
        assert frozen[-1] - frozen[0] < 0.7  # then silence: one stop, not a flood
        continued = started.send(signal.SIGCONT)
        assert started.end() == 1
    assert re.search(
        r'the guardian stopped the robot: the node sent no heartbeat for 0\.\d+ s: the program '
        f'was held up, {re.escape(HELD_UP_ADVICE)}', started.text)
    assert not [velocity for velocity in listener.received
                if velocity.moves and velocity.time > continued]
    assert len(listener.released) == 1


@pytest.mark.parametrize('hold_up', [
    'os.kill(os.getpid(), signal.SIGSTOP)',
    'import ctypes; ctypes.PyDLL(None).sleep(4)'])  # with the interpreter's lock, as C may do
def test_a_node_held_up_between_its_one_zero_and_its_whole_stop_is_stopped(
        listener, tmp_path, hold_up):
    text = BEGIN + f"""
node.move_robot(0.1, 0.0, 0.5)
{hold_up}
node.move_robot(0.1, 0.0, 0.5)
"""
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        time.sleep(3.5)
        end = max(velocity.time for velocity in listener.received if velocity.moves)
        zeros = [velocity.time for velocity in listener.received if velocity.time > end]
        assert zeros[0] - end < 0.4  # its own
        assert_whole_stop(zeros[1:])
        assert zeros[1] - zeros[0] < 1.5
        started.send(signal.SIGCONT)
        assert started.end() == 1
    assert 'the guardian stopped the robot: the node sent no heartbeat' in started.text
    assert len(listener.moves()) == 1


SLOW_GRAPH = """
import ctypes, threading, time
wait = ctypes.PyDLL(None).usleep  # as rclpy asks the graph: no other thread of Python runs
def slow(ask, seconds):
    def asked(*args):
        wait(int(seconds * 1e6))
        return ask(*args)
    return asked
"""


@pytest.mark.parametrize('change', [
    pytest.param('node.robot.gate._sending.clear = lambda: None', id='publishing'),
    pytest.param("""
node.robot.discovery.has_changed = slow(node.robot.discovery.has_changed, 0.045)
""", id='in a graph query')])
def test_a_frozen_node_is_not_taken_for_slow_dds(change, listener, tmp_path):
    """While it publishes, its flag stays up: no third of a second of DDS."""
    text = f'{BEGIN}{SLOW_GRAPH}{change}\nnode.move_robot(0.1, 0.0, 20.0)\n'
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        time.sleep(0.25)
        sent = started.send(signal.SIGSTOP)
        assert zeros_after(listener, sent)[0] - sent < 0.4


def test_a_process_is_frozen_from_sigstop_to_sigcont():
    with subprocess.Popen(['sleep', '20']) as process:
        assert not is_stopped(process.pid)
        for signum, frozen in ((signal.SIGSTOP, True), (signal.SIGCONT, False)):
            process.send_signal(signum)
            wait_until(lambda frozen=frozen: is_stopped(process.pid) == frozen, 3.0)
        process.kill()
    assert not is_stopped(process.pid)


def test_the_run_ends_when_the_guardian_is_killed(listener, tmp_path):
    with program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        os.kill(guardian_of(started), signal.SIGKILL)
        killed = time.time()
        assert started.end() == 1
    assert 'the guardian is gone' in started.text
    assert zeros_after(listener, killed)[0] - killed < 0.5


def test_a_guardian_that_is_terminated_stops_the_robot_first(listener, tmp_path):
    with program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        os.kill(guardian_of(started), signal.SIGTERM)
        terminated = time.time()
        assert started.end() == 1
    assert_whole_stop(zeros_after(listener, terminated))


def test_ctrl_c_at_the_terminal_does_not_end_the_guardian(listener, tmp_path):
    with script(BEGIN + 'node.move_robot(0.1, 0.0, 1.5)\n', tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        guardian = guardian_of(started)
        assert os.getsid(guardian) == guardian
        os.kill(guardian, signal.SIGINT)
        assert started.end() == 0


def test_no_child_of_the_program_keeps_the_guardian_waiting(listener, tmp_path):
    """A child holds what its parent had open; the parent's end must still be detected."""
    text = BEGIN + """
import pathlib, threading
threading.Thread(target=node.move_robot, args=(0.1, 0.0, 20.0), daemon=True).start()
while not pathlib.Path('go').exists():
    time.sleep(0.1)
if os.fork() == 0:
    time.sleep(8.0)
    os._exit(0)
os.kill(os.getpid(), signal.SIGKILL)
"""
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        time.sleep(1.0)
        (tmp_path / 'go').touch()
        started.process.wait(10.0)
        killed = time.time()
        assert zeros_after(listener, killed - 0.5)[0] - killed < 0.5


@pytest.mark.parametrize('ending, code', [
    ('os._exit(7)', 7), ('os.abort()', 134), ('sys.exit(5)', 5)])
def test_a_program_may_end_without_any_cleaning_up(listener, tmp_path, ending, code):
    text = f'{BEGIN}node.move_robot(0.1, 0.0, 0.3)\n{ending}\n'
    with script(text, tmp_path) as started:
        assert started.end() == code
        end = max(velocity.time for velocity in listener.received if velocity.moves)
        assert_whole_stop(zeros_after(listener, end))


def test_a_node_that_cannot_publish_its_stop_leaves_it_to_the_guardian(listener, tmp_path):
    """Its context is shut down under it, past every hook, as by a handler in foreign code."""
    text = BEGIN + """
import pathlib, threading
def shut_down_context():
    while not pathlib.Path('go').exists():
        time.sleep(0.1)
    with node.context.handle:
        node.context.handle.shutdown()
threading.Thread(target=shut_down_context, daemon=True).start()
node.move_robot(0.1, 0.0, 20.0)
"""
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        (tmp_path / 'go').touch()
        assert started.end() != 0
        end = max(velocity.time for velocity in listener.received if velocity.moves)
        zeros = zeros_after(listener, end)
        assert zeros[0] - end < 0.6
        assert_whole_stop(zeros)


def test_after_the_robot_was_released_the_guardian_has_ended(listener, tmp_path):
    text = BEGIN + """
node.move_robot(0.1, 0.0, 0.3)
node.destroy_node()
print('given back', flush=True)
time.sleep(20)
"""
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        guardian = guardian_of(started)
        started.wait_for_text('given back')
        assert not is_running(guardian)
        count = len(listener.received)
        started.send(signal.SIGKILL)
        time.sleep(0.5)
        assert len(listener.received) == count
    assert len(listener.released) == 1
