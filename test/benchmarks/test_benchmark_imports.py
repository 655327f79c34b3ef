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
"""No two modules of the benchmarks import each other, not even within a function."""

import ast
from graphlib import CycleError, TopologicalSorter  # noqa: I201

from program import ROOT
import pytest


def imports(files):
    """Return the modules that each module imports; files by the name of the module."""
    found = {}
    for name, file in files.items():
        nodes = [*ast.walk(ast.parse(file.read_text()))]
        named = [alias.name for node in nodes if isinstance(node, ast.Import)
                 for alias in node.names]
        for node in nodes:
            if isinstance(node, ast.ImportFrom):
                named += [node.module, *(f'{node.module}.{alias.name}' for alias in node.names)]
        found[name] = {one for one in named if one in files and one != name}
    return found


def test_no_import_is_circular():
    files = {
        '.'.join(file.relative_to(ROOT).with_suffix('').parts): file
        for file in (ROOT / 'benchmarks').rglob('*.py')}
    graph = imports(files)
    assert 'benchmarks.stop_matrix.trial_setup' in graph['benchmarks.stop_matrix.rows']
    assert [*TopologicalSorter(graph).static_order()]


def test_a_circular_import_within_a_function_is_found(tmp_path):
    one, two = tmp_path / 'one.py', tmp_path / 'two.py'
    one.write_text('import two')
    two.write_text('def late():\n    from one import something')
    with pytest.raises(CycleError):
        TopologicalSorter(imports({'one': one, 'two': two})).prepare()
