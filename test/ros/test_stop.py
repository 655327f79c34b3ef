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
"""However a program ends, the robot is stopped and released."""

import signal
import time

from program import COMMAND, program, quick_drive, script
import pytest

pytestmark = [pytest.mark.ros, pytest.mark.distro, pytest.mark.needs('rclpy')]

#: Time from a signal to the first zero [s]: far below the robot's command timeout.
SOON = 0.2

BEGIN = """
import rclpy
from kachaka_simple_control import KachakaSimpleControl
rclpy.init()
node = KachakaSimpleControl()
"""


def assert_stopped(listener, since):
    """Assert that a whole stop followed: soon, front-loaded, beyond the command timeout."""
    after = [velocity for velocity in listener.received if velocity.time > since]
    zeros = [velocity.time for velocity in after if not velocity.moves]
    assert zeros[0] - since < SOON
    assert zeros[9] - zeros[0] < 0.2
    assert zeros[-1] - zeros[0] > 0.35
    assert not [velocity for velocity in after if velocity.moves and velocity.time > zeros[0]]


def assert_released(listener):
    """Assert that manual control was released once, after the last message."""
    assert len(listener.released) == 1
    assert listener.received[-1].time < listener.released[0]


@pytest.mark.parametrize('name', ['SIGINT', 'SIGTERM', 'SIGHUP'])
def test_a_signal_in_mid_motion_stops_the_robot(listener, tmp_path, name):
    signum = signal.Signals[name]
    with program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        time.sleep(0.25)
        sent = started.send(signum)
        assert started.end(3.5) == 128 + signum
    assert_stopped(listener, sent)
    assert_released(listener)
    assert ('Program was interrupted' in started.text) == (name == 'SIGINT')
    assert 'Traceback' not in started.text


def test_more_signals_do_not_cut_the_stop_short(listener, tmp_path):
    with program(COMMAND, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        sent = started.send(signal.SIGINT)
        for _ in range(4):
            time.sleep(0.08)
            started.send(signal.SIGINT)
        assert started.end() == 130
    assert_stopped(listener, sent)
    assert_released(listener)
    assert 'Traceback' not in started.text


@pytest.mark.needs('yaml', 'jsonschema')
def test_a_signal_that_was_ignored_at_the_start_stays_ignored(listener, tmp_path):
    command = ['sh', '-c', 'trap "" HUP; exec "$@"', 'sh', *quick_drive(tmp_path, duration=1.5)]
    with program(command, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        started.send(signal.SIGHUP)
        assert started.end() == 0


def test_a_script_need_not_initialise_ros(listener, tmp_path):
    text = BEGIN.replace('rclpy.init()\n', '') + 'node.move_robot(0.1, 0.0, 20.0)\n'
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        sent = started.send(signal.SIGINT)
        assert started.end(3.5) == 130
    assert_stopped(listener, sent)
    assert_released(listener)


def test_ctrl_c_in_the_middle_of_a_callback_releases_the_robot(listener, tmp_path):
    """While rclpy makes a callback's message: that blocks the callback's group for good."""
    text = """
from kachaka_simple_control.process.signals import SignalDispatcher
from rclpy.executors import Executor
signalled = []
SignalDispatcher._handle = lambda self, signum, frame: signalled.append(signum)
take = Executor._take_timer
def interrupted(self, timer):
    if signalled:
        signalled.clear()
        raise KeyboardInterrupt
    return take(self, timer)
Executor._take_timer = interrupted
""" + BEGIN + """
node.move_robot(0.1, 0.0, 0.2)
node.create_timer(0.01, lambda: None)
print("spinning", flush=True)
rclpy.spin(node)
"""
    with script(text, tmp_path) as started:
        started.wait_for_text('spinning')
        started.send(signal.SIGINT)
        started.end(5.0)
    assert_released(listener)
    assert 'did not confirm' not in started.text


@pytest.mark.parametrize(
    'ending', ['', 'rclpy.shutdown()', 'node.destroy_node()', 'raise KeyError'])
def test_a_script_may_end_as_it_likes(listener, tmp_path, ending):
    with script(f'{BEGIN}node.move_robot(0.1, 0.0, 0.3)\n{ending}\n', tmp_path) as started:
        assert started.end() == ('raise' in ending)
    (move,) = listener.moves()
    assert move.duration == pytest.approx(0.3, abs=0.15)
    end = max(velocity.time for velocity in listener.received if velocity.moves)
    assert_stopped(listener, end + 0.05)
    assert_released(listener)


def test_events_of_the_last_stop_are_passed_on_before_the_context_is_gone(listener, tmp_path):
    """Here to a reader that takes its time; what shows the velocities needs the context."""
    text = f"""{BEGIN}
import time
seen = []
node.event_bus.subscribe(lambda event: (time.sleep(0.03), seen.append(type(event).__name__)))
node.move_robot(0.1, 0.0, 0.3)
rclpy.shutdown()
print('the last of all:', seen[-1])
"""
    with script(text, tmp_path) as started:
        assert started.end() == 0
    assert 'the last of all: StateChanged' in started.text
    assert 'no longer published' not in started.text


def test_a_movement_that_is_refused_does_not_end_the_one_that_runs(listener, tmp_path):
    """In another thread, and in the main thread, which ends by it."""
    text = BEGIN + """
import threading, time
def play():
    node.move_robot(0.1, 0.0, 1.0)
def refused():
    node.move_robot(0.2, 0.0, 0.2)
threading.Thread(target=play).start()
while node.robot.gate.permit is None:
    time.sleep(0.05)
other = threading.Thread(target=refused)
other.start()
other.join()
refused()
"""
    with script(text, tmp_path) as started:
        assert started.end() == 1
    (move,) = listener.moves()
    assert (move.linear_x, move.duration) == (0.1, pytest.approx(1.0, abs=0.2))
    # One line each.
    lines = [line for line in started.text.splitlines() if not line.startswith('[')]
    assert ['a motion is running already' in line for line in lines] == [True, True]


def test_a_thread_drives_on_when_the_main_thread_has_ended(listener, tmp_path):
    """Python waits for it, and from 3.12 on starts no other thread meanwhile."""
    text = BEGIN + """
import threading, time
def play():
    threading.main_thread().join()
    node.move_robot(0.1, 0.0, 0.5)
    node.move_robot(0.1, 0.5, 0.5)
threading.Thread(target=play).start()
"""
    with script(text, tmp_path) as started:
        assert started.end() == 0
    assert [move.duration for move in listener.moves()] == pytest.approx([0.5, 0.5], abs=0.2)
    assert_released(listener)
    assert 'Traceback' not in started.text


def test_a_drive_needs_no_thread_that_its_node_has_not_started(listener, tmp_path):
    """Under any Python what 3.12 refuses after the end of the main thread."""
    text = BEGIN + """
import threading
def refused(thread):
    raise RuntimeError("can't create new thread at interpreter shutdown")
threading.Thread.start = refused
node.move_robot(0.1, 0.0, 0.3)
node.move_robot(0.1, 0.5, 0.3)
"""
    with script(text, tmp_path) as started:
        assert started.end() == 0
    assert [move.duration for move in listener.moves()] == pytest.approx([0.3, 0.3], abs=0.2)
    assert_released(listener)
    assert 'new thread' not in started.text


@pytest.mark.parametrize('name', ['SIGINT', 'SIGTERM'])
def test_a_signal_is_handled_when_the_main_thread_has_ended(listener, tmp_path, name):
    text = BEGIN + """
import threading
threading.Thread(target=node.move_robot, args=(0.1, 0.0, 20.0)).start()
"""
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        sent = started.send(signal.Signals[name])
        started.end(5.0)
    assert_stopped(listener, sent)
    assert_released(listener)
    assert 'new thread' not in started.text


def test_a_callback_that_fails_stops_the_motion(listener, tmp_path):
    text = BEGIN + """
import pathlib
def fail():
    if pathlib.Path('go').exists():
        raise ValueError('in a callback')
node.create_timer(0.1, fail)
node.move_robot(0.1, 0.0, 20.0)
"""
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        (tmp_path / 'go').touch()
        assert started.end() == 1
    assert 'a callback failed: ValueError: in a callback' in started.text
    # Its response is received although the thread that served callbacks is gone.
    assert 'did not confirm' not in started.text
    assert not listener.received[-1].moves
    assert_released(listener)


def test_an_exception_in_the_main_thread_stops_the_motion_of_another(listener, tmp_path):
    text = BEGIN + """
import pathlib, threading, time
threading.Thread(target=node.move_robot, args=(0.1, 0.0, 20.0)).start()
while not pathlib.Path('go').exists():
    time.sleep(0.1)
raise ValueError('in main')
"""
    with script(text, tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.moves)
        (tmp_path / 'go').touch()
        assert started.end(10.0) == 1
    assert 'ValueError: in main' in started.text
    assert not listener.received[-1].moves
    assert_released(listener)
