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
"""What is packed: one version, one licence, every file, and no address of where it was made."""

from __future__ import annotations

import ast
from pathlib import Path
import re
import subprocess
import sys
from xml.etree import ElementTree as ET
import zipfile

from program import ROOT
import pytest

NAME = 'kachaka_simple_control'
PACKAGE = ROOT / NAME
HEADER = ROOT.joinpath('setup.py').read_text().split('"""')[0]
# What some ROS package of another name brings along.
BROUGHT = {'rpyutils': 'rclpy'}
# Extras of setup.py: what speaks to a Kachaka alone, whose SDK rosdep does not know, and what
# writes recordings.
EXTRA = {'grpc', 'kachaka_api', 'mcap'}
# With a gap in each, so that this file passes its own test.
ADDRESSES = re.compile('|'.join([
    r'p[y]pi\.org', r'p[y]thonhosted\.org', r'f[i]le://', r'--(extra-)?i[n]dex-url[ =]\S*:',
    r'--f[i]nd-links[ =]\S*/']))
SHEBANG = re.compile(r'#!/usr/bin/env python3\n(#\n)?')

needs_source = pytest.mark.skipif(not PACKAGE.is_dir(), reason='the source is not here')


@pytest.fixture(scope='module')
def manifest() -> ET.Element:
    """Return package.xml."""
    return ET.parse(ROOT / 'package.xml').getroot()


def setup_arguments() -> dict[str, ast.expr]:
    """Return the keyword arguments of the call of setup(), unread."""
    calls = [node for node in ast.walk(ast.parse(ROOT.joinpath('setup.py').read_text()))
             if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'setup']
    return {keyword.arg: keyword.value for keyword in calls[0].keywords}


def git_files() -> list[Path]:
    """Return the files that git knows; skip the test where there is no git."""
    try:
        listing = subprocess.run(
            ['git', 'ls-files', '-z'], cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip('not a git repository')
    return [ROOT / name for name in listing.stdout.split('\0') if (ROOT / name).is_file()]


@pytest.mark.parametrize('tag, argument', [
    ('version', 'version'), ('description', 'description'), ('license', 'license'),
    ('maintainer', 'maintainer')])
def test_setup_and_manifest_agree(manifest, tag, argument):
    assert manifest.findtext(tag) == ast.literal_eval(setup_arguments()[argument])


def test_changelog_begins_with_the_version(manifest):
    headings = re.findall(
        r'^(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)\n-+$',
        ROOT.joinpath('CHANGELOG.rst').read_text(), re.MULTILINE)
    assert headings[0] == manifest.findtext('version')


@pytest.mark.parametrize('distro', ['jazzy', 'kilted'])
def test_the_extra_of_a_distro_is_the_ros_that_the_tests_run_with(distro):
    extra = ast.literal_eval(setup_arguments()['extras_require'])[distro]
    wanted = ROOT.joinpath('requirements', f'{distro}.in').read_text()
    shown = 'kachaka_simple_control[plot,report,live,recording,completion,console]'
    assert extra == [*re.findall(r'^ros-\S+', wanted, re.MULTILINE), shown]


def test_what_reads_the_motions_of_the_package_is_required():
    required = ast.literal_eval(setup_arguments()['install_requires'])
    assert {'PyYAML', 'jsonschema'} <= {name.partition('>=')[0] for name in required}


def test_every_python_file_carries_the_licence():
    assert HEADER.startswith('# Copyright 2026')
    assert HEADER.count('\n') == 13
    bare = [path for path in git_files() if path.suffix == '.py'
            and not SHEBANG.sub('', path.read_text(), count=1).startswith(HEADER)]
    assert bare == []


def test_no_file_has_addresses_of_package_sources():
    found = [path for path in git_files() if ADDRESSES.search(path.read_text(errors='replace'))]
    assert found == []


def imports(path: Path) -> set[str]:
    """Return the top-level modules that a file imports anywhere in it."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules.add(node.module)
    return {module.partition('.')[0] for module in modules}


@needs_source
def test_manifest_names_all_that_is_imported(manifest):
    imported = set().union(*(imports(path) for path in PACKAGE.rglob('*.py')))
    foreign = imported - sys.stdlib_module_names - EXTRA - {NAME}
    named = {element.text.replace('python3-', '') for tag in ('depend', 'exec_depend')
             for element in manifest.iter(tag)}
    assert {BROUGHT.get(module, module) for module in foreign} <= named


def test_every_locked_package_has_a_hash():
    locks = sorted(ROOT.glob('requirements/*.in'))
    assert len(locks) >= 4
    for wanted in locks:
        locked = wanted.with_suffix('.txt').read_text()
        pins = re.findall(r'^[a-z0-9][^\n]*==[^\n]*\n {4}--hash=sha256:', locked, re.MULTILINE)
        assert len(pins) == len(re.findall(r'^[a-z0-9]', locked, re.MULTILINE)) > 0, wanted


@pytest.fixture(scope='module')
def wheel(tmp_path_factory) -> zipfile.ZipFile:
    """Return the wheel that pip builds from a copy of the source."""
    folder = tmp_path_factory.mktemp('wheel')
    source = folder / 'source'
    for path in git_files():
        copy = source / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    subprocess.run(
        [sys.executable, '-m', 'pip', 'wheel', '--quiet', '--no-deps', '--no-build-isolation',
         f'--wheel-dir={folder}', str(source)], check=True)
    return zipfile.ZipFile(next(folder.glob('*.whl')))


@needs_source
@pytest.mark.slow
def test_wheel_has_the_whole_package_and_nothing_else(wheel):
    packed = {name for name in wheel.namelist() if '.dist-info/' not in name and '.data/' not in
              name}
    expected = {path.relative_to(ROOT).as_posix() for path in git_files()
                if path.is_relative_to(PACKAGE)}
    assert packed == expected


@needs_source
@pytest.mark.slow
def test_wheel_has_all_commands_where_pip_puts_commands(wheel):
    entry_points = next(name for name in wheel.namelist() if name.endswith('entry_points.txt'))
    commands = re.findall(r'^(\w+) = ', wheel.read(entry_points).decode(), re.MULTILINE)
    assert sorted(commands) == [
        'kachaka_bridge', 'kachaka_calibrate', 'kachaka_compare', 'kachaka_console',
        'kachaka_fleet',
        'kachaka_sim', NAME]
    # What setup.cfg says for colcon would put scripts below lib/.
    assert [name for name in wheel.namelist() if '.data/' in name and '/lib/' in name] == []


@needs_source
@pytest.mark.slow
def test_wheel_is_known_to_ros(wheel):
    data = [name.partition('.data/data/')[2] for name in wheel.namelist()]
    assert f'share/ament_index/resource_index/packages/{NAME}' in data
    assert f'share/{NAME}/package.xml' in data
