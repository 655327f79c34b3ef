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
"""The tests run wherever they are started, and none of them is left out unseen."""

from __future__ import annotations

import os
import subprocess
import sys

from optional_libraries import lack
from program import ROOT
import pytest

TESTS = ROOT / 'test'
#: What Humble's launch and launch_ros give to pytest; the names of the entry points count.
ROS_PLUGINS = ('launch_testing', 'launch_ros', 'launch_pytest')


@pytest.mark.slow
@pytest.mark.parametrize('name', ROS_PLUGINS)
def test_a_plugin_of_ros_that_does_not_know_this_pytest_does_no_harm(tmp_path, name):
    tmp_path.joinpath('unfit_plugin.py').write_text('raise ImportError("of another pytest")')
    metadata = tmp_path / 'unfit-1.0.dist-info'
    metadata.mkdir()
    metadata.joinpath('METADATA').write_text('Metadata-Version: 2.1\nName: unfit\nVersion: 1.0\n')
    metadata.joinpath('entry_points.txt').write_text(f'[pytest11]\n{name} = unfit_plugin\n')
    paths = [str(tmp_path), str(ROOT), os.environ.get('PYTHONPATH', '')]
    result = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '--collect-only', '-p', 'no:cacheprovider',
         'test/test_text.py'],
        cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, paths))})
    assert result.returncode == 0, result.stdout + result.stderr
    assert 'test_text.py::' in result.stdout


@pytest.mark.parametrize('name, reason', [
    ('pytest', None), ('no_such_library', 'needs no_such_library'),
    ('kachaka_simple_control.no_such_module', 'needs kachaka_simple_control.no_such_module')])
def test_a_test_without_its_library_says_what_it_needs(name, reason):
    assert lack(name) == reason


@pytest.mark.slow
def test_a_test_with_a_missing_library_is_skipped_alone(tmp_path):
    tmp_path.joinpath('test_some.py').write_text("""
from optional_libraries import MISSING, optional_imports
import pytest
DISTANCES = MISSING
with optional_imports():
    from no_such_library import DISTANCES
@pytest.mark.needs('no_such_library')
@pytest.mark.parametrize('distance', [DISTANCES.near, DISTANCES.far(1.0)])
def test_it(distance):
    assert distance
def test_another():
    pass
""")
    result = subprocess.run(
        [sys.executable, '-m', 'pytest', '-rs', '-p', 'no:cacheprovider', '-p', 'conftest',
         '--rootdir', str(tmp_path), '-c', str(ROOT / 'pyproject.toml'), str(tmp_path)],
        cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(
            [str(TESTS), str(ROOT), os.environ.get('PYTHONPATH', '')])})
    assert '1 passed, 2 skipped' in result.stdout, result.stdout + result.stderr
    assert 'needs no_such_library' in result.stdout
