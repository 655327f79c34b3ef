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
"""Code that tests and benchmarks run as scripts uses names of the package that exist."""

import ast
import contextlib
import functools
from pathlib import Path

import kachaka_simple_control
from program import ROOT
import pytest

PACKAGE = 'kachaka_simple_control'
#: Where it is imported from: colcon tests the package that it has installed.
SITE = Path(kachaka_simple_control.__file__).parent.parent
FILES = [file for folder in ('test', 'benchmarks') for file in (ROOT / folder).rglob('*.py')
         if file != Path(__file__)]

#: What stands for the parts of a string that are put in when it is used.
PLACEHOLDER = 'PLACEHOLDER'


def code_of(text):
    """Return all code in the strings of a file as one script, if it imports from the package."""
    strings = [''.join(part.value if isinstance(getattr(part, 'value', None), str)
                       else PLACEHOLDER for part in getattr(node, 'values', [node]))
               for node in ast.walk(ast.parse(text))
               if isinstance(node, ast.JoinedStr | ast.Constant)]
    body = []
    for code in strings if any(f'from {PACKAGE}' in string for string in strings) else ():
        with contextlib.suppress(SyntaxError, ValueError):  # text, or a part of a script
            body += ast.parse(code).body
    return ast.Module(body, [])


@functools.cache
def module(name):
    """Return a module, parsed; None if there is none of that name."""
    path = SITE.joinpath(*name.split('.'))
    file = next(filter(Path.exists, (path.with_suffix('.py'), path / '__init__.py')), None)
    return file and ast.parse(file.read_text())


@functools.cache
def bound(tree):
    """Return the names that a module or class has, and of a class its objects' attributes."""
    nodes = [*ast.walk(tree)]
    return {
        *(node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)),
        *(node.id for node in nodes
          if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)),
        *((node.asname or node.name).split('.')[0] for node in nodes
          if isinstance(node, ast.alias)),
        *(node.attr for node in nodes if isinstance(tree, ast.ClassDef)
          and isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store))}


def missing(script):
    """Return the names of the package that a script uses and the package does not have."""
    known, absent = {}, []
    for node in ast.walk(script):
        if isinstance(node, ast.ImportFrom) and f'{node.module}.'.startswith(f'{PACKAGE}.'):
            source = module(node.module)
            for name in [alias.name for alias in node.names if alias.name != '*' and source]:
                classes = [one for one in source.body
                           if isinstance(one, ast.ClassDef) and one.name == name]
                known[name] = module(f'{node.module}.{name}') or next(iter(classes), None)
                if known[name] is None and name not in bound(source) and node.module != PACKAGE:
                    absent.append(f'{node.module}.{name}')
            absent += [] if source else [node.module]
    for node in ast.walk(script):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            owner = known.get(node.value.id)
            inherits = isinstance(owner, ast.ClassDef) and owner.bases
            if owner is not None and not inherits and node.attr not in {
                    PLACEHOLDER, *bound(owner)}:
                absent.append(f'{node.value.id}.{node.attr}')
    return absent


@pytest.mark.filterwarnings('ignore:invalid escape sequence')
def test_scripts_use_names_that_exist():
    found = {file.relative_to(ROOT): missing(code_of(file.read_text())) for file in FILES}
    assert {file: names for file, names in found.items() if names} == {}


def test_a_name_that_is_gone_is_found():
    begin = ('from kachaka_simple_control.control import stop, gone\n'
             'from kachaka_simple_control.control.standstill import StandstillDetector, Gone\n')
    rest = 'stop.nothing = StandstillDetector.nothing = stop.StopController\n'
    assert missing(code_of(f'BEGIN = {begin!r}\nTEXT = {rest!r}')) == [
        'kachaka_simple_control.control.gone', 'kachaka_simple_control.control.standstill.Gone',
        'stop.nothing', 'StandstillDetector.nothing']
