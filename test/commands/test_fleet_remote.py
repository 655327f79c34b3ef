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
"""A fleet that another program commands by lines on standard input."""

from contextlib import contextmanager
import math
import re
import signal
import time

from benchmarks.console_matrix.raw_client import RawClient
from kachaka_simple_control.process.processes import python_command
from program import environment, JsonProcess, Program
import pytest
from waiting import wait_until

pytestmark = [
    pytest.mark.ros, pytest.mark.slow,
    pytest.mark.needs('rclpy', 'nav_msgs', 'yaml', 'jsonschema')]

COMMAND = python_command('kachaka_simple_control.commands.fleet')
CONSOLE = python_command('kachaka_simple_control.console.console_command')
#: A robot drives ahead, the other one back; the second round begins where the first has ended.
AHEAD = 'name: ahead\nsteps: [forward: 0.25 m]\n'
BACK = 'name: back\nsteps: [forward: -0.15 m]\n'
FLEET = """
name: two
robots:
  r1: {motion: ./ahead.yaml, start: {x: 1 m, y: 2 m, heading: 90 deg}}
  r2: {motion: ./back.yaml, start: {y: -1 m}}
repeat: 2
"""
QUICK = ('guardian:=false', 'prime_time:=0.2')


class Commanded:
    """A program that drives a fleet by lines, and what it has written."""

    def __init__(self):
        """Wait for the process."""
        self.process, self.lines, self.states, self.number = None, [], [], 0

    def on_line(self, line):
        """Keep a report."""
        (self.states if line['type'] == 'fleet_state' else self.lines).append(line)

    @property
    def state(self):
        """Return the newest state."""
        return self.states[-1] if self.states else {'state': None}

    def send(self, *kinds):
        """Send commands; return the number of the last one."""
        for kind in kinds:
            self.number += 1
            self.process.write(
                {'v': 1, 'type': kind, **({} if kind == 'alive' else {'id': self.number})})
        return self.number

    def answer(self, number):
        """Wait for the answer to a command."""
        return wait_until(lambda: next((
            line for line in self.lines
            if line['type'] == 'answer' and line['id'] == number), None))

    def ask(self, kind):
        """Send a command, and wait for its answer."""
        return self.answer(self.send(kind))

    def until(self, condition):
        """Wait until a condition holds, and say meanwhile that this program is there."""
        def holds():
            self.send('alive')
            time.sleep(0.1)
            return condition()
        wait_until(holds)


def write_fleet(folder, text):
    """Write the file of a fleet, and those of its motions."""
    for name, contents in (('two', text), ('ahead', AHEAD), ('back', BACK)):
        (folder / f'{name}.yaml').write_text(contents)


@contextmanager
def commanded(tmp_path, *options, text=FLEET, parameters=QUICK):
    """Start the program in a block."""
    write_fleet(tmp_path, text)
    fleet = Commanded()
    given = [word for name in ('r1', 'r2') for parameter in parameters
             for word in ('-p', f'{name}.{parameter}')]
    command = [*COMMAND, str(tmp_path / 'two.yaml'), '--pipe', *options, '--ros-args', *given]
    with JsonProcess(command, fleet.on_line, env=environment()) as process:
        fleet.process = process
        wait_until(lambda: fleet.states)
        yield fleet


def test_it_is_run_round_by_round_and_released(tmp_path):
    with commanded(tmp_path, '--sim') as fleet:
        assert fleet.lines[0]['type'] == 'fleet'
        assert (fleet.state['state'], fleet.state['round']) == ('standing by', None)
        assert fleet.state['poses'] == [None, None]
        assert fleet.ask('run')['is_done']
        assert 'running already' in fleet.ask('run')['text']
        fleet.until(lambda: fleet.state['state'] == 'driving')
        fleet.until(lambda: fleet.state['round'] == 2)
        fleet.until(lambda: fleet.state['state'] == 'standing by')
        assert fleet.state['states'] == ['done', 'done']
        # Where the second round has ended, on the floor that they share.
        assert fleet.state['poses'][0] == pytest.approx([1.0, 2.5, math.pi / 2.0], abs=0.01)
        assert fleet.state['poses'][1] == pytest.approx([-0.3, -1.0, 0.0], abs=0.01)
        seen = [state['state'] for state in fleet.states]
        assert 'standing by' not in seen[seen.index('driving'):-5], 'between the rounds'
        assert fleet.state['is_still']
        assert fleet.state['troubles'] == {}
        assert fleet.ask('release')['text'] == 'released'
        assert fleet.process.end() == 0
        assert fleet.state['state'] == 'ended'


def test_it_is_paused_when_nobody_could_stop_it_and_goes_on_in_step(tmp_path):
    text = FLEET.replace('repeat: 2', 'repeat: 20')
    with commanded(tmp_path, '--sim', text=text) as fleet:
        assert fleet.ask('run')['is_done']
        wait_until(lambda: fleet.state['state'] == 'paused')
        assert set(fleet.state['states']) == {'paused'}
        assert fleet.state['speed'] == 0.0
        # That it is there again moves nothing.
        fleet.send('alive')
        time.sleep(0.3)
        assert fleet.state['state'] == 'paused'
        assert fleet.ask('resume')['text'] == 'resumed'
        fleet.until(lambda: fleet.state['state'] == 'driving')
        answer = fleet.ask('stop')
        assert (answer['is_done'], answer['is_confirmed']) == (True, True)
        wait_until(lambda: fleet.state['state'] == 'stopped')
        assert 'remote stop' in fleet.state['reason']
        assert fleet.state['troubles'] == {}
        assert fleet.ask('run')['is_done']


def test_a_stop_that_comes_right_after_it_is_run_ends_it(tmp_path):
    with commanded(tmp_path, '--sim') as fleet:
        stop = fleet.send('run', 'stop')
        assert fleet.answer(stop)['is_done']
        time.sleep(1.0)
        assert fleet.state['state'] == 'stopped'
        assert 'driving' not in {state['state'] for state in fleet.states}


def test_when_its_commands_end_the_robots_come_to_rest_and_it_ends(tmp_path):
    with commanded(tmp_path, '--sim', text=FLEET.replace('repeat: 2', 'repeat: 20')) as fleet:
        fleet.ask('run')
        fleet.until(lambda: fleet.state['state'] == 'driving')
        fleet.process.process.stdin.close()
        assert fleet.process.end() == 0
        assert 'paused' in {state['state'] for state in fleet.states}
        assert fleet.state['state'] == 'ended'


def test_a_signal_stops_the_robots_and_ends_it(tmp_path):
    with commanded(tmp_path, '--sim', text=FLEET.replace('repeat: 2', 'repeat: 20')) as fleet:
        fleet.ask('run')
        fleet.until(lambda: fleet.state['state'] == 'driving')
        fleet.process.send(signal.SIGINT)
        assert fleet.process.end() == 130
        wait_until(lambda: fleet.state['state'] == 'ended')
        assert fleet.state['reason'] == 'stopped by SIGINT'
        assert 'Traceback' not in fleet.process.text


def test_a_robot_that_is_missing_is_in_trouble(tmp_path):
    with commanded(tmp_path, parameters=(*QUICK, 'robot_timeout:=1.0')) as fleet:
        assert fleet.ask('run')['is_done']
        fleet.until(lambda: fleet.state['state'] == 'stopped')
        assert 'r1' in fleet.state['troubles']
        assert fleet.state['poses'] == [None, None]


def test_a_line_that_is_no_command_is_reported_and_nothing_else_happens(tmp_path):
    with commanded(tmp_path, '--sim') as fleet:
        fleet.process.write({'v': 1, 'type': 'take', 'id': 7})
        wait_until(lambda: len(fleet.lines) == 2)
        assert "'take', which is unknown here" in fleet.lines[1]['text']
        assert fleet.ask('pause')['is_done']


@pytest.mark.needs('tornado')
def test_a_page_of_the_console_runs_and_stops_a_fleet(tmp_path):
    write_fleet(tmp_path, FLEET.replace('repeat: 2', 'repeat: 20'))
    options = ['--fleet', str(tmp_path / 'two.yaml'), '--sim', '--port=0', '--no-browser']
    with Program([*CONSOLE, *options], env=environment()) as program:
        program.wait_for_text('ready: http://')
        port = re.search(r'ready: http://127.0.0.1:(\d+)/', program.text)[1]
        with RawClient(int(port)).greet() as client:
            client.until(lambda: client.state['process'] == 'running')
            assert client.ask('run')['is_done']
            client.until(lambda: client.state['state'] == 'driving' and all(client.state['poses']))
            assert client.ask('pause')['is_done']
            client.until(lambda: client.state['state'] == 'paused' and client.state['is_still'])
            assert client.ask('resume')['is_done']
            client.until(lambda: client.state['state'] == 'driving')
            answer = client.ask('stop')
            assert (answer['is_done'], answer['is_confirmed']) == (True, True)
            client.until(lambda: client.state['states'] == ['stopped', 'stopped'])
            assert client.ask('release')['is_done']
            client.until(lambda: client.state['state'] == 'standing by')
        program.send(signal.SIGINT)
        assert program.end() == 130


@pytest.mark.needs('sensor_msgs')
def test_an_obstacle_before_one_robot_is_named_and_nothing_is_wrong_with_the_others(tmp_path):
    floor = tmp_path / 'post.yaml'
    floor.write_text('posts: [{at: [1 m, 2.45 m], radius: 5 cm}]\n')
    text = FLEET.replace('back.yaml', 'ahead.yaml')
    with commanded(tmp_path, '--sim', '--watch', f'--floor={floor}', text=text) as fleet:
        assert fleet.lines[0]['floor']['posts'] == [[1.0, 2.45, 0.05]]
        assert fleet.ask('run')['is_done']
        fleet.until(lambda: fleet.state['held_by'])
        state = fleet.state
        assert state['held_by'].startswith('r1: obstacle 0.')
        assert (state['state'], state['watch']['state']) == ('paused', 'obstacle')
        assert set(state['states']) == {'paused'}
        assert [*state['troubles']] == ['r1']
        assert fleet.ask('stop')['is_done']
        assert fleet.ask('release')['text'] == 'released'
