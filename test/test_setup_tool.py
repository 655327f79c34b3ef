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
"""The set-up tool on pretended machines, and with a sourced ROS; ``make`` runs it for real."""

from __future__ import annotations

import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

from program import ROOT
import pytest

TOOLS = ROOT / 'tools'
sys.path.insert(0, str(TOOLS))

import set_up as tool  # noqa: E402, I100

# No ROS of the machine's own may take part; each test says what there is.
BARE = {name: value for name, value in os.environ.items()
        if name not in ('AMENT_PREFIX_PATH', 'PYTHONPATH', 'ROS_DISTRO')}
WITHOUT_ENSUREPIP = """
find = importlib.util.find_spec
importlib.util.find_spec = \
    lambda name, *rest: name not in ("ensurepip", "pip") and find(name, *rest) or None
"""
# Nothing listens on port 9 of this machine; retries would only make the test longer.
NO_NETWORK = {
    'PIP_CONFIG_FILE': os.devnull, 'PIP_INDEX_URL': 'http://127.0.0.1:9/', 'PIP_RETRIES': '1',
    'PIP_EXTRA_INDEX_URL': '', 'PIP_FIND_LINKS': '', 'PIP_PROXY': '', 'no_proxy': '*',
    'UV_DEFAULT_INDEX': 'http://127.0.0.1:9/', 'UV_HTTP_RETRIES': '0', 'UV_NO_CACHE': '1'}


@pytest.fixture
def start(tmp_path):
    """Return a way to start a copy of the tool, without packages, on a pretended machine."""
    shutil.copytree(TOOLS, tmp_path / 'tools', ignore=shutil.ignore_patterns('__pycache__'))
    locks = tmp_path / 'requirements'
    locks.mkdir()
    shutil.copy(ROOT / 'requirements' / 'uv.txt', locks)
    if (ROOT / '.venv-uv').is_dir():
        tmp_path.joinpath('.venv-uv').symlink_to(ROOT / '.venv-uv')
    for name in ('build', 'development', 'colcon', 'kachaka', 'recording', *tool.DISTROS):
        locks.joinpath(f'{name}.txt').write_text('')
    for name in ('setup.py', 'setup.cfg'):
        tmp_path.joinpath(name).write_text('')

    def start(*arguments: str, pretend: str = '', python: str = sys.executable, **more: str):
        script = str(tmp_path / 'tools' / 'set_up.py')
        program = (f'import os, platform, runpy, sys, importlib.util\n{pretend}\n'
                   f'sys.argv = {[script, *arguments]!r}\n'
                   f'runpy.run_path({script!r}, run_name="__main__")')
        return subprocess.run(
            [python, '-c', program], capture_output=True, text=True, env={**BARE, **more},
            stdin=subprocess.DEVNULL, check=False, timeout=120)

    return start


def refusal(result) -> str:
    """Return the one line of a refusal, having made sure that it is one."""
    assert result.returncode == 1, result
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith('set-up: ')
    return lines[0]


@pytest.fixture
def sourced(tmp_path) -> dict[str, str]:
    """Return the environment of a shell where a ROS, of one node and one message, is sourced."""
    library = tmp_path / 'opt' / 'python'
    for path, text in (
            ('rclpy/__init__.py', ''), ('rclpy/node.py', ''), ('geometry_msgs/__init__.py', ''),
            ('geometry_msgs/msg.py', 'class Twist:\n    pass\n')):
        library.joinpath(path).parent.mkdir(parents=True, exist_ok=True)
        library.joinpath(path).write_text(text)
    return {'ROS_DISTRO': 'humble', 'PYTHONPATH': str(library)}


@pytest.mark.parametrize('pretend, words', [
    ('sys.version_info = (3, 8, 10)', ['Python 3.10 or newer', 'this is 3.8', 'PYTHON=']),
    ('platform.machine = lambda: "aarch64"', ['x86-64', 'Linux on aarch64', 'source']),
    ('platform.libc_ver = lambda: ("", "")', ['glibc', 'another C library', 'source']),
    ('platform.libc_ver = lambda: ("glibc", "2.17")', ['2.28', 'this is glibc 2.17']),
    ('sys.platform = "darwin"; platform.system = lambda: "Darwin"', ['Darwin', 'source']),
    ('sys.version_info = (3, 99, 0)', ['3.10 to 3.14', 'PYTHON=']),
    (WITHOUT_ENSUREPIP, ['apt install', '-venv']),
])
def test_refuses_in_one_line_what_cannot_work(start, pretend, words):
    line = refusal(start('.venv', pretend=pretend))
    assert [word for word in words if word not in line] == []


@pytest.mark.slow
def test_a_missing_network_is_reported_in_one_line(start, tmp_path):
    tmp_path.joinpath('requirements', 'build.txt').write_text(
        f'setuptools==79.0.1 --hash=sha256:{"0" * 64}\n')
    result = start('.venv', **NO_NETWORK)
    assert 'is there a network?' in refusal(result)
    assert 'with pip it takes longer' in result.stdout
    assert tmp_path.joinpath('.venv', tool.LOG).read_text()
    assert not tmp_path.joinpath('.venv', tool.STAMP).exists()


@pytest.mark.slow
def test_a_sourced_ros_is_used_and_what_it_lacks_is_told_once(start, sourced, tmp_path):
    pretend = 'platform.machine = lambda: "aarch64"'
    result = start('.venv', '--for=colcon', pretend=pretend, **sourced)
    assert (result.returncode, result.stderr) == (0, '')
    assert 'ROS 2 humble as sourced here' in result.stdout
    assert ('set-up: the recording beside a report needs mcap, which is not here: '
            ".venv/bin/python -m pip install 'mcap>=1.5'\n") in result.stdout
    assert start('.venv', '--for=colcon', pretend=pretend, **sourced).stdout == ''
    # Where it is activated, it is not made again unless a lock changes; then it can be.
    python = str(tmp_path / '.venv' / 'bin' / 'python')
    assert start('.venv', '--for=colcon', python=python, **sourced).stdout == ''
    tmp_path.joinpath('requirements', 'build.txt').write_text('# changed\n')
    again = start('.venv', '--for=colcon', python=python, **sourced)
    assert (again.returncode, again.stderr) == (0, '')
    assert 'done in' in again.stdout


def test_every_library_of_an_extra_is_one_that_is_told_when_it_is_missing():
    text = ROOT.joinpath('setup.py').read_text()
    extras = text[text.index('extras_require'):text.index('zip_safe')]
    named = set(re.findall(r"'([\w-]+)>=[\d.]+'", extras)) | {'numpy'}
    told = ' '.join([*tool.OPTIONAL, *(how for _, how in tool.OPTIONAL.values())])
    assert [name for name in named if name.lower() not in told] == []


def test_another_distro_than_the_sourced_one_is_refused(start, sourced):
    assert 'humble is sourced here' in refusal(start('.venv', '--distro=kilted', **sourced))


def test_a_ros_that_this_python_cannot_use_is_refused_with_the_reason(start, sourced):
    message = Path(sourced['PYTHONPATH'], 'geometry_msgs', 'msg.py')
    message.write_text('import no_such_library\n')
    line = refusal(start('.venv', AMENT_PREFIX_PATH='/opt/ros/humble', **sourced))
    assert "No module named 'no_such_library'" in line
    assert 'PYTHON=/usr/bin/python3' in line


@pytest.mark.slow
def test_a_python_that_is_an_environment_itself_is_refused_with_the_reason(
        start, sourced, tmp_path):
    """A new environment sees the libraries of the Python below, and not those of that one."""
    outer = tmp_path / 'outer'
    subprocess.run([sys.executable, '-m', 'venv', '--without-pip', str(outer)], check=True)
    (libraries,) = outer.glob('lib/python3*/site-packages')
    libraries.joinpath('of_the_outer_one.py').touch()
    message = Path(sourced['PYTHONPATH'], 'geometry_msgs', 'msg.py')
    message.write_text('import of_the_outer_one\n\n\nclass Twist:\n    pass\n')
    python = str(outer / 'bin' / 'python')
    line = refusal(start('.venv', '--for=colcon', python=python, **sourced))
    assert "No module named 'of_the_outer_one'" in line
    assert f'{python} is itself a virtual environment' in line
    assert f'{python} -m pip install -e .' in line
    assert not tmp_path.joinpath('.venv', tool.STAMP).exists()


def test_the_linters_of_humble_are_skipped_where_no_python_can_run_them(tmp_path):
    for name in ('bash', 'dirname'):
        tmp_path.joinpath(name).symlink_to(shutil.which(name))
    result = subprocess.run(
        ['bash', str(TOOLS / 'check_humble_linters.sh'), '/bin/false', '.venv-none'],
        capture_output=True, text=True, check=False, env={'PATH': str(tmp_path)})
    assert (result.returncode, result.stderr) == (0, '')
    assert result.stdout == (
        'check: the linters of Humble are skipped, for they need Python 3.10 or 3.11\n')


def test_the_oldest_releases_are_those_that_the_package_names():
    given = dict(re.findall(
        r'^([\w-]+)==(.+)$', ROOT.joinpath('requirements', 'lowest.in').read_text(), re.MULTILINE))
    named = dict(re.findall(r"'([\w-]+)>=([\d.]+)'", ROOT.joinpath('setup.py').read_text()))
    others = {'grpcio', 'protobuf'}  # what speaks to the robot is installed by itself
    for name, version in named.items():
        assert name in others or f'{given[name.lower()]}.'.startswith(f'{version}.'), name


@pytest.mark.parametrize('error', [tool.RefusalError('no network'), KeyboardInterrupt()])
@pytest.mark.parametrize('was_killed', [False, True])
def test_a_failure_keeps_the_environment_that_was_there(
        monkeypatch, tmp_path, error, was_killed, capsys):
    folder = tmp_path / '.venv'
    made = []

    def make(*_: object) -> None:
        folder.mkdir(exist_ok=True)
        made.append(1)

    def fail(*_: object) -> None:
        folder.mkdir(exist_ok=True)
        folder.joinpath(tool.LOG).write_text('all of it')
        raise error

    monkeypatch.setattr(tool, 'make', make)
    arguments = (folder, 'development', 'jazzy')
    tool.set_up(*arguments, is_sourced=False)
    folder.joinpath('works').touch()
    if was_killed:  # in the middle of another set-up
        folder.rename(tmp_path / '.venv-before')
        folder.mkdir()
    monkeypatch.setattr(tool, 'make', fail)
    for _ in range(2):
        with pytest.raises(type(error)):
            tool.set_up(*arguments, is_sourced=True)
    assert capsys.readouterr().out.endswith('set-up: .venv stays as it was\n')
    assert folder.joinpath('works').exists()
    assert folder.joinpath(tool.LOG).read_text() == 'all of it'
    assert [path.name for path in tmp_path.iterdir()] == ['.venv']
    monkeypatch.setattr(tool, 'make', make)
    tool.set_up(*arguments, is_sourced=False)
    assert made == [1]
