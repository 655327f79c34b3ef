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
What ROS arguments and parameter files say that has no effect; ROS itself says nothing of it.

It needs no ROS.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from itertools import pairwise
from pathlib import Path
from typing import Any

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.text import escaped, quoted

KEY = 'ros__parameters'


def check_parameter_files(arguments: Sequence[str]) -> None:
    """
    Check that the parameter files of a command line have the form that ROS reads.

    :raises UsageError: if parameters stand outside of ``ros__parameters``
    """
    for path, contents in _files(arguments):
        for key in _outside(contents):
            raise UsageError(
                f'{path}: {quoted(key, 60)} stands outside of {KEY}: write, for example, '
                f'kachaka_simple_control: {{{KEY}: {{rate: 20.0}}}}')


def without_effect(arguments: Sequence[str], node: str) -> list[str]:
    """Return warnings about parameters on a command line that are for other nodes alone."""
    warnings = []
    for path, contents in _files(arguments):
        names = list(_nodes(contents))
        if names and not any(_is_for(name, node) for name in names):
            warnings.append(
                f'{path} has no parameters for this node, {node}: its entries are for '
                f'{escaped(", ".join(names), 100)}{_similar(node, names)}')
    for option, assignment in pairwise(arguments):
        name = assignment.partition(':=')[0]
        prefix = name.rpartition(':')[0]
        if option in ('-p', '--param') and prefix and not _is_for(prefix, node):
            warnings.append(
                f'-p {escaped(name, 60)} is for the node {escaped(prefix, 60)}, and this is '
                f'{node}: leave out {escaped(prefix, 60)}:')
    return warnings


def _files(arguments: Sequence[str]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield name and contents of each parameter file; ROS itself refuses what is no such file."""
    import yaml  # not needed otherwise, and slow to import
    for option, path in pairwise(arguments):
        if option == '--params-file':
            try:
                contents = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
            except (OSError, ValueError, yaml.YAMLError):
                continue
            if isinstance(contents, Mapping):
                yield escaped(path, 100), contents


def _outside(contents: Mapping[str, Any]) -> Iterator[str]:
    for key, value in contents.items():
        if not isinstance(value, Mapping):
            yield str(key)
        elif key != KEY:
            yield from _outside(value)


def _nodes(contents: Mapping[str, Any], prefix: str = '') -> Iterator[str]:
    for key, value in contents.items():
        if key == KEY:
            yield prefix
        elif isinstance(value, Mapping):
            yield from _nodes(value, f'{prefix.rstrip("/")}/{str(key).strip("/")}')


def _is_for(pattern: str, node: str) -> bool:
    # Wildcards are read generously: no warning is better than a wrong one.
    return fnmatchcase(node, f'/{pattern.strip("/")}') or fnmatchcase(
        node.rpartition('/')[2], pattern.rpartition('/')[2])


def _similar(node: str, names: Sequence[str]) -> str:
    return f'; did you mean {node}?' if get_close_matches(node, names, 1, 0.7) else ''
