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
"""Remote control: another program drives by lines on standard input."""

from contextlib import contextmanager, suppress
import fcntl
import json
import random
import signal
import subprocess
import time

from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.plan import plan
from program import COMMAND, EndedError, environment, JsonProcess, Program
import pytest
from waiting import poll, wait_until

pytestmark = [pytest.mark.ros, pytest.mark.needs('rclpy')]

#: The command; its robot has no odometry.
PIPE = [*COMMAND, '--pipe', '--ros-args', '-p', 'guardian:=false', '-p', 'prime_time:=0.2', '-p',
        'odometry_timeout:=0.0']
#: fcntl.F_SETPIPE_SZ, which Python 3.10 does not have everywhere.
F_SETPIPE_SZ = 1031
FORWARD = {'linear_x': 0.2, 'angular_z': 0.0}
REST = {'linear_x': 0.0, 'angular_z': 0.0}
ENDINGS = {
    'a motion is running already; wait for its end, or stop it',
    'a stop came after the command',
    'ended: nothing is driven any more',
    'stopped by SIGINT',
    'the robot is not taken: take it first',
}
MOTION = 'name: ahead\nrate: 20 Hz\nsteps: [move: {linear_x: 0.1, angular_z: 0, duration: 2 s}]\n'


class Remote:
    """A program that drives by lines, and what it reads."""

    def __init__(self):
        """Wait for the process."""
        self.process, self.lines = None, []
        self.stamp, self.sequence, self.number = 0.0, 0, 0
        self.states = []

    def on_line(self, line):
        """Keep a report."""
        assert line['v'] == 1
        if line['type'] == 'stamp':
            self.stamp = line['stamp']
        elif line['type'] == 'state':
            self.states.append(line)
        else:
            self.lines.append(line)

    def send(self, kind, **values):
        """Send a command; return its number."""
        self.number += 1
        number = {} if kind in ('hand', 'alive') else {'id': self.number}
        self.process.write({'v': 1, 'type': kind, **number, **values})
        return self.number

    def answer(self, number):
        """Wait for the answer to a command."""
        return wait_until(lambda: next(
            (line for line in self.lines
             if line['type'] == 'answer' and line['id'] == number), None))

    def ask(self, kind, **values):
        """Send a command, and wait for its answer."""
        return self.answer(self.send(kind, **values))

    def hand(self, velocity, duration):
        """Want a velocity for a while [s], as a hand that sends 20 commands a second."""
        end = time.monotonic() + duration
        while time.monotonic() < end:
            self.sequence += 1
            self.send('hand', sequence=self.sequence, stamp=self.stamp, **velocity)
            time.sleep(0.05)

    def take(self):
        """Take the robot, and release the controls."""
        answer = self.ask('take')
        assert (answer['is_done'], answer['text']) == (True, 'ready')
        wait_until(lambda: self.stamp)
        self.hand(REST, 0.1)


@contextmanager
def remote(*options, command=PIPE):
    """Start the command in a block."""
    control = Remote()
    with JsonProcess([*command, *options], control.on_line, env=environment()) as process:
        control.process = process
        yield control


def moves(listener):
    """Return the velocities that ask for motion."""
    return [sent for sent in listener.received if sent.moves]


def first_zero(listener, after):
    """Return when the first zero after a time was sent [s, system clock]."""
    return wait_until(lambda: next(
        (sent.time for sent in listener.received if sent.time > after and not sent.moves), None))


def test_nothing_is_sent_before_the_robot_is_taken_and_release_ends_it(listener):
    with remote() as control:
        robot = wait_until(lambda: control.lines and control.lines[0])
        assert robot['type'] == 'robot'
        assert (robot['robot'], robot['max_linear_velocity']) == ('kachaka', 0.3)
        control.send('hand', sequence=1, stamp=0.0, **FORWARD)
        refused = control.ask('run', text=MOTION, name='ahead.yaml')
        assert refused['text'] == 'the robot is not taken: take it first'
        assert not listener.received
        control.take()
        assert control.ask('take')['text'] == 'ready'  # it is taken already
        assert not moves(listener)
        assert control.ask('release')['text'] == 'released'
        assert control.process.end() == 0
    assert not moves(listener)


def test_a_hand_drives_until_its_lease_lapses(listener):
    with remote() as control:
        control.take()
        control.hand(FORWARD, 1.0)
        last = time.time()
        zero = first_zero(listener, last)
        assert zero - last < 0.35
        time.sleep(0.2)
        assert max(sent.time for sent in moves(listener)) < zero
        assert max(sent.linear_x for sent in listener.received) == 0.2
        # Whoever lost control has to release the controls first.
        before = len(moves(listener))
        control.hand(FORWARD, 0.3)
        assert len(moves(listener)) == before
        control.hand(REST, 0.1)
        control.hand(FORWARD, 0.3)
        assert len(moves(listener)) > before
        control.ask('release')


def test_a_motion_is_driven_exactly_and_then_the_hand_again(listener):
    with remote() as control:
        control.take()
        assert control.ask('run', text=MOTION, name='ahead.yaml')['text'] == 'started'
        end = time.monotonic() + 2.8
        while time.monotonic() < end:
            control.send('alive')
            time.sleep(0.2)
        held, = (one for one in listener.moves() if one.linear_x == 0.1)
        assert held.duration == pytest.approx(2.0, abs=0.05)
        # At the rate of the file.
        assert sum(one.linear_x == 0.1 for one in listener.received) == 40
        assert control.states[-1]['state'] == 'ready'
        assert {'driving', 'ready'} <= {state['state'] for state in control.states}
        control.hand(REST, 0.1)
        control.hand(FORWARD, 0.6)
        assert max(sent.linear_x for sent in listener.received) > 0.1
        control.ask('release')


def test_a_motion_has_values_and_includes_files_or_only_given_texts(listener, tmp_path):
    (tmp_path / 'leg.yaml').write_text(
        'parameters: {speed: 0}\n'
        'steps: [move: {linear_x: $speed * 1 m/s, angular_z: 0, duration: 1 s}]\n')
    run = {
        'text': 'parameters: {speed: }\n'
                'steps: [include: {motion: ./leg.yaml, with: {speed: $speed}}]\n',
        'name': str(tmp_path / 'ahead.yaml')}
    with remote() as control:
        control.take()
        for wrong, reason in (
                ({}, 'ahead.yaml:1: parameters.speed: it must be given'),
                ({'values': {'speed': 'fast'}}, "'fast'; it must be a number"),
                ({'values': {'speed': '0.1'}, 'included': {}},
                 "ahead.yaml:2: step 1: include.motion: './leg.yaml': the text of this file")):
            answer = control.ask('run', **run, **wrong)
            assert not answer['is_done']
            assert reason in answer['text']
        assert control.ask('run', **run, values={'speed': '0.1'})['text'] == 'started'
        wait_until(lambda: control.states[-1]['state'] == 'driving')
        wait_until(lambda: control.send('alive') and control.states[-1]['state'] == 'ready')
        held, = (one for one in listener.moves() if one.linear_x == 0.1)
        assert held.duration == pytest.approx(1.0, abs=0.05)
        control.ask('release')


def test_the_speed_of_motions_is_not_that_of_the_hand(listener):
    with remote() as control:
        control.take()
        control.ask('speed', factor=0.5)
        control.hand(FORWARD, 1.5)
        assert listener.received[-1].linear_x == 0.2
        control.hand(REST, 0.1)
        control.ask('release')


def test_after_a_stop_a_motion_is_neither_paused_nor_slowed_down_by_what_was_before(listener):
    with remote('-p', 'speed_factor:=0.8') as control:
        control.take()
        control.ask('speed', factor=0.5)
        for kind in ('pause', 'stop', 'take'):
            assert control.ask(kind)['is_done']
        wait_until(lambda: control.states[-1]['factors'] == {'override': 0.8})
        assert control.ask('run', text=MOTION, name='ahead.yaml')['is_done']
        wait_until(lambda: control.states[-1]['state'] == 'driving')
        control.ask('release')


def test_a_motion_is_paused_when_nobody_could_stop_it(listener):
    with remote() as control:
        control.take()
        control.ask('run', text=MOTION, name='ahead.yaml')
        wait_until(lambda: control.states[-1]['state'] == 'paused')
        assert control.states[-1]['factors'] == {'remote control': 0.0}
        control.send('alive')  # it is there again; that alone moves nothing
        wait_until(lambda: control.states[-1]['factors'] == {'pause': 0.0})
        assert control.ask('resume')['text'] == 'resumed'
        assert control.ask('stop')['is_done']


def test_a_stop_ends_a_motion_and_the_robot_is_no_longer_taken(listener):
    with remote() as control:
        control.take()
        control.ask('run', text=MOTION, name='ahead.yaml')
        wait_until(lambda: moves(listener))
        asked = time.time()
        answer = control.ask('stop')
        # Without odometry nobody has seen it stand still.
        assert (answer['is_done'], answer.get('is_confirmed')) == (True, None)
        assert first_zero(listener, asked) - asked < 0.1
        before = len(moves(listener))
        control.hand(REST, 0.1)
        control.hand(FORWARD, 0.3)
        assert len(moves(listener)) == before
        assert 'stopping' in {state['state'] for state in control.states}
        assert (control.states[-1]['state'], control.states[-1]['is_still']) == ('stopped', None)
        control.take()
        control.ask('release')


def test_a_stop_cancels_a_robot_that_is_being_taken(listener):
    with remote() as control:
        wait_until(lambda: control.lines)
        taking, stopping = control.send('take'), control.send('stop')
        assert not control.answer(taking)['is_done']
        assert control.answer(stopping)['is_done']
        control.hand(REST, 0.1)
        control.hand(FORWARD, 0.3)
        assert not moves(listener)


@pytest.mark.parametrize(('text', 'part'), [
    ('steps: [forwrd: 1 m]', 'bad.yaml:1: step 1: forwrd: there is no such step; did you mean'),
    ('steps: [forward: {distance: 1 m, speed: 9 m/s}]', '9.0 m/s is above'), ('', 'bad.yaml'),
    ('closed_loop: true\nsteps: [forward: 1 m]', 'a closed loop needs'),
    ('watch: true\nsteps: [forward: 1 m]', 'bad.yaml:1: watch: true, and this drive was started '),
    ('rate: 1 Hz\nsteps: [forward: 1 m]', 'bad.yaml:1: rate: 1 Hz'),
    ('robot: turtlebot3\nsteps: [forward: 1 m]', "'turtlebot3', and this is kachaka")])
def test_a_motion_that_cannot_be_driven_is_refused_with_its_line(listener, text, part):
    with remote() as control:
        control.take()
        answer = control.ask('run', text=text, name='bad.yaml')
        assert not answer['is_done']
        assert part in answer['text']
        assert not moves(listener)


def test_a_report_keeps_the_file_of_the_motion_that_was_run(listener, tmp_path):
    texts = {'part.yaml': 'parameters: {way: {}}\nsteps: [forward: $way]\n'}
    text = ('parameters: {way: 9 m}\n'
            'steps: [include: {motion: ./part.yaml, with: {way: $way / 2}}]\n')
    command = [*COMMAND, '--report', str(tmp_path / 'report'), *PIPE[len(COMMAND):]]
    with remote(command=command) as control:
        control.take()
        answer = control.ask(
            'run', text=text, name='mine.yaml', values={'way': '10 cm'}, included=texts)
        assert answer['is_done'], answer
        wait_until(lambda: moves(listener))
        wait_until(lambda: control.states[-1]['state'] == 'ready')
        control.send('release')
        assert control.process.end() == 0
    file = find(str(tmp_path / 'report' / 'run.json'))
    assert (file.values, file.included_texts) == ({'way': '10 cm'}, texts)
    assert plan(file.motion, KACHAKA.limits, 10.0).steps[-1].pose.x == pytest.approx(0.05)


def test_a_line_that_is_no_command_is_reported_and_nothing_else_happens(listener):
    with remote() as control:
        wait_until(lambda: control.lines)
        control.process.process.stdin.write('{"v": 1, "type": "fly"}\nnonsense\n')
        control.process.process.stdin.flush()
        wait_until(lambda: len(control.lines) >= 3)
        assert all('was not executed' in line['text'] for line in control.lines[1:])
        control.take()


@pytest.mark.parametrize('is_by_hand', [True, False])
def test_when_its_commands_end_the_robot_is_stopped_and_it_ends(listener, is_by_hand):
    with remote() as control:
        control.take()
        if is_by_hand:
            control.hand(FORWARD, 0.5)
        else:
            control.ask('run', text=MOTION, name='ahead.yaml')
            wait_until(lambda: moves(listener))
        closed = time.time()
        control.process.process.stdin.close()
        assert control.process.end() == 0
        assert time.time() - closed < 5.0
        zero = first_zero(listener, closed)
        # A motion brakes first.
        assert zero - closed < (0.1 if is_by_hand else 2.0)
        assert max(sent.time for sent in moves(listener)) < zero


def test_a_program_that_reads_no_report_can_stop_the_robot(listener):
    pipes = {'stdin': subprocess.PIPE, 'stdout': subprocess.PIPE}
    with Program(PIPE, env=environment(), **pipes) as program:
        fcntl.fcntl(program.process.stdout, F_SETPIPE_SZ, 4096)

        def send(**values):
            print(json.dumps({'v': 1, **values}), file=program.process.stdin, flush=True)

        send(type='take', id=1)
        wait_until(lambda: listener.received)
        time.sleep(0.5)
        send(type='run', id=2, text=MOTION.replace('2 s', '20 s'), name='ahead.yaml')

        def is_moving():
            send(type='alive')
            return moves(listener)

        assert poll(is_moving, 15.0, 0.1)
        for _ in range(20):  # until the pipe is full
            send(type='alive')
            time.sleep(0.1)
        asked = time.time()
        send(type='speed', id=3, factor=0.5)
        send(type='pause', id=4)
        send(type='stop', id=5)
        assert first_zero(listener, asked) - asked < 0.25
        program.process.stdin.close()
        assert program.end() == 0


def test_a_signal_stops_the_robot_and_ends_it(listener):
    with remote() as control:
        control.take()
        control.hand(FORWARD, 0.5)
        sent = time.time()
        control.process.send(signal.SIGINT)
        assert control.process.end() == 130
        assert first_zero(listener, sent) - sent < 0.1
        wait_until(lambda: control.states[-1]['state'] == 'ended')
        assert control.states[-1]['reason'] == 'stopped by SIGINT'


@pytest.mark.parametrize('seed', range(2))
@pytest.mark.parametrize('ending', ['release', 'SIGINT'])
def test_commands_that_come_while_it_ends_are_answered(listener, ending, seed):
    """Until the process is gone, each command is executed or refused; no thread fails."""
    chosen = random.Random(seed)
    with remote() as control:
        control.take()
        control.ask('run', text=MOTION, name='ahead.yaml')
        time.sleep(chosen.uniform(0.0, 0.3))
        if ending == 'release':
            control.send('release')
        else:
            control.process.send(signal.SIGINT)
        with suppress(EndedError):
            while True:
                kind = chosen.choice(['speed', 'speed', 'pause', 'resume', 'run', 'stop'])
                control.send(kind, **{
                    'speed': {'factor': 0.5}, 'run': {'text': MOTION, 'name': 'ahead.yaml'},
                }.get(kind, {}))
                time.sleep(chosen.uniform(0.0, 0.01))
        assert control.process.end() == (0 if ending == 'release' else 130)
        refused = [line['text'] for line in control.lines
                   if line['type'] == 'answer' and not line['is_done']]
        if ending == 'SIGINT':
            assert 'stopped by SIGINT' in refused
        # A release may take less time than the next command: then the process is gone first.
        assert set(refused) <= ENDINGS, refused
        assert 'Traceback' not in control.process.text


WATCHED = 'name: ahead\nrate: 20 Hz\nsteps: [forward: 0.8 m]\n'


@pytest.mark.needs('sensor_msgs', 'yaml')
def test_a_watched_drive_reports_its_floor_what_the_laser_sees_and_why_it_is_held(tmp_path):
    floor = tmp_path / 'wall.yaml'
    floor.write_text('walls: [[[0.8 m, -1 m], [0.8 m, 1 m]]]\n')
    control = Remote()
    with JsonProcess(
            [*COMMAND, '--pipe', '--sim', '--watch', '--floor', str(floor), '--ros-args', '-p',
             'guardian:=false'], control.on_line, env=environment()) as process:
        control.process = process
        control.take()
        assert control.ask('run', text=WATCHED, name='ahead.yaml')['text'] == 'started'

        def held():
            control.send('alive')
            time.sleep(0.1)
            newest = control.states[-1]
            return newest if newest['held_by'] and newest['is_still'] else None

        state = wait_until(held, 20.0)
        assert (state['state'], state['watch']['state']) == ('paused', 'obstacle')
        assert state['held_by'] == (
            f"obstacle {state['watch']['distance']:.2f} m ahead, goes on by itself")
        robot = control.lines[0]
        assert robot['floor']['walls'] == [[[0.8, -1.0], [0.8, 1.0]]]
        scan = [line for line in control.lines if line['type'] == 'scan'][-1]
        # The wall is where it stands, seen from the robot.
        ahead = [x for x, y in scan['points'] if abs(y) < 0.1 and x > 0.0]
        assert scan['pose'][0] + min(ahead) == pytest.approx(0.8, abs=0.06)
        assert control.ask('stop')['is_done']
        assert control.ask('release')['text'] == 'released'
