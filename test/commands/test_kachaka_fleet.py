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
"""The command kachaka_fleet: what it refuses, shows and drives."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import sys
import time

from kachaka_simple_control.commands.fleet import main
from kachaka_simple_control.commands.fleet_options import parse
from kachaka_simple_control.process.exit_codes import BAD_USAGE, FAULTED, NO_ROBOT
from optional_libraries import optional_imports
from program import Program
import pytest
from ros_support import bridge

with optional_imports():
    from listener import Listener

COMMAND = [sys.executable, '-m', 'kachaka_simple_control.commands.fleet']
FLEET = """
name: lab
robots:
  one: {motion: ./out.yaml, start: {y: 0 m}}
  two: {motion: ./out.yaml, start: {y: 1 m}}
  three: {motion: ./out.yaml, start: {y: 2 m}}
"""
OUT = 'rate: 20 Hz\nsteps:\n  - forward: 0.3 m\n  - turn: 90 deg\n  - forward: 0.3 m\n'
NAMES = ('one', 'two', 'three')


def with_ros(test):
    """Mark a test that needs ROS."""
    return pytest.mark.ros(pytest.mark.needs('rclpy', 'nav_msgs', 'jsonschema')(test))


@pytest.fixture
def lab(tmp_path):
    """Return the file of a fleet of three."""
    (tmp_path / 'out.yaml').write_text(OUT)
    file = tmp_path / 'lab.yaml'
    file.write_text(FLEET)
    return file


@contextlib.contextmanager
def listeners(*names):
    """Yield what robots receive, by name; their bridges are others'."""
    with contextlib.ExitStack() as stack:
        yield {name: stack.enter_context(Listener(name, serves=False)) for name in names}


def fleet(*arguments):
    """Start the command."""
    return Program([*COMMAND, *map(str, arguments)])


@pytest.mark.parametrize(('arguments', 'text'), [
    ([], 'name a fleet (see --list), or the file of one'),
    (['--list', 'minuet'], '--list lists all fleets: leave out FILE'),
    (['minuet', '--plan', '--sim'], '--sim is about a drive'),
    (['minuet', '--plot', 'x.svg', '--on-fault', 'go_on'], '--on-fault is about a drive'),
    (['minuet', '--floor', 'crossing'], '--floor is about the simulated robots of --sim'),
    (['minuet', '--pipe', '--wait'], '--pipe waits for commands already'),
    (['minuet', '--wait', '--start-at', '14:30:00'], '--start-at begins by itself'),
    (['minuet', '--speed', '150'], 'is not from 1% to 100%'),
    (['minuet', '--on-fault', 'run'], "invalid choice: 'run'"),
    (['minuet', '-p', 'x:=1'], 'write ROS arguments after --ros-args')])
def test_options_that_contradict_each_other_are_one_line(arguments, text, capsys):
    with pytest.raises(SystemExit) as caught:
        parse(arguments)
    assert caught.value.code == BAD_USAGE
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert text in lines[0]


@pytest.mark.needs('jsonschema')
def test_the_plan_needs_no_ros_and_moves_nothing(lab, capsys):
    assert main([str(lab), '--plan', '--speed', '50%']) == 0
    text = capsys.readouterr().out
    for name in NAMES:
        assert re.search(rf'^{name}\b', text, re.MULTILINE)
    assert 'on trust' in text


@pytest.mark.needs('jsonschema', 'matplotlib')
def test_the_plot_is_a_file(lab, tmp_path):
    assert main([str(lab), '--plot', str(tmp_path / 'lab.svg'), '--floor', 'crossing']) == 0
    assert '<svg' in (tmp_path / 'lab.svg').read_text()


@pytest.mark.needs('jsonschema')
def test_the_list_has_each_fleet_of_the_package(capsys):
    assert main(['--list']) == 0
    assert re.search(r'^minuet +2 robots  Two robots', capsys.readouterr().out)


@pytest.mark.needs('jsonschema')
def test_a_near_pass_is_refused_before_anything_starts(lab, capsys):
    lab.write_text(FLEET.replace('y: 1 m', 'y: 0.1 m'))
    assert main([str(lab), '--sim']) == BAD_USAGE
    error = capsys.readouterr().err
    assert error.startswith(f'{lab}:5: ')
    assert '--allow-near' in error


@pytest.mark.needs('jsonschema')
def test_a_motion_beyond_a_robot_is_refused_with_its_line(lab, capsys, tmp_path):
    (tmp_path / 'out.yaml').write_text('steps:\n  - forward: {distance: 1 m, speed: 9 m/s}\n')
    assert main([str(lab), '--sim']) == BAD_USAGE
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert all(re.match(rf'{lab}:{line}: robots\.', text) and 'out.yaml:2' in text
               for line, text in zip((4, 5, 6), lines)), lines


@with_ros
def test_it_drives_all_from_one_t0_and_leaves_them_at_rest(lab, tmp_path):
    """Simulated ones, in one process; generous for a busy machine: the benchmark says 5 ms."""
    words = ['--sim', '--quiet', '--report', tmp_path / 'report']
    with listeners(*NAMES) as heard, fleet(lab, *words) as started:
        assert started.end(60.0) == 0, started.text
        first = [one.wait_for(lambda velocity: velocity.moves).time for one in heard.values()]
        assert max(first) - min(first) < 0.1
        for one in heard.values():
            driven = sum(move.linear_x * move.duration for move in one.moves())
            assert driven == pytest.approx(0.6, abs=0.03)
            assert not one.received[-1].moves
    assert 'ready: 3 simulated robots: one, two, three' in started.text
    robots = json.loads((tmp_path / 'report' / 'run.json').read_text())['robots']
    assert {name: robot['motion_file']['text'] for name, robot in robots.items()} == (
        dict.fromkeys(NAMES, OUT))


@with_ros
def test_a_floor_is_in_the_frame_of_all_starts(lab, tmp_path):
    """A wall across the way of the second robot alone."""
    floor = tmp_path / 'floor.yaml'
    floor.write_text('walls: [[[0.4 m, 0.6 m], [0.4 m, 1.4 m]]]')
    with fleet(lab, '--sim', '--quiet', '--floor', floor) as started:
        started.wait_for_text('.two]: contact with a wall at x 0.163 m, y 1.000 m', 60.0)
        started.end(60.0)
    assert started.text.count('contact with') == 1
    floor.write_text('walls: 1')
    with fleet(lab, '--sim', '--floor', floor) as started:
        assert started.end() == BAD_USAGE
    assert started.text.startswith(f'{floor}:1: walls: 1; it must be a list of walls')


@with_ros
def test_if_one_is_missing_nobody_moves(lab):
    with bridge('--namespace', '/one'), bridge('--namespace', '/three'), listeners(
            'one', 'three') as heard, fleet(
                lab, '--quiet', '--ros-args', '-p', 'two.robot_timeout:=4.0') as started:
        assert started.end(40.0) == NO_ROBOT, started.text
        assert not any(velocity.moves for one in heard.values() for velocity in one.received)
    assert 'kachaka_fleet: two: ' in started.text


@with_ros
@pytest.mark.parametrize(('signum', 'code'), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_stops_all(lab, signum, code):
    with listeners(*NAMES) as heard, fleet(lab, '--sim', '--quiet') as started:
        for one in heard.values():
            one.wait_for(lambda velocity: velocity.linear_x > 0.1)
        counts = {name: len(one.received) for name, one in heard.items()}
        sent = started.send(signum)
        assert started.end(20.0) == code, started.text
        for name, one in heard.items():
            zero = one.wait_for(lambda velocity: not velocity.moves, after=counts[name])
            assert zero.time - sent < 0.5, 'on a busy machine; the stop matrix says 20 ms'
            assert not any(later.moves for later in one.received if later.time > zero.time)


@with_ros
@pytest.mark.parametrize(('policy', 'others_end'), [('stop_all', False), ('go_on', True)])
def test_a_fault_of_one_stops_all_or_that_one(lab, policy, others_end):
    with contextlib.ExitStack() as stack:
        bridges = {name: stack.enter_context(bridge('--namespace', f'/{name}'))
                   for name in NAMES}
        heard = stack.enter_context(listeners(*NAMES))
        started = stack.enter_context(fleet(lab, '--quiet', '--on-fault', policy))
        heard['two'].wait_for(lambda velocity: velocity.linear_x > 0.1)
        os.kill(bridges['two'].process.pid, signal.SIGKILL)
        assert started.end(40.0) == FAULTED, started.text
        for name in ('one', 'three'):
            driven = sum(move.linear_x * move.duration for move in heard[name].moves())
            assert (driven == pytest.approx(0.6, abs=0.03)) == others_end, (name, driven)
    assert 'two: ' in started.text


@with_ros
def test_it_stands_by_for_its_service(lab):
    with listeners(*NAMES) as heard, fleet(lab, '--sim', '--quiet', '--wait') as started:
        started.wait_for_text('Standing by')
        response = heard['one'].call('/kachaka_fleet/run')
        assert response.success, response.message
        for one in heard.values():
            one.wait_for(lambda velocity: velocity.linear_x > 0.1)
        assert heard['one'].call('/kachaka_fleet/stop').success
        time.sleep(0.5)
        assert not any(one.received[-1].moves for one in heard.values())
        started.send(signal.SIGTERM)
        assert started.end(20.0) == 143, started.text
