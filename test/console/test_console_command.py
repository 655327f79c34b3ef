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
"""The command ``kachaka_console``: its options, its links, and what it needs."""

from __future__ import annotations

import ast
from pathlib import Path
import subprocess
import sys

import kachaka_simple_control.console
from kachaka_simple_control.console.console_command import (
    drive_options,
    main,
    needs_token,
    parse,
)
from kachaka_simple_control.console.drive_process import fleet_command
import pytest

CONSOLE = Path(kachaka_simple_control.console.__file__).parent


def test_options_of_the_robot_go_to_the_drive_process():
    options = parse(['--port', '0', '--sim', '--lag', '0.1', '--docked', '--robot', 'kachaka',
                     '--ros-args', '-r', '__ns:=/a'])
    assert ['--sim', '--robot=kachaka', '--docked', '--lag=0.1', '--ros-args', '-r', '__ns:=/a'
            ] == drive_options(options)
    assert ['--address=192.0.2.1:26400'] == drive_options(parse(['--address', '192.0.2.1']))
    assert [] == drive_options(parse([]))


def test_a_fleet_gets_its_own_drive_process():
    words = ['--sim', '--allow-near', '--ros-args', '-p', 'x:=1']
    options = parse(['--fleet', './mine.yaml', *words])
    assert words == drive_options(options)
    command = fleet_command(options.fleet, drive_options(options), lambda: ['--report=a/1'])
    assert 'kachaka_simple_control.commands.fleet' in command[2]
    assert ['./mine.yaml', '--pipe', '--report=a/1', '--sim'] == command[3:7]


@pytest.mark.parametrize('words', [[], ['--fleet', 'minuet']])
def test_simulated_robots_have_the_floor_of_the_console(words: list[str]):
    options = parse([*words, '--sim', '--floor', 'crossing'])
    assert ['--sim', '--floor=crossing'] == drive_options(options)


@pytest.mark.parametrize('words, reason', [
    (['--port', 'x'], 'is no port'),
    (['--port', '65536'], 'is no port'),
    (['--lag', '0.1'], 'about the simulated robot of --sim'),
    (['--floor', 'crossing'], '--floor is about the simulated robot of --sim'),
    (['--sim', '--address', '192.0.2.1'], 'not allowed with'),
    (['--prot', '1'], 'did you mean --port?'),
    (['--rate', '50'], ': --rate 50; write, for example, --ros-args -p rate:=50.0'),
    (['--rate=50'], ': --rate=50; write, for example, --ros-args -p rate:=50.0'),
    (['-p', 'rate:=50.0'], '; write ROS arguments after --ros-args'),
    (['--fleet', 'minuet', '--robot', 'kachaka'], 'leave out --robot, or --fleet'),
    (['--fleet', 'minuet', '--address', '192.0.2.1'], 'leave out --address, or --fleet'),
    (['--fleet', 'minuet', '--folder', '.'], 'leave out --folder, or --fleet'),
    (['--fleet', 'minuet', '--beside', '3,4,5'], 'leave out --beside, or --fleet'),
    (['--fleet', 'minuet', '--sim', '--lag', '0.1'], '--lag is about one robot'),
    (['--allow-near'], '--allow-near is about the robots of --fleet'),
])
def test_a_wrong_option_is_one_line(
        words: list[str], reason: str, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as caught:
        parse(words)
    assert 2 == caught.value.code
    text = capsys.readouterr().err
    assert reason in text
    assert 1 == text.count('\n')


def test_without_tornado_a_sentence_says_what_to_install(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setitem(sys.modules, 'tornado', None)
    assert 1 == main(['--no-browser'])
    text = capsys.readouterr().err
    assert "pip install 'kachaka_simple_control[console]'" in text
    assert 1 == text.count('\n')


@pytest.mark.needs('tornado', 'yaml', 'jsonschema')
def test_a_folder_that_is_not_there_is_one_line(capsys: pytest.CaptureFixture[str]):
    assert 2 == main(['--no-browser', '--port', '0', '--folder', '/nowhere'])
    assert "the folder '/nowhere' cannot be opened" in capsys.readouterr().err


@pytest.mark.needs('tornado', 'yaml', 'jsonschema')
def test_a_floor_that_is_not_there_is_one_line(capsys: pytest.CaptureFixture[str]):
    assert 2 == main(['--no-browser', '--port', '0', '--sim', '--floor', './gone.yaml'])
    assert './gone.yaml: there is no such file' in capsys.readouterr().err


@pytest.mark.needs('tornado', 'yaml', 'jsonschema')
def test_a_robot_that_no_drive_could_use_is_one_line(
        capsys: pytest.CaptureFixture[str], tmp_path: Path):
    assert 2 == main(['--no-browser', '--port', '0', '--robot', 'nope'])
    text = capsys.readouterr().err
    assert text.startswith('kachaka_console: nope: there is no robot of this name; ')
    assert 1 == text.count('\n')
    profile = tmp_path / 'robot.yaml'
    profile.write_text('extends: kachaka\nlimits:\n  speed: 1\n  size: 2\n')
    assert 2 == main(['--no-browser', '--port', '0', '--robot', str(profile)])
    text = capsys.readouterr().err
    assert text.startswith(f'kachaka_console: {profile}:')
    assert 1 == text.count('\n')


@pytest.mark.needs('tornado', 'yaml', 'jsonschema')
def test_a_fleet_that_cannot_be_driven_is_one_line_of_its_file(
        capsys: pytest.CaptureFixture[str], tmp_path: Path):
    assert 2 == main(['--no-browser', '--port', '0', '--fleet', 'nope'])
    text = capsys.readouterr().err
    assert text.startswith('kachaka_console: nope: ')
    assert 1 == text.count('\n')
    file = tmp_path / 'mine.yaml'
    file.write_text('robots:\n  r1: {motion: squar}\n  r2: {motion: circl}\n')
    assert 2 == main(['--no-browser', '--port', '0', '--fleet', str(file)])
    text = capsys.readouterr().err
    assert text.startswith(f'kachaka_console: {file}:2: ')
    assert 1 == text.count('\n')


@pytest.mark.needs('tornado', 'yaml', 'jsonschema')
def test_reports_that_no_drive_could_write_are_one_line(
        capsys: pytest.CaptureFixture[str], tmp_path: Path):
    file = tmp_path / 'file'
    file.touch()
    for name in (file, file / 'reports', '/proc/x'):
        assert 2 == main(['--no-browser', '--port', '0', '--reports', str(name)])
        text = capsys.readouterr().err
        assert text.startswith(f'kachaka_console: --reports {name} cannot be written to (')
        assert text.endswith('): name another folder\n')


def test_the_console_needs_no_ros():
    code = ('import sys; from kachaka_simple_control.console import console_command, server; '
            'sys.exit(any(name.partition(".")[0] in ("rclpy", "geometry_msgs") '
            'for name in sys.modules))')
    pytest.importorskip('tornado')
    assert 0 == subprocess.run([sys.executable, '-c', code], check=False, timeout=30).returncode


def test_only_the_server_needs_tornado():
    for path in CONSOLE.glob('*.py'):
        imported = {
            alias.name.partition('.')[0] for node in ast.parse(path.read_text()).body
            if isinstance(node, ast.Import) for alias in node.names}
        assert ('tornado' in imported) == (path.stem == 'server'), path


@pytest.mark.parametrize('words, needed', [
    ([], False), (['--host', '::1'], False), (['--token'], True), (['--host', '0.0.0.0'], True),
    (['--host', '::'], True), (['--host', '192.0.2.1'], True), (['--host', 'robot.lan'], True)])
def test_what_others_can_reach_needs_a_link(words: list[str], needed: bool):
    assert needed == needs_token(parse(words))
