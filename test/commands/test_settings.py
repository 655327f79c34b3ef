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
"""Which robot and rate a motion gets, from options, parameters and its file."""

from __future__ import annotations

import contextlib

from golden import answers, compare
from kachaka_simple_control.commands.cli import parse
from kachaka_simple_control.commands.settings import (
    choose_settings,
    chosen_speed,
    describe_overrides,
    order_of,
)
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.ros.node_parameters import require_parameters_only
import pytest

pytestmark = pytest.mark.needs('jsonschema', 'yaml')

#: Files of motions: what stands in them, and their names.
FAST = ('rate: 50 Hz\nrobot: generic\nsteps: [wait: 1 s]', 'fast.yaml')
PLAIN = ('steps: [wait: 1 s]', 'plain.yaml')


def settings(words, file):
    """Return the settings of a command line, and what they override."""
    options = parse(words.split())
    motion_file = file and loads(*file)
    chosen = choose_settings(options, motion_file)
    return chosen, describe_overrides(options, motion_file, chosen)


@pytest.mark.parametrize('words, file, robot, rate, overridden', [
    ('', None, 'kachaka', 10.0, []),
    ('', PLAIN, 'kachaka', 10.0, []),
    ('', FAST, 'generic', 50.0, []),
    ('--rate 20', PLAIN, 'kachaka', 20.0, []),
    ('--rate 20', FAST, 'generic', 20.0, ['rate is 20 Hz by --rate, not 50 Hz as in fast.yaml']),
    ('--rate 50 --robot generic', FAST, 'generic', 50.0, []),
    ('--ros-args -p rate:=20', None, 'kachaka', 20.0, []),
    ('--ros-args -p rate:=20', FAST, 'generic', 20.0,
     ['rate is 20 Hz by parameter rate, not 50 Hz as in fast.yaml']),
    ('--ros-args -p rate:=30 --param rate:=20.0', PLAIN, 'kachaka', 20.0, []),
    ('--rate 20 --ros-args -p rate:=20.0', PLAIN, 'kachaka', 20.0, []),
    ('--robot turtlebot3', FAST, 'turtlebot3', 50.0,
     ['robot is turtlebot3 by --robot, not generic as in fast.yaml']),
    ("--ros-args -p robot:='turtlebot3' -p robot_timeout:=3", FAST, 'turtlebot3', 50.0,
     ['robot is turtlebot3 by parameter robot, not generic as in fast.yaml']),
    # For other nodes: ROS gives them to those.
    ('--ros-args -p other:rate:=20', PLAIN, 'kachaka', 10.0, []),
    ('--ros-args -r rate:=20', PLAIN, 'kachaka', 10.0, []),
])
def test_an_option_wins_over_the_file_and_that_over_the_default(
        words, file, robot, rate, overridden):
    chosen, lines = settings(words, file)
    assert (chosen.robot, chosen.rate, chosen.profile.name) == (robot, rate, robot)
    assert lines == overridden


CLOSED = ('closed_loop: true\nsteps: [forward: 1 m]', 'closed.yaml')


@pytest.fixture
def measured(tmp_path):
    """Return the words that name a robot whose delay is known."""
    file = tmp_path / 'own.yaml'
    file.write_text('extends: kachaka\ncalibration: {delay: 0.3 s}')
    return f'--robot {file}'


@pytest.mark.parametrize('words, file, closed_loop, overridden', [
    ('', PLAIN, False, []),
    ('', CLOSED, True, []),
    ('--closed-loop', PLAIN, True, []),
    ('--closed-loop --ros-args -p closed_loop:=true', PLAIN, True, []),
    ('--no-closed-loop', CLOSED, False,
     ['closed_loop is false by --no-closed-loop, not true as in closed.yaml']),
    ('--ros-args -p closed_loop:=Off', CLOSED, False,
     ['closed_loop is false by parameter closed_loop, not true as in closed.yaml']),
])
def test_a_loop_is_closed_by_what_wins(words, file, closed_loop, overridden, measured):
    chosen, lines = settings(f'{measured} {words}', file)
    assert chosen.closed_loop is closed_loop
    assert lines == overridden


def test_what_needs_all_of_the_limits_cannot_be_corrected(measured):
    file = ('closed_loop: true\nsteps:\n  - move: {linear_x: 0.3, angular_z: 0, duration: 1}',
            'fast.yaml')
    chosen, _ = settings(measured, file)
    with pytest.raises(MotionFileError) as caught:
        order_of(parse([]), loads(*file), chosen, chosen.profile)
    assert str(caught.value) == (
        "fast.yaml:3: step 1: move.linear_x: 0.3 m/s, outside the closed loop's limits of -0.27 "
        'to 0.27 m/s')


WATCHED = ('watch: true\nsteps: [forward: 1 m]', 'watched.yaml')


@pytest.mark.parametrize('words, file, watch, overridden', [
    ('', None, False, []),
    ('--watch', None, True, []),
    ('', WATCHED, True, []),
    ('--watch --ros-args -p watch:=true', PLAIN, True, []),
    ('--no-watch', WATCHED, False,
     ['watch is false by --no-watch, not true as in watched.yaml']),
    ('--ros-args -p watch:=off', WATCHED, False,
     ['watch is false by parameter watch, not true as in watched.yaml']),
])
def test_the_way_is_watched_as_what_wins_says(words, file, watch, overridden):
    chosen, lines = settings(words, file)
    assert chosen.watch is watch
    assert lines == overridden


def test_steps_backwards_are_refused_with_a_watch_alone():
    file = loads('steps: [forward: -1 m]', 'back.yaml')
    for words in ('--watch', '--no-watch'):
        options = parse([words])
        chosen = choose_settings(options, file)
        refused = pytest.raises(MotionFileError, match='^back.yaml:1: step 1: forward: driven b')
        with refused if chosen.watch else contextlib.nullcontext():
            order_of(options, file, chosen, chosen.profile)


CUT = ('corners: 5 cm\nsteps: [forward: 1 m]', 'cut.yaml')


@pytest.mark.parametrize('words, file, corners, overridden', [
    ('', PLAIN, 0.0, []),
    ('', CUT, 0.05, []),
    ('--corners 10cm', PLAIN, 0.1, []),
    ('--corners 5cm', CUT, 0.05, []),
    ('--corners 20mm', CUT, 0.02, ['corners is 0.02 m by --corners, not 0.05 m as in cut.yaml']),
    ('--corners 0', CUT, 0.0, ['corners is 0 m by --corners, not 0.05 m as in cut.yaml']),
    ('--corners=0cm', CUT, 0.0, ['corners is 0 m by --corners, not 0.05 m as in cut.yaml']),
    ('--corners 5cm --ros-args -p corners:=0.05', PLAIN, 0.05, []),
    ('--ros-args -p corners:=0.1', CUT, 0.1,
     ['corners is 0.1 m by parameter corners, not 0.05 m as in cut.yaml']),
    ('--ros-args -p corners:=0', CUT, 0.0,
     ['corners is 0 m by parameter corners, not 0.05 m as in cut.yaml']),
    ('--corners 1m', PLAIN, 1.0, []),
])
def test_corners_are_cut_by_what_wins(words, file, corners, overridden):
    chosen, lines = settings(words, file)
    assert chosen.corners == corners
    assert lines == overridden
    order = order_of(parse(words.split()), loads(*file), chosen, chosen.profile)
    assert order.motion.corners == corners


#: What is refused beside a file that names robot and rate.
REFUSED = (
    '--rate 20 --ros-args -p rate:=30',
    '--robot generic --ros-args -p robot:=kachaka',
    '--ros-args -p rate:=fast',
    '--ros-args -p rate:=12,5',
    '--ros-args -p rate:=2',
    '--ros-args -p rate:=nan',
    '--ros-args -p robt:=generic',
    '--closed-loop',
    '--no-closed-loop --ros-args -p closed_loop:=true',
    '--ros-args -p closed_loop:=maybe',
    '--watch',
    '--no-watch --ros-args -p watch:=true',
    '--ros-args -p watch:=maybe',
    '--corners 5cm --ros-args -p corners:=0.1',
    '--corners 0 --ros-args -p corners:=0.1',
    '--ros-args -p rate:=50Hz',
    '--ros-args -p rate:=\u221210',
    '--ros-args -p corners:=0,05',
    '--ros-args -p corners:=0.05m',
    '--ros-args -p corners:=5cm',
    '--ros-args -p corners:=-0.05',
    '--ros-args -p corners:=2',
    '--ros-args -p corners:=nan',
    '--ros-args -p corner:=0.05',
)


def test_what_cannot_be_is_refused_in_one_line():
    def refusal(words: str) -> str:
        with pytest.raises(UsageError) as caught:
            settings(words, FAST)
        return str(caught.value)

    compare('settings', answers(REFUSED, refusal))


def test_a_rate_of_a_file_that_cannot_be_is_refused_with_its_line():
    file = ('steps: [wait: 1 s]\nrate: 2 Hz', 'slow.yaml')
    line = 'rate: 2 Hz; for kachaka it must be from 5 to 1000 Hz'
    with pytest.raises(MotionFileError) as caught:
        settings('', file)
    assert str(caught.value) == f'slow.yaml:2: {line}'
    assert settings('--rate 20', file)[0].rate == 20.0


@pytest.mark.parametrize('robot, text', [
    ('kachka', 'there is no robot of this name; did you mean'),
    ('./no.yaml', 'there is no such file')])
def test_an_unknown_robot_of_a_file_is_refused_with_its_line(robot, text):
    file = (f'robot: {robot}\nsteps: [wait: 1 s]', 'mine.yaml')
    with pytest.raises(MotionFileError) as caught:
        settings('', file)
    assert str(caught.value).startswith(f'mine.yaml:1: robot: {robot}: {text}')
    assert settings('--robot generic', file)[0].robot == 'generic'
    with pytest.raises(UsageError, match='^kachkb: there is no robot of this name'):
        settings('--robot kachkb', file)


@pytest.mark.parametrize('words, refused', [
    ('', None),
    ('--ros-args -p rate:=20 --param robot:=generic --', None),
    ('--ros-args -r __node:=one', '-r'),
    ('--ros-args -p rate:=20 --params-file x.yaml', '--params-file'),
    ('--ros-args -p other:rate:=20', 'other:rate:=20'),
    ('--ros-args -p rate', 'rate'),
    ('--ros-args -p', '-p'),
    ('--ros-args -p speed_factor:=0.5', 'speed_factor'),
])
def test_what_a_plan_cannot_follow_is_refused(words, refused):
    expected = contextlib.nullcontext() if refused is None else pytest.raises(
        UsageError, match=f'leave out {refused}$')
    with expected:
        require_parameters_only('--plan', words.split())


@pytest.mark.parametrize('words, speed', [
    ('', None), ('--speed 50%', 0.5), ('--speed 50', 0.5), ('--speed 100%', 1.0),
    ('--speed 50% --ros-args -p speed_factor:=0.5', 0.5), ('--speed 1%', 0.01),
    ('--speed 2', 0.02), ('--speed 100', 1.0),
    ('--ros-args -p speed_factor:=0.5', None),
])
def test_the_speed_is_a_part_of_the_planned_one(words, speed):
    assert chosen_speed(parse(words.split())) == speed
