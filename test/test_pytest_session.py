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

import ast
from collections.abc import Iterator
import os
import subprocess
import sys

from optional_libraries import lack, MISSING, optional_imports
from program import ROOT
import pytest

TESTS = ROOT / 'test'
#: What Humble's launch and launch_ros give to pytest; the names of the entry points count.
ROS_PLUGINS = ('launch_testing', 'launch_ros', 'launch_pytest')


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


def executed_on_import(node: ast.AST) -> Iterator[ast.AST]:
    """Return what is executed when a module is imported: all but the bodies of functions."""
    for inner in ast.iter_child_nodes(node):
        if isinstance(inner, (ast.AsyncFunctionDef, ast.FunctionDef)):
            for decorator in inner.decorator_list:
                yield decorator
                yield from executed_on_import(decorator)
        elif not isinstance(inner, ast.Lambda):
            yield inner
            yield from executed_on_import(inner)


def skips_on_import(text: str) -> list[int]:
    """Return the lines of a module that skip it as a whole."""
    found = []
    for node in executed_on_import(ast.parse(text)):
        names = {getattr(node, 'attr', None), getattr(node, 'id', None)}
        is_skip = isinstance(node, ast.Call) and ast.unparse(node.func) in ('pytest.skip', 'skip')
        if is_skip or names & {'importorskip', 'SkipTest'}:
            found.append(node.lineno)
    return found


@pytest.mark.parametrize('path', sorted(TESTS.rglob('*.py')), ids=lambda path: path.stem)
def test_no_module_is_skipped_as_a_whole(path):
    """It would take the tests of others with it where a plug-in of ROS collects them."""
    assert skips_on_import(path.read_text()) == [], (
        'mark the tests instead: pytestmark = pytest.mark.needs(...), and let '
        'optional_libraries.optional_imports() guard the import')


@pytest.mark.parametrize('text, lines', [
    ("import pytest\npytest.importorskip('rclpy')", [2]),
    ("import pytest\nrclpy = pytest.importorskip('rclpy')", [2]),
    ("from pytest import importorskip\nif True:\n    importorskip('rclpy')", [3]),
    ("import pytest\npytest.skip('no', allow_module_level=True)", [2]),
    ("import unittest\nraise unittest.SkipTest('no')", [2]),
    ("@pytest.mark.skip(reason='no')\ndef test():\n    pytest.skip('no')", []),
    ("pytestmark = pytest.mark.skipif(True, reason='no')", []),
])
def test_skips_of_modules_are_found(text, lines):
    assert skips_on_import(text) == lines


@pytest.mark.parametrize('name, reason', [
    ('pytest', None), ('no_such_library', 'needs no_such_library'),
    ('kachaka_simple_control.no_such_module', 'needs kachaka_simple_control.no_such_module')])
def test_a_test_without_its_library_says_what_it_needs(name, reason):
    assert lack(name) == reason


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


def test_our_own_modules_are_not_optional():
    with pytest.raises(ModuleNotFoundError), optional_imports():
        import kachaka_simple_control.no_such_module  # noqa: F401
    with pytest.raises(ImportError), optional_imports():
        from optional_libraries import no_such_name  # noqa: F401
    with optional_imports():
        import no_such_library  # noqa: F401
    assert list(MISSING) == []
