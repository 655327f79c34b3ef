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
"""The tables of docs/design.md name files, symbols, layers and libraries that are there."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
import re
import sys

import kachaka_simple_control
from program import ROOT
import pytest

#: Where it is imported from: colcon tests the package that it has installed.
PACKAGE = Path(kachaka_simple_control.__file__).parent
PAGE = ROOT / 'docs' / 'design.md'
pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason='the documentation is not here')

CODE = re.compile(r'`([^`]+)`')
#: What the last column of the layers calls the modules that a layer may import.
LIBRARIES = {
    'PyYAML': {'yaml'}, 'jsonschema': {'jsonschema'}, 'matplotlib': {'matplotlib'},
    'Jinja2': {'jinja2'}, 'mcap': {'mcap'}, 'rich': {'rich'}, 'rclpy': {'rclpy'},
    'argcomplete': {'argcomplete'}, 'tornado': {'tornado'},
    'std_srvs': {'std_srvs'}, 'kachaka-api': {'kachaka_api'}, 'grpc': {'grpc'},
    'messages': {'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'nav_msgs',
                 'rcl_interfaces', 'sensor_msgs', 'std_msgs', 'std_srvs'},
}


def tables(text: str) -> dict[str, list[dict[str, str]]]:
    """Return the rows of the tables of a page by their headings, each by its columns."""
    found: dict[str, list[dict[str, str]]] = {}
    heading, columns = '', None
    for line in text.splitlines():
        if line.startswith('#'):
            heading = line.lstrip('# ')
        if not line.startswith('|'):
            columns = None
        elif columns is None:
            columns = cells(line)
        elif not set(line) <= set('|-: '):
            found.setdefault(heading, []).append(dict(zip(columns, cells(line))))
    return found


def cells(line: str) -> list[str]:
    """Return the cells of a row."""
    return [cell.strip() for cell in line.strip('|').split('|')]


def file_named(name: str) -> Path:
    """Return a file by its path below the package or, where that has none, the repository."""
    return next((path for path in (PACKAGE / name, ROOT / name) if path.is_file()), ROOT / name)


def symbols(path: Path) -> set[str]:
    """Return what a file defines: names and members of classes; elsewhere its words."""
    text = path.read_text()
    if path.suffix != '.py':
        return set(re.findall(r'\w+', text))
    found: set[str] = set()
    for node in ast.parse(text).body:
        for name in defined(node):
            found.add(name)
        if isinstance(node, ast.ClassDef):
            found.update(f'{node.name}.{name}' for part in node.body for name in defined(part))
    return found


def defined(node: ast.stmt) -> Iterator[str]:
    """Return the names that a statement defines."""
    if isinstance(node, (ast.AsyncFunctionDef, ast.ClassDef, ast.FunctionDef)):
        yield node.name
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, 'target', None)]
    for target in targets:
        parts = target.elts if isinstance(target, ast.Tuple) else [target]
        yield from (part.id for part in parts if isinstance(part, ast.Name))


def problem(row: dict[str, str]) -> str | None:
    """Return what is wrong with a row that names a file and what is in it; None if nothing is."""
    files, names = CODE.findall(row['file']), CODE.findall(row['name'])
    if len(files) != 1 or not names:
        return f'a row names one file, and at least one thing in it: {row}'
    path = file_named(files[0])
    if not path.is_file():
        return f'there is no file {files[0]}'
    missing = set(names) - symbols(path)
    return f'{files[0]} does not define {", ".join(sorted(missing))}' if missing else None


TEXT = PAGE.read_text() if PAGE.is_file() else ''
TABLES = tables(TEXT)
ROWS = [pytest.param(row, id=f'{heading}: {next(iter(row.values()))}')
        for heading, rows in TABLES.items() for row in rows if 'file' in row]
LAYERS = TABLES.get('Layers', [])


@pytest.mark.parametrize('row', ROWS)
def test_a_row_names_a_file_and_what_it_defines(row):
    assert problem(row) is None


@pytest.mark.parametrize('file, name, wrong', [
    ('`control/stop.py`', '`stop_steps`', None),
    ('`control/stop.py`', '`StopController.stop`', None),
    ('`benchmarks/stop_matrix/rows.py`', '`ROWS`', None),
    ('`robots/turtlebot3.yaml`', '`command_timeout`', None),
    ('`control/stopping.py`', '`stop_steps`', 'no file control/stopping.py'),
    ('`control/stop.py`', '`stop_stepss`', 'does not define stop_stepss'),
    # Imported there, defined elsewhere.
    ('`control/stop.py`', '`VelocityGate`', 'does not define VelocityGate'),
    ('`control/stop.py`', '`StopController.stop_steps`', 'does not define'),
    ('`robots/turtlebot3.yaml`', '`command_timeouts`', 'does not define command_timeouts'),
    ('`control/stop.py`, `control/latch.py`', '`Latch`', 'one file'),
    ('`control/stop.py`', '', 'at least one thing'),
])
def test_a_wrong_row_is_found(file, name, wrong):
    found = problem({'file': file, 'name': name})
    assert found is None if wrong is None else wrong in found


def test_layers_are_those_of_the_import_contract():
    contract = re.search(r'^layers = (\[.*?^\])', (ROOT / 'pyproject.toml').read_text(),
                         re.DOTALL | re.MULTILINE)
    layers = [set(re.split(r' [:|] ', layer)) for layer in ast.literal_eval(contract[1])]
    assert [set(CODE.findall(row['layer'])) for row in LAYERS] == layers


@pytest.mark.parametrize('row', LAYERS, ids=lambda row: row['layer'])
def test_a_layer_imports_the_libraries_that_are_named(row):
    named = [name.strip() for name in row['libraries'].split(',') if name.strip()]
    allowed = set().union(*(LIBRARIES[name] for name in named))
    for layer in CODE.findall(row['layer']):
        folder = PACKAGE / layer
        for path in folder.rglob('*.py') if folder.is_dir() else [folder.with_suffix('.py')]:
            assert libraries(path) <= allowed, path.relative_to(PACKAGE)


def libraries(path: Path) -> set[str]:
    """Return what a module imports beside the standard library and this package."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            names.add(str(node.module).partition('.')[0])
    return names - sys.stdlib_module_names - {'kachaka_simple_control'}


@pytest.mark.parametrize('name', sorted(
    {name for name in CODE.findall(TEXT) if name.endswith('.py') and '/' in name}))
def test_each_file_in_the_text_is_there(name):
    assert file_named(name).is_file()


@pytest.mark.parametrize('path', sorted(
    path for path in PACKAGE.rglob('*.py') if not path.stem.startswith('__')),
    ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_has_a_test_file_of_its_name_or_says_which(path):
    tests = {file.name: file for file in (ROOT / 'test').rglob('test_*.py')}
    said = re.search(r'Tested by (\S+\.py)', ast.get_docstring(ast.parse(path.read_text())) or '')
    assert f'test_{path.name}' in tests if said is None else (ROOT / said[1]).is_file()
