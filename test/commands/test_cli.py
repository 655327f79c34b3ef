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
"""Arguments and exit codes, without ROS."""

from importlib import metadata
import os
from pathlib import Path
import re
import subprocess

from golden import answers, compare
import kachaka_simple_control
from kachaka_simple_control.commands import drive_or_preview
from kachaka_simple_control.commands.cli import Options, parse, split_ros_arguments
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.process.version import ros_distro
from program import COMMAND, environment
import pytest


def test_without_arguments_it_is_the_lesson_on_a_real_robot():
    assert parse([]) == Options()
    assert not parse([]).is_preview


def test_several_motions_can_be_shown_and_one_driven():
    assert parse(['square', 'circle', '--plan']).motions == ('square', 'circle')
    assert parse(['square', '--sim', '--rate', '50']) == Options(('square',), sim=True, rate=50.0)


@pytest.mark.parametrize('words', [
    '--rate 50 --lag 0.1', '--rate 50Hz --lag 0.1s', '--rate=50_Hz --lag=0.1_s'])
def test_a_number_may_have_the_unit_of_its_option(words):
    chosen = parse(['--sim', *(word.replace('_', ' ') for word in words.split())])
    assert (chosen.rate, chosen.simulation) == (50.0, ('--lag=0.1',))


#: Command lines that are refused.
REFUSED = (
    '--fast', '--rate fast',
    # Numbers that are written for people, or have the minus of a word processor.
    '--rate 10,5', '--rate \u221210', '--rate \u22120,5Hz', '--rate 1kHz', '--sim --lag 0,1',
    '--sim --lag 1min', '--sim --lag=-0.2s', '--sim --undock-velocity 0', '--sim --lag inf',
    '--sim --odometry-scale 0.4', '--speed=\u221250%',
    'square circle', '--plot', '--report', '--report runs --plan',
    '--report runs --list', '--report runs --plot square.png', '--plan --sim', '--list --wait',
    '--plot a.png --address robot', '--plan --quiet',
    # Errors without a simulated robot, or impossible ones.
    '--lag 0.1', '--address robot --docked', '--sim --lag -1',
    '--repeat 0', '--repeat x', '--repeat 2 --wait', '--repeat 2 --plan',
    # A time after --wait is no motion.
    '--wait 30', '--wait 30s', '--wait 2.5', '--wait inf', '--wait forever',
    # The nearest option is offered.
    # What would be ignored.
    '--list foo', '--report=', '--sim --report=',
    '--sim -p rate:=10', '--sim rate:=10', '-r __ns:=/a', '--params-file=a.yaml',
    '--simm', '--raet=3', '--reprot', '--xyzzy',
    '--speed=0', '--speed=0%', '--speed=150%', '--speed=150', '--speed=1.5', '--speed=0.5%',
    '--speed=half', '--speed=nan', '--speed=-50%', '--speed=%', '--speed=',
    # Full speed for one person is a hundredth of it for another.
    '--speed 1', '--speed 1.0', '--speed 1.5', '--speed 0.5', '--speed 0.01', '--speed 0,5',
    '--speed 12,5', '--speed 12,5%',
    '--corners', '--corners=-5cm', '--corners -5cm', '--corners 5', '--corners 2m',
    '--corners 100000km', '--corners nan', '--corners=-inf', '--corners 1e999m', '--corners 5%',
    '--corners 0,5m', '--corners=', '--cornres 5cm', '--within 2', '--within 2cm,', '--within',
    '--plan --within 2cm',
    # Values of parameters.
    '--with side=1m', '--wait --with side=1m', '--list --with side=1m', '--pipe --with side=1m',
    'square --with', 'square --with side', 'square --with =1m', 'square --with = --plan',
    'square --with side=1m --with laps=2 --with side=2m', 'square side=1m',
    'square --with side=1m laps=2',
)


def test_bad_usage_is_one_sentence_and_exit_code_2(capsys):
    def refusal(words: str) -> str:
        with pytest.raises(SystemExit) as caught:
            parse(words.split())
        assert caught.value.code == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    compare('command_line', answers(REFUSED, refusal))


def test_the_errors_of_the_simulated_robot_are_passed_on():
    options = parse(['--sim', '--linear-gain', '0.95', '--docked', '--seed', '3'])
    assert options.simulation == ('--docked', '--seed=3', '--linear-gain=0.95')
    assert parse(['--sim']).simulation == ()


def test_the_floor_of_the_simulated_robot_is_passed_on(capsys):
    options = parse(['--sim', '--lag', '0.1', '--floor', './lab.yaml'])
    assert options.simulation == ('--lag=0.1', '--floor=./lab.yaml')
    assert options.floor_file == './lab.yaml'
    with pytest.raises(SystemExit):
        parse(['--floor', './lab.yaml'])
    assert '--floor is about the simulated robot of --sim' in capsys.readouterr().err


@pytest.mark.parametrize('text, metres', [
    ('5cm', 0.05), ('5 cm', 0.05), ('50mm', 0.05), ('0.05m', 0.05), ('0', 0.0), ('0.0', 0.0),
    ('0 cm', 0.0), ('0m', 0.0), ('1 m', 1.0)])
def test_a_tolerance_of_corners_is_a_length_or_0(text, metres):
    assert parse(['square', '--corners', text]).corners == metres
    assert parse(['square', '--plan', f'--corners={text}']).corners == metres
    assert parse(['square']).corners is None


def test_a_value_of_a_parameter_is_what_follows_the_first_equals_sign():
    words = ['--with', 'side=1m', 'square', '--with', 'laps = 2', '--with=a==b', '--with', 'b=']
    assert parse(words).values == (('side', '1m'), ('laps', '2'), ('a', '=b'), ('b', ''))
    assert parse(['./a=b.yaml', '--plan']).motions == ('./a=b.yaml',)
    assert parse(['a=b.yaml', '--plan']).motions == ('a=b.yaml',)


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as caught:
        parse(['--version'])
    assert caught.value.code == 0
    said = f'kachaka_simple_control {kachaka_simple_control.__version__}\n'
    assert capsys.readouterr().out == said
    assert re.fullmatch(r'\d+\.\d+\.\d+', kachaka_simple_control.__version__)


def test_the_distribution_of_ros_is_known_without_its_variable(monkeypatch):
    monkeypatch.setenv('ROS_DISTRO', 'rolling')
    assert ros_distro() == 'rolling'
    monkeypatch.delenv('ROS_DISTRO')
    monkeypatch.setattr(metadata, 'version', {'ros-kilted-rclpy': '9.1.2'}.__getitem__)
    monkeypatch.setattr(metadata, 'PackageNotFoundError', KeyError)
    assert ros_distro() == 'kilted'


@pytest.mark.parametrize('arguments, own, ros', [
    (['--sim', '--ros-args', '-r', 'a:=b'], ['--sim'], ['--ros-args', '-r', 'a:=b']),
    (['--ros-args', '-p', 'x:=1', '--', '--sim'], ['--sim'], ['--ros-args', '-p', 'x:=1', '--']),
    (['--ros-args', '--', '--sim', '--ros-args', '-p', 'x:=1'], ['--sim'],
     ['--ros-args', '--', '--ros-args', '-p', 'x:=1']),
])
def test_the_arguments_of_ros_are_left_to_ros(arguments, own, ros):
    assert split_ros_arguments(arguments) == (own, ros)


@pytest.mark.parametrize('option', ['--list', '--plan'])
def test_a_reader_that_closes_the_pipe_is_no_error(option):
    """As in ``--list | head -1``."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer) as full:
        ended = subprocess.run(
            [*COMMAND, option], check=False, stdout=full, stderr=subprocess.PIPE, text=True,
            timeout=60)
    assert (ended.returncode, ended.stderr) == (0, '')


@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize('options, what', [
    (['--list'], 'the list'), (['square', '--plan'], 'the plan')])
def test_what_cannot_be_printed_is_one_line(options, what):
    with Path('/dev/full').open('w') as full:
        ended = subprocess.run(
            [*COMMAND, *options], check=False, stdout=full, stderr=subprocess.PIPE, text=True,
            timeout=60)
    assert ended.returncode == 1
    assert ended.stderr == (f'kachaka_simple_control: {what} cannot be printed: No space left on '
                            'device\n')


@pytest.mark.slow
@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize('encoding', ['ascii', 'latin-1', 'cp932'])
@pytest.mark.parametrize('options', [['--plan'], ['--list', '--plan'], ['--plot', '図.png']])
def test_names_that_a_terminal_cannot_show_are_no_error(encoding, options, tmp_path):
    text = 'name: 正方形é\nsteps: [forward: 1 m]'
    (tmp_path / '正方形é.yaml').write_text(text, encoding='utf-8')
    words = [part.replace('図', str(tmp_path / '図')) for part in options]
    ended = subprocess.run(
        [*COMMAND, str(tmp_path / '正方形é.yaml'), *words], check=False, capture_output=True,
        timeout=60, env=environment(PYTHONIOENCODING=encoding))
    assert (ended.returncode, ended.stderr) == (0, b'')
    if encoding == 'ascii' and '--plan' in options:
        assert b'\\u6b63' in ended.stdout


@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize('text', [
    'steps: [wait: 1 s', 'steps: [{wait: 2 m}]\nrate: x\n',
    'steps: [turn: {angle: 90 deg, speed: 9 rad/s}]', 'steps: [wait: 1 s]\nrobot: ./bad.yaml'])
def test_the_errors_of_a_file_begin_with_file_and_line(text, tmp_path):
    """At the start of a line, where editors make a link of it."""
    (tmp_path / 'bad.yaml').write_text('name: bad\nlimit: 1\n')
    (tmp_path / 'mine.yaml').write_text(text)
    ended = subprocess.run(
        [*COMMAND, './mine.yaml', '--plan'], cwd=tmp_path, env=environment(), capture_output=True,
        text=True, check=False)
    assert ended.returncode == 2
    lines = ended.stderr.splitlines()
    assert lines
    assert all(re.match(r'(\./)?(mine|bad)\.yaml:\d+: ', line) for line in lines), lines


@pytest.fixture
def asked(monkeypatch):
    """Return a function that runs the command; it tells the exit code, questions and drives."""
    def run(*arguments, is_refused=False):
        floors, driven = [], []

        def confirm(floor_size):
            floors.append(floor_size)
            if is_refused:
                raise UsageError('not confirmed: nothing was driven')

        monkeypatch.setattr(drive_or_preview, 'confirm', confirm)
        monkeypatch.setattr(drive_or_preview, 'drive', driven.append)
        return drive_or_preview.main(arguments), floors, len(driven)

    return run


@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize(('words', 'questions', 'drives'), [
    (['--address', 'robot'], 1, 1),
    (['--address', 'robot', '--yes'], 0, 1),
    (['--address', 'robot', '--wait'], 1, 1),
    (['--address', 'robot', '--repeat', '2'], 2, 2),
    (['--address', 'robot', '--repeat', '2', '--yes'], 0, 2),
    (['--sim'], 0, 1),
    ([], 0, 1)])
def test_before_a_real_robot_of_its_own_it_asks_with_the_floor(asked, words, questions, drives):
    assert asked('square', *words) == (0, questions * ['1.04 m x 1.04 m'], drives)


@pytest.mark.needs('yaml', 'jsonschema')
def test_what_is_refused_is_not_driven(asked):
    assert asked('--address', 'robot', '--repeat', '2', is_refused=True)[::2] == (2, 0)
