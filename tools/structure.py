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
"""
Print metrics of the package's structure: ``structure.py [CHECKOUT]``; default: this checkout.

A *module* is a Python file with more than a docstring.  *Code lines* are the lines of all Python
files without blank lines, comments and docstrings; *docstring lines* are not blank either.  A
*room* is a folder of the package with the modules directly in it; in the package's top folder,
each module is a room, and so is its ``__init__``.  An *arrow* is an import from one room by
another room; imports in functions and under ``TYPE_CHECKING`` count.  *Floors* is the number of
rooms in the longest chain of arrows, where rooms with cyclic imports count as one room.
"""

from __future__ import annotations

import ast
from collections.abc import Container, Iterator
import io
from pathlib import Path
import sys
import tokenize

PACKAGE = 'kachaka_simple_control'
NO_CODE = (
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
    tokenize.ENDMARKER)


def main() -> None:
    """Print the metrics of a checkout."""
    checkout = Path(*sys.argv[1:2]) if sys.argv[1:] else Path(__file__).resolve().parent.parent
    for name, figure in structure(checkout / PACKAGE).items():
        print(f'{name:15} {figure:6}')


def structure(package: Path) -> dict[str, int]:
    """
    Return the metrics of a package by name.

    :param package: the folder of the package, with the name of the package
    """
    texts = {path: path.read_text('utf-8') for path in package.rglob('*.py')}
    trees = {_name(package, path): ast.parse(text) for path, text in texts.items()}
    packages = {_name(package, path) for path in texts if path.stem == '__init__'}
    modules = [name for name, tree in trees.items() if _has_code(tree)]
    rooms = {_room(name, packages) for name in modules}
    arrows = {
        (_room(name, packages), _room(imported, packages))
        for name, tree in trees.items() for imported in _imports(tree, trees)}
    arrows = {(one, other) for one, other in arrows if one != other and {one, other} <= rooms}
    return {
        'rooms': len(rooms), 'arrows': len(arrows), 'floors': _floors(rooms, arrows),
        'modules': len(modules), 'code lines': sum(map(_code_lines, texts.values())),
        'docstring lines': sum(map(_docstring_size, texts.values()))}


def _name(package: Path, path: Path) -> str:
    return '.'.join(path.relative_to(package.parent).with_suffix('').parts).removesuffix(
        '.__init__')


def _has_code(tree: ast.Module) -> bool:
    return len(tree.body) > (ast.get_docstring(tree) is not None)


def _room(name: str, packages: set[str]) -> str:
    """Return the room of a module: the module itself, or its folder."""
    folder = name.rpartition('.')[0]
    return name if name in packages or '.' not in folder else folder


def _imports(tree: ast.Module, known: Container[str]) -> Iterator[str]:
    """Yield the modules of the package that a module imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, 'the package has absolute imports alone'
            names = [f'{node.module}.{alias.name}' for alias in node.names]
        else:
            continue
        for name in names:
            found = name if name in known else name.rpartition('.')[0]
            if found in known:
                yield found


def _floors(rooms: set[str], arrows: set[tuple[str, str]]) -> int:
    """Return the number of rooms in the longest chain of arrows; a cycle counts as one room."""
    below = {room: {other for one, other in arrows if one == room} for room in rooms}
    for _ in rooms:  # the longest chain has fewer arrows than there are rooms
        below = {room: found.union(*(below[other] for other in found))
                 for room, found in below.items()}
    heights: dict[str, int] = {}
    # A room that reaches more rooms is higher; rooms of one cycle reach the same rooms.
    for room in sorted(rooms, key=lambda room: len(below[room] - {room})):
        heights[room] = 1 + max((
            heights[other] for other in below[room] if room not in below[other]), default=0)
    return max(heights.values(), default=0)


def _code_lines(text: str) -> int:
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - _docstring_lines(text))


def _docstring_lines(text: str) -> set[int]:
    """Return the numbers of the lines of all docstrings."""
    numbers: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) \
                and ast.get_docstring(node, clean=False) is not None:
            docstring = node.body[0]
            numbers.update(range(docstring.lineno, (docstring.end_lineno or 0) + 1))
    return numbers


def _docstring_size(text: str) -> int:
    lines = text.splitlines()
    return sum(bool(lines[number - 1].strip()) for number in _docstring_lines(text))


if __name__ == '__main__':
    main()
