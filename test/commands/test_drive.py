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
"""Motions from files, driven by the command: on the simulated robot, and by the service."""

import json
from pathlib import Path
import signal
import time

from kachaka_simple_control.control.timing import STOP_REQUEST_WINDOW
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.report.comparison import read_drive, require_same
from program import COMMAND, final_pose, Program, program, script
import pytest
from terminals import at_terminal
from waiting import wait_until

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy', 'nav_msgs', 'jsonschema')]

SHORT = """
name: short
rate: 20 Hz
steps:
  - forward: 0.05 m
  - arc: {radius: 0.1 m, angle: -90 deg}
  - wait: 0.2 s
"""
STAMPED = """
name: stamped
namespace: /left
velocity_topic: cmd_vel
message_type: TwistStamped
frame: left/base_link
odometry_topic: null
manual_control: null
command_timeout: 0.3 s
limits: {max_linear_velocity: 0.2 m/s, max_angular_velocity: 1 rad/s}
"""
#: A module that each Python process imports at its start: it notes which of them plan a motion.
COUNTED = """
import importlib, os, pathlib
module = importlib.import_module('kachaka_simple_control.motion.plan')
plan = module.plan

def counted(*given):
    with (pathlib.Path(__file__).parent / 'planned').open('a') as file:
        print(os.getpid(), file=file)
    return plan(*given)

module.plan = counted
"""


def assert_lines_of_the_end_came_once(text):
    for line in ('manual control enabled', 'Robot has stopped', 'manual control disabled'):
        assert text.count(line) == 1, text


def test_a_motion_ends_where_its_plan_says(tmp_path):
    """The bounds are wide, for a busy machine; docs/motions.md has what a quiet one does."""
    from kachaka_simple_control.files.motion_reader import loads
    file = tmp_path / 'short.yaml'
    file.write_text(SHORT)
    planned = plan(loads(SHORT, 'short.yaml').motion, KACHAKA.limits, 20.0)
    with program([*COMMAND, str(file), '--sim'], tmp_path) as started:
        assert started.end(40.0) == 0, started.text
    x, y, heading = final_pose(started.text)
    assert (x, y) == pytest.approx((planned.pose.x, planned.pose.y), abs=0.005)
    assert heading == pytest.approx(-90.0, abs=2.0)
    assert f'Motion completed: short, 3 steps, {planned.duration:.3f} seconds' in started.text
    assert 'forward 0.05 m' in started.text
    assert_lines_of_the_end_came_once(started.text)


def test_a_value_of_a_parameter_is_driven(tmp_path):
    file = tmp_path / 'short.yaml'
    file.write_text('parameters: {side: 5 m}\nsteps: [forward: $side / 2]')
    with program([*COMMAND, str(file), '--sim', '--with', 'side=12cm'], tmp_path) as started:
        assert started.end(40.0) == 0, started.text
    assert final_pose(started.text)[0] == pytest.approx(0.06, abs=0.005)
    assert 'forward 0.06 m' in started.text


def test_a_motion_of_others_is_driven_with_values(tmp_path):
    values = {'length': '50 cm', 'width': '0.6m', 'rounds': '1', 'looks': '0'}
    words = [word for name, value in values.items() for word in ('--with', f'{name}={value}')]
    with program([*COMMAND, 'patrol', *words, '--sim'], tmp_path) as started:
        assert started.end(60.0) == 0, started.text
    x, y, heading = final_pose(started.text)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=0.02)
    assert heading == pytest.approx(0.0, abs=2.0)
    assert 'step 8 of 9: forward 0.6 m' in started.text


def test_a_report_is_driven_again_without_the_files_of_its_motion(tmp_path):
    file = tmp_path / 'short.yaml'
    file.write_text('parameters: {side: 5 m}\nsteps: [{forward: $side / 2}, '
                    '{include: {motion: straight, with: {distance: -$side}}}]')
    words = ['./short.yaml', '--with', 'side=12cm']
    for name in ('one', 'two'):
        command = [*COMMAND, *words, '--sim', '--report', name]
        with program(command, tmp_path, tmp_path) as started:
            assert started.end(60.0) == 0, started.text
        file.unlink(missing_ok=True)
        words = ['one/run.json']
    one, two = (read_drive(tmp_path / name) for name in ('one', 'two'))
    require_same([one, two])
    assert one.motion_file == two.motion_file
    assert one.motion_file.values == {'side': '12cm'}
    assert list(one.motion_file.included) == ['straight']
    assert two.planned.x == pytest.approx(-0.06)


def test_a_table_that_cannot_be_printed_is_one_line_after_the_drive(tmp_path):
    file = tmp_path / 'short.yaml'
    file.write_text(SHORT)
    command = [*COMMAND, str(file), '--sim']
    with Path('/dev/full').open('w') as full, Program(
            command, tmp_path / 'log.txt', stdout=full) as started:
        assert started.end(40.0) == 1, started.text
    assert 'Motion completed: short' in started.text
    assert started.text.endswith(
        'kachaka_simple_control: the table cannot be printed: No space left on device\n')
    assert started.text.count('No space left') == 1


@pytest.mark.parametrize('signals, code', [
    ([signal.SIGINT] * 2, 130), ([signal.SIGTERM], 143)])
def test_stopped_by_a_signal_it_says_so_once(signals, code, tmp_path):
    with program([*COMMAND, 'straight', '--sim'], tmp_path) as started:
        started.wait_for_text('step 1 of 1')
        for signum in signals:
            started.send(signum)
            time.sleep(0.1)
        assert started.end() == code
    assert_lines_of_the_end_came_once(started.text)


def test_a_motion_that_the_robot_cannot_do_is_refused_before_anything_starts(listener, tmp_path):
    file = tmp_path / 'fast.yaml'
    file.write_text('steps:\n  - forward: 1 m\n  - turn: {angle: 90 deg, speed: 2 rad/s}\n')
    with program([*COMMAND, str(file)], tmp_path) as started:
        assert started.end() == 2
    (line,) = started.text.splitlines()
    assert f"{file}:3: step 2: turn.speed: 2.0 rad/s is above kachaka's limit of 1.57" in line
    assert listener.received == []
    assert listener.answered == []


def test_a_calibrated_robot_is_sent_what_makes_it_do_what_was_planned(listener, tmp_path):
    robot, motion = tmp_path / 'own.yaml', tmp_path / 'straight.yaml'
    robot.write_text('extends: kachaka\ncalibration: {forward_gain: 0.8, veer: 0.1 rad/m}\n'
                     'odometry_calibration: {scale: 0.9}')
    motion.write_text(
        'steps: [move: {linear_x: 0.1 m/s, angular_z: 0 rad/s, duration: 1 s}]')
    with program([*COMMAND, str(motion), '--robot', str(robot), '--report',
                  str(tmp_path / 'report')], tmp_path) as started:
        assert started.end() == 0, started.text
    data = json.loads((tmp_path / 'report' / 'run.json').read_text())
    assert data['settings']['calibration'].startswith('forward 0.8, backward 1, ')
    assert data['settings']['odometry_calibration'].startswith('scale 0.9')
    assert data['steps'][0]['sent']['distance_m'] == pytest.approx(0.1, abs=0.002)
    (move,) = listener.moves()
    assert (move.linear_x, move.angular_z) == pytest.approx((0.1 / 0.9 / 0.8, -0.01 / 0.9))
    assert 'Calibrated: forward 0.8, backward 1, left 1, right 1, veer 5.7296 deg/m' in (
        started.text)
    # What is within the robot's limits may not be within those that are left.
    motion.write_text(
        'steps: [move: {linear_x: 0.25 m/s, angular_z: 0 rad/s, duration: 1 s}]')
    with program([*COMMAND, str(motion), '--robot', str(robot)], tmp_path) as started:
        assert started.end() == 2, started.text
    assert 'straight.yaml:1: step 1: move.linear_x: 0.25 m/s, outside' in started.text


@pytest.mark.parametrize('source, rate', [
    ('the file', 20), ('--rate', 40), ('-p', 40), ('parameter file', 40)])
def test_what_the_user_says_wins_over_the_file(source, rate, listener, tmp_path):
    """A motion's rate is its own only as long as nothing else is said."""
    file, parameters = tmp_path / 'slow.yaml', tmp_path / 'parameters.yaml'
    file.write_text(
        'rate: 20 Hz\nsteps: [move: {linear_x: 0.1 m/s, angular_z: 0 rad/s, duration: 1 s}]')
    parameters.write_text('/**: {ros__parameters: {rate: 40.0}}')
    words = {'the file': [], '--rate': ['--rate', '40'], '-p': ['--ros-args', '-p', 'rate:=40.0'],
             'parameter file': ['--ros-args', '--params-file', str(parameters)]}[source]
    with program([*COMMAND, str(file), *words], tmp_path) as started:
        assert started.end() == 0, started.text
    (move,) = listener.moves()
    # On a busy machine a message may be late by more than its period, and the next is due instead.
    assert move.count == pytest.approx(rate, abs=3)
    said = 'rate is 40 Hz by ' + ('--rate' if source == '--rate' else 'parameter rate')
    assert (f'{said}, not 20 Hz as in {file}' in started.text) == (rate == 40)


def test_a_simulation_of_another_robot_than_a_kachaka_is_refused(tmp_path):
    with program([*COMMAND, '--sim', '--robot', 'turtlebot3'], tmp_path) as started:
        assert started.end() == 2
    (line,) = started.text.splitlines()
    assert 'start a kachaka, not a turtlebot3' in line


def test_a_floor_with_errors_is_refused_before_a_robot_is_started(tmp_path):
    file = tmp_path / 'floor.yaml'
    file.write_text('walls: [[[1 m, 0 m]]]\nposts: 1\n')
    with program([*COMMAND, '--sim', '--floor', str(file)], tmp_path) as started:
        assert started.end() == 2
    assert [line.partition(': ')[0] for line in started.text.splitlines()] == [
        f'{file}:1', f'{file}:2']


def test_a_wall_is_touched_and_said_even_if_all_else_is_quiet(tmp_path):
    file = tmp_path / 'floor.yaml'
    file.write_text('walls: [[[0.4 m, -1 m], [0.4 m, 1 m]]]\n')
    command = [*COMMAND, 'straight', '--sim', '--quiet', '--floor', str(file)]
    with program(command, tmp_path) as started:
        started.wait_for_text(': contact with a wall at x 0.16', 60.0)
        started.end(60.0)
    assert started.text.count('contact with') == 1


def test_repeated_drives_have_numbered_reports_to_compare(tmp_path, monkeypatch):
    """Each is planned once, by the node; display and report, other processes, get its plan."""
    (tmp_path / 'sitecustomize.py').write_text(COUNTED)
    (tmp_path / 'planned').write_text('')
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    (tmp_path / 'short.yaml').write_text(SHORT)
    command = [*COMMAND, 'short.yaml', '--sim', '--repeat', '2', '--report', 'all']
    with program(command, tmp_path, tmp_path) as started:
        assert started.end(60.0) == 0, started.text
    assert 'drive 2 of 2' in started.text
    assert 'kachaka_compare all/* compares them' in started.text
    require_same([read_drive(tmp_path / 'all' / name) for name in '12'])
    assert (tmp_path / 'planned').read_text() == f'{started.process.pid}\n' * 2


def test_by_the_service_it_drives_and_stops(listener, tmp_path):
    """Twice; a second call in between is refused; Ctrl+C ends the program."""
    with program([*COMMAND, 'straight', '--wait'], tmp_path) as started:
        started.wait_for_text('Standing by')
        assert 'has not taken a robot' in listener.call('stop').message
        assert listener.received == []
        time.sleep(2.0 * STOP_REQUEST_WINDOW)
        for _ in range(2):
            before = len(listener.received)
            assert listener.call('run').success
            assert 'a motion is running already' in listener.call('run').message
            listener.wait_for(lambda velocity: velocity.moves, after=before)
            answer = listener.call('stop')
            assert (answer.success, answer.message) == (True, 'the robot was stopped')
            assert not listener.received[-1].moves
            count = len(listener.received)
            answer = listener.call('stop')
            assert (answer.success, answer.message) == (
                True, 'nothing was sent: the robot had been stopped before')
            assert len(listener.received) == count
            time.sleep(2.0 * STOP_REQUEST_WINDOW)
        started.send(signal.SIGINT)
        assert started.end() == 130
    assert started.text.count('the movement was ended by ~/stop') == 2
    assert '[ERROR]' not in started.text
    assert started.text.count('Robot has stopped') == 2  # after each call, not at the end
    assert 'Traceback' not in started.text


def test_after_the_guardian_s_stop_it_refuses_with_the_reason(listener, tmp_path):
    with program([*COMMAND, 'straight', '--wait'], tmp_path) as started:
        started.wait_for_text('Standing by')
        assert listener.call('run').success
        listener.wait_for(lambda velocity: velocity.moves)
        started.send(signal.SIGSTOP)
        time.sleep(1.0)
        continued = started.send(signal.SIGCONT)
        started.wait_for_text('the guardian stopped the robot')
        for name in ('run', 'resume'):
            answer = listener.call(name)
            assert not answer.success
            assert answer.message.startswith(
                'nothing moves until this program is started again: the guardian stopped the '
                'robot: the node sent no heartbeat for ')
        assert wait_until(lambda: listener.call('stop').message == (
            'nothing was sent: the robot had been stopped before'))
        started.send(signal.SIGINT)
        assert started.end() == 130
    assert not any(velocity.moves for velocity in listener.received if velocity.time > continued)


def test_enter_starts_the_motion_of_a_command_that_stands_by(listener):
    with at_terminal([*COMMAND, 'straight', '--wait'], 200, 30) as shown:
        shown.wait_for_text('Standing by: Enter starts the motion')
        assert '`ros2 service call /kachaka_simple_control/run std_srvs/srv/Trigger`' in str(shown)
        assert listener.received == []
        shown.press(b'\r')
        listener.wait_for(lambda velocity: velocity.moves)
        shown.press(b'\r')
        shown.wait_for_text('a motion is running already')
        shown.press(b'\x03')
        assert shown.end() == 130
        text = '\n'.join(shown.screen.above)
    assert text.count('Program was interrupted') == text.count('Robot has stopped') == 1
    assert '[ERROR]' not in text
    assert not listener.received[-1].moves


def test_a_stop_that_is_not_confirmed_is_not_answered_with_success(listener, tmp_path):
    from nav_msgs.msg import Odometry
    odometry = listener._node.create_publisher(Odometry, 'odometry/odometry', 10)
    moving = Odometry()
    moving.twist.twist.linear.x = 0.1
    listener._node.create_timer(0.05, lambda: odometry.publish(moving))
    # A robot that moves already is left alone otherwise.
    allowed = ['--ros-args', '-p', 'allow_other_publishers:=true']
    with program([*COMMAND, 'straight', '--wait', *allowed], tmp_path) as started:
        started.wait_for_text('Standing by')
        assert listener.call('run').success
        listener.wait_for(lambda velocity: velocity.moves)
        answer = listener.call('stop')
    assert not answer.success
    assert answer.message.startswith('the stop is unconfirmed')


def test_a_command_that_cannot_leave_the_graph_ends_all_the_same(listener, tmp_path):
    """Fast DDS may hang, and Python may run nothing meanwhile."""
    text = """
import ctypes
from kachaka_simple_control.commands import drive
drive.SHUTDOWN_TIMEOUT = 2.0
drive.rclpy.try_shutdown = lambda: ctypes.PyDLL(None).sleep(60)  # keeps the interpreter's lock
from kachaka_simple_control.commands.drive_or_preview import main
exit(main(['straight', '--wait']))
"""
    with script(text, tmp_path) as started:
        started.wait_for_text('Standing by')
        started.send(signal.SIGINT)
        assert started.end() == 1
    assert 'Timeout (0:00:02' in started.text


@pytest.mark.parametrize('source', ['by option', 'by file'])
def test_a_rate_that_cannot_work_is_refused_before_anything_is_started(source, tmp_path):
    file = tmp_path / 'slow.yaml'
    file.write_text(SHORT if source == 'by option' else SHORT.replace('20 Hz', '2 Hz'))
    option = ['--rate', '2'] if source == 'by option' else []
    with program([*COMMAND, str(file), '--sim', *option], tmp_path) as started:
        assert started.end() == 2
    where = 'kachaka_simple_control: rate is' if option else f'{file}:3: rate:'
    assert started.text == f'{where} 2 Hz; for kachaka it must be from 5 to 1000 Hz\n'


def test_a_robot_may_take_velocities_with_a_stamp(tmp_path):
    """From node and guardian alike; the robot's profile asks for it."""
    from geometry_msgs.msg import TwistStamped
    from listener import Listener
    file = tmp_path / 'stamped.yaml'
    file.write_text(STAMPED)
    motion = tmp_path / 'short.yaml'
    motion.write_text(SHORT)
    with Listener(serves=False) as listener:
        received = []
        listener._node.create_subscription(TwistStamped, '/left/cmd_vel', received.append, 10)
        command = [*COMMAND, str(motion), '--robot', str(file)]
        with program(command, tmp_path) as started:
            assert started.end() == 0, started.text
    assert {message.header.frame_id for message in received} == {'left/base_link'}
    stamps = [message.header.stamp.sec + message.header.stamp.nanosec / 1e9
              for message in received]
    moving = [stamp for stamp, message in zip(stamps, received) if message.twist.linear.x]
    assert len(moving) > 10
    assert moving == sorted(moving)
    assert received[-1].twist.linear.x == received[-1].twist.angular.z == 0.0
