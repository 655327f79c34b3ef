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
"""The set-up tool: what it refuses, in one line; what it chooses; when it does its work again."""

from __future__ import annotations

import ast
from dataclasses import replace
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

import environment  # noqa: E402, I100

# No ROS of the machine's own may take part; each test says what there is.
BARE = {name: value for name, value in os.environ.items()
        if name not in ('AMENT_PREFIX_PATH', 'PYTHONPATH', 'ROS_DISTRO')}
WITHOUT_ENSUREPIP = """
find = importlib.util.find_spec
importlib.util.find_spec = lambda name, *rest: name != "ensurepip" and find(name, *rest) or None
"""


@pytest.fixture
def tool(tmp_path):
    """Return a way to start a copy of the tool on a pretended machine."""
    shutil.copytree(TOOLS, tmp_path / 'tools', ignore=shutil.ignore_patterns('__pycache__'))
    locks = tmp_path / 'requirements'
    locks.mkdir()
    for name in ('build', 'development', 'colcon', 'kachaka', 'recording', *environment.DISTROS):
        locks.joinpath(f'{name}.txt').write_text('')
    for name in ('setup.py', 'setup.cfg'):
        tmp_path.joinpath(name).write_text('')

    def start(*arguments: str, pretend: str = '', python: str = sys.executable, **more: str):
        script = str(tmp_path / 'tools' / 'set_up.py')
        program = (f'import os, platform, runpy, sys, importlib.util\n{pretend}\n'
                   f'sys.path.insert(0, {str(tmp_path / "tools")!r})\n'
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


@pytest.mark.parametrize('pretend, words', [
    ('sys.version_info = (3, 8, 10)', ['Python 3.10 or newer', 'this is 3.8', 'PYTHON=']),
    ('platform.machine = lambda: "aarch64"', ['x86-64', 'Linux on aarch64', 'source']),
    ('platform.libc_ver = lambda: ("", "")', ['glibc', 'source']),
    ('platform.libc_ver = lambda: ("glibc", "2.17")', ['2.28', 'this is 2.17']),
    ('sys.platform = "darwin"; platform.system = lambda: "Darwin"', ['Darwin', 'source']),
    ('sys.version_info = (3, 99, 0)', ['3.10 to 3.14', 'PYTHON=']),
    (WITHOUT_ENSUREPIP, ['apt install', '-venv']),
])
def test_refuses_in_one_line_what_cannot_work(tool, pretend, words):
    line = refusal(tool('.venv', pretend=pretend))
    assert [word for word in words if word not in line] == []


@pytest.mark.parametrize('version', ['3.6', '3.7', '3.8', '3.9'])
def test_an_old_python_is_refused_by_itself(version):
    python = shutil.which(f'python{version}')
    if python is None or subprocess.run([python, '-V'], check=False).returncode != 0:
        pytest.skip(f'no Python {version} here')
    # Started as make does: a too old Python must be able to parse the file.
    result = subprocess.run(
        [python, str(TOOLS / 'set_up.py'), '.venv'], capture_output=True, text=True, check=False)
    assert f'this is {version}' in refusal(result)


def test_the_start_script_can_be_parsed_by_python_3_6():
    ast.parse(TOOLS.joinpath('set_up.py').read_text(), feature_version=(3, 6))


@pytest.mark.slow
def test_a_missing_network_is_reported_in_one_line(tool, tmp_path):
    tmp_path.joinpath('requirements', 'build.txt').write_text(
        f'setuptools==79.0.1 --hash=sha256:{"0" * 64}\n')
    # Nothing listens on port 9 of this machine; retries would only make the test longer.
    nobody = 'http://127.0.0.1:9/'
    line = refusal(tool(
        '.venv', PIP_CONFIG_FILE=os.devnull, PIP_INDEX_URL=nobody, PIP_EXTRA_INDEX_URL='',
        PIP_FIND_LINKS='', PIP_RETRIES='1', PIP_PROXY='', no_proxy='*'))
    assert 'is there a network?' in line
    assert tmp_path.joinpath('.venv', environment.LOG).read_text()
    assert not tmp_path.joinpath('.venv', environment.STAMP).exists()


def test_readme_says_what_a_machine_without_ros_needs():
    readme = ' '.join(ROOT.joinpath('README.md').read_text().split())
    libc = '.'.join(map(str, environment.GLIBC))
    assert f'Linux on x86-64 with glibc {libc} or newer' in readme
    assert f'Python 3.10 to 3.{environment.NEWEST_PYTHON[1]}: for others PyPI' in readme


@pytest.mark.parametrize('name, times', [
    ('README.md', 1), ('docs/lesson.md', 1), ('Makefile', 2), ('tools/environment.py', 1)])
def test_all_say_the_same_about_the_time_that_it_takes(name, times):
    assert ROOT.joinpath(name).read_text().count('about a minute') == times


def test_unknown_distro_is_bad_usage(tool):
    result = tool('.venv', '--distro=hydro')
    assert result.returncode == 2
    assert "'hydro'" in result.stderr


@pytest.mark.needs('yaml')
def test_no_workflow_gives_make_a_distro_that_it_refuses():
    """``make`` takes ``DISTRO`` from the environment, too."""
    import yaml
    given = []
    for file in ROOT.glob('.github/workflows/*.yml'):
        workflow = yaml.safe_load(file.read_text())
        for job in workflow['jobs'].values():
            matrix = job.get('strategy', {}).get('matrix', {})
            named = [part['env']['DISTRO'] for part in (workflow, job, *job['steps'])
                     if 'DISTRO' in part.get('env', {})]
            for step in job['steps']:
                named += re.findall(r'\bDISTRO=(\$\{\{.*?\}\}|\S+)', step.get('run', ''))
            for name in named:
                listed = re.fullmatch(r'\$\{\{ *matrix\.(\w+) *\}\}', name)
                given += matrix[listed[1]] if listed else [name]
    assert set(given) <= set(environment.DISTROS)


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


def test_a_sourced_ros_is_used_whatever_the_machine(sourced, monkeypatch, tmp_path):
    monkeypatch.setattr(environment.platform, 'machine', lambda: 'aarch64')
    for name, value in sourced.items():
        monkeypatch.setenv(name, value)
    found = environment.recipe(tmp_path, None, 'development')
    assert (found.distro, found.sourced) == ('humble', True)
    assert [path.stem for path in found.locks()] == [
        'build', 'development', 'kachaka', 'recording']


def test_a_sourced_ros_without_optional_libraries_is_told_what_for(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(environment, 'run', lambda *command: None)
    monkeypatch.setattr(environment, 'lacking', lambda python: ['rich', 'mcap'])
    environment.make(environment.Recipe(tmp_path / '.venv', 'humble', True, 'development'))
    assert capsys.readouterr().out == (
        'set-up: the live display needs rich, which is not here: sudo apt install python3-rich\n'
        'set-up: the recording beside a report needs mcap, which is not here: '
        ".venv/bin/python -m pip install 'mcap>=1.5'\n")
    environment.make(environment.Recipe(tmp_path / '.venv', 'jazzy', False, 'development'))
    assert capsys.readouterr().out == ''


def test_what_an_environment_lacks_is_found(monkeypatch):
    monkeypatch.setattr(environment, 'OPTIONAL', {'json': ('', ''), 'no_such_library': ('', '')})
    assert environment.lacking(Path(sys.executable)) == ['no_such_library']


def test_every_library_of_an_extra_is_one_that_is_told_when_it_is_missing():
    text = ROOT.joinpath('setup.py').read_text()
    extras = text[text.index('extras_require'):text.index('zip_safe')]
    named = set(re.findall(r"'([\w-]+)>=[\d.]+'", extras)) | {'numpy'}
    told = ' '.join([*environment.OPTIONAL, *(how for _, how in environment.OPTIONAL.values())])
    assert [name for name in named if name.lower() not in told] == []


def test_another_distro_than_the_sourced_one_is_refused(tool, sourced):
    line = refusal(tool('.venv', '--distro=kilted', **sourced))
    assert 'humble is sourced here' in line


def test_a_ros_that_is_sourced_for_another_python_is_refused(tool):
    line = refusal(tool(
        '.venv', pretend=f'sys.executable = {shutil.which("false")!r}',
        ROS_DISTRO='humble', AMENT_PREFIX_PATH='/opt/ros/humble'))
    assert 'cannot use it' in line
    assert 'PYTHON=/usr/bin/python3' in line


def test_a_ros_whose_messages_cannot_be_used_is_refused_with_the_reason(tool, sourced):
    message = Path(sourced['PYTHONPATH'], 'geometry_msgs', 'msg.py')
    message.write_text('import no_such_library\n')
    line = refusal(tool('.venv', AMENT_PREFIX_PATH='/opt/ros/humble', **sourced))
    assert "No module named 'no_such_library'" in line


@pytest.mark.slow
def test_a_python_that_is_an_environment_itself_is_refused_with_the_reason(
        tool, sourced, tmp_path):
    """A new environment sees the libraries of the Python below, and not those of that one."""
    outer = tmp_path / 'outer'
    subprocess.run([sys.executable, '-m', 'venv', '--without-pip', str(outer)], check=True)
    (libraries,) = outer.glob('lib/python3*/site-packages')
    libraries.joinpath('of_the_outer_one.py').touch()
    message = Path(sourced['PYTHONPATH'], 'geometry_msgs', 'msg.py')
    message.write_text('import of_the_outer_one\n\n\nclass Twist:\n    pass\n')
    python = str(outer / 'bin' / 'python')
    line = refusal(tool('.venv', '--for=colcon', python=python, **sourced))
    assert "No module named 'of_the_outer_one'" in line
    assert f'{python} is itself a virtual environment' in line
    assert f'{python} -m pip install -e .' in line
    assert 'PYTHON=/usr/bin/python3' in line
    assert not tmp_path.joinpath('.venv', environment.STAMP).exists()


def test_the_name_of_a_distro_alone_is_no_ros(monkeypatch, tmp_path):
    monkeypatch.setenv('ROS_DISTRO', 'humble')
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    monkeypatch.setattr(environment, 'require_wheels', lambda: None)
    monkeypatch.setattr(environment.sys, 'executable', shutil.which('false'))
    found = environment.recipe(tmp_path, None, 'development')
    assert (found.distro, found.sourced) == ('jazzy', False)
    assert [path.stem for path in found.locks()] == [
        'build', 'development', 'kachaka', 'recording', 'jazzy']


def test_the_oldest_releases_need_python_3_10_and_no_ros(sourced, monkeypatch, tmp_path):
    for name, value in sourced.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(environment.sys, 'version_info', (3, 10, 12))
    found = environment.recipe(tmp_path, None, 'lowest')
    assert [path.stem for path in found.locks()] == ['build', 'lowest']
    assert 'without ROS' in str(found)
    monkeypatch.setattr(environment.sys, 'version_info', (3, 11, 4))
    with pytest.raises(environment.RefusalError, match='need Python 3.10'):
        environment.recipe(tmp_path, None, 'lowest')


def test_the_linters_of_humble_need_no_ros(sourced, monkeypatch, tmp_path):
    for name, value in sourced.items():
        monkeypatch.setenv(name, value)
    found = environment.recipe(tmp_path, None, 'humble-linters')
    assert [path.stem for path in found.locks()] == ['build', 'humble-linters']
    assert 'the linters of Humble, without ROS' in str(found)


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


@pytest.fixture
def made(monkeypatch) -> list[environment.Recipe]:
    """Return the recipes made so far; nothing is really installed."""
    recipes: list[environment.Recipe] = []

    def make(recipe: environment.Recipe) -> None:
        recipe.folder.mkdir(exist_ok=True)
        recipes.append(recipe)

    monkeypatch.setattr(environment, 'make', make)
    return recipes


def test_is_done_once(made, tmp_path):
    recipe = environment.Recipe(tmp_path / '.venv', 'jazzy', False, 'development')
    environment.set_up(recipe)
    environment.set_up(recipe)
    assert made == [recipe]


def test_is_done_again_when_its_python_or_its_ros_changes(made, monkeypatch, tmp_path):
    recipe = environment.Recipe(tmp_path / '.venv', 'jazzy', False, 'development')
    environment.set_up(recipe)
    monkeypatch.setattr(environment.sys, 'executable', '/usr/bin/another')
    environment.set_up(recipe)
    environment.set_up(replace(recipe, sourced=True))
    assert len(made) == 3


def test_is_not_done_again_in_a_shell_where_it_is_activated(made, monkeypatch, tmp_path):
    """There the Python that runs the tool is that of the environment, a link to the same file."""
    recipe = environment.Recipe(tmp_path / '.venv', 'jazzy', False, 'development')
    environment.set_up(recipe)
    activated = tmp_path / 'python3'
    activated.symlink_to(os.path.realpath(sys.executable))
    monkeypatch.setattr(environment.sys, 'executable', str(activated))
    environment.set_up(recipe)
    assert made == [recipe]


@pytest.mark.slow
def test_an_activated_environment_can_be_made_again(tool, sourced, tmp_path):
    assert tool('.venv', '--for=colcon', **sourced).returncode == 0
    tmp_path.joinpath('requirements', 'build.txt').write_text('# changed\n')
    python = str(tmp_path / '.venv' / 'bin' / 'python')
    again = tool('.venv', '--for=colcon', python=python, **sourced)
    assert (again.returncode, again.stderr) == (0, '')
    assert 'done in' in again.stdout


@pytest.mark.parametrize('error', [environment.RefusalError('no network'), KeyboardInterrupt()])
def test_a_failure_keeps_the_environment_that_was_there(
        made, monkeypatch, tmp_path, error, capsys):
    recipe = environment.Recipe(tmp_path / '.venv', 'jazzy', False, 'development')
    environment.set_up(recipe)
    recipe.folder.joinpath('works').touch()

    def fail(wanted: environment.Recipe) -> None:
        wanted.folder.mkdir()
        wanted.folder.joinpath(environment.LOG).write_text('all of it')
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(environment, 'make', fail)
        for _ in range(2):
            with pytest.raises(type(error)):
                environment.set_up(replace(recipe, sourced=True))
    assert capsys.readouterr().out.endswith('set-up: .venv stays as it was\n')
    assert recipe.folder.joinpath('works').exists()
    assert recipe.folder.joinpath(environment.LOG).read_text() == 'all of it'
    assert [path.name for path in tmp_path.iterdir()] == ['.venv']
    environment.set_up(recipe)
    assert made == [recipe]


def test_a_set_up_that_was_killed_loses_no_environment(made, monkeypatch, tmp_path):
    recipe = environment.Recipe(tmp_path / '.venv', 'jazzy', False, 'development')
    environment.set_up(recipe)
    recipe.folder.joinpath('works').touch()
    recipe.folder.rename(tmp_path / '.venv-before')
    recipe.folder.mkdir()

    def fail(_: environment.Recipe) -> None:
        raise environment.RefusalError('no network')

    with monkeypatch.context() as patch:
        patch.setattr(environment, 'make', fail)
        with pytest.raises(environment.RefusalError):
            environment.set_up(replace(recipe, sourced=True))
    assert recipe.folder.joinpath('works').exists()
    environment.set_up(replace(recipe, sourced=True))
    assert [path.name for path in tmp_path.iterdir()] == ['.venv']


def test_is_done_again_after_a_failure(made, monkeypatch, tmp_path):
    recipe = environment.Recipe(tmp_path / '.venv', 'jazzy', False, 'development')

    def fail(_: environment.Recipe) -> None:
        raise environment.RefusalError('no')

    with monkeypatch.context() as patch:
        patch.setattr(environment, 'make', fail)
        with pytest.raises(environment.RefusalError):
            environment.set_up(recipe)
    environment.set_up(recipe)
    assert made == [recipe]


@pytest.mark.parametrize('output, line', [
    ('WARNING: Retrying after connection broken by NewConnectionError\nERROR: No matching',
     'is there a network?'),
    ('Collecting\nERROR: first\nERROR: THESE PACKAGES DO NOT MATCH THE HASHES\nfound: x\n',
     'ERROR: THESE PACKAGES DO NOT MATCH THE HASHES'),
    ('Traceback\n  File\nModuleNotFoundError: No module named x\n', 'No module named x'),
    ('error: failed\n  ImportError: x\n  [end of output]\nERROR: Failed\nhint: above', 'Error: x'),
    ('Metadata is wrong\nhint: See above for details.\n', 'Metadata is wrong'),
    ('', 'without a word'),
])
def test_reason_is_one_line(output, line):
    reason = environment.reason(output)
    assert line in reason
    assert '\n' not in reason
