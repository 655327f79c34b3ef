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
"""Compare what a document quotes with what a program printed."""

from __future__ import annotations

import re

import pytest

NUMBER = re.compile(r'(-?\d+\.\d{2,})')
#: How far a loaded machine that is 50 ms late drives at the speeds of the documents, by its unit.
LATE = {' m': 0.015, ' rad': 0.025, ' deg': 1.5}
LOG = re.compile(r'\[(?:DEBUG|INFO|WARN|ERROR|FATAL)\] (?:\[[\d.]+\] )?(\[[\w.]+\])')


def compare(quoted: list[str], printed: list[str]) -> str | None:
    """Return how quoted lines differ from printed ones; None if they do not."""
    names = {match[1] for line in quoted if (match := LOG.match(line))}
    has_others = any(not LOG.match(line) for line in quoted if line != '...')
    rest = [line for line in printed if (
        match[1] in names if (match := LOG.match(line)) else has_others and line.strip())]
    anything = False
    for line in filter(str.strip, quoted):
        if line == '...':
            anything = True
            continue
        while rest and anything and not agree(line, rest[0]):
            rest.pop(0)
        if not rest or not agree(line, rest[0]):
            return f'expected {line!r}, got {rest[0] if rest else "the end"!r}'
        rest.pop(0)
        anything = False
    return None if anything or not rest else f'{rest[0]!r} is not quoted'


def agree(quoted: str, printed: str) -> bool:
    """Return whether a quoted line matches a printed one, figures approximately."""
    quoted, printed = (
        ' '.join(re.sub(r'^(\[\w+\]) \[[\d.]+\] ', r'\1 ', line).split())
        for line in (quoted, printed))
    pattern = NUMBER.sub('\0', quoted)
    pattern = re.escape(pattern).replace('\0', NUMBER.pattern).replace(r'\.\.\.', '.*')
    match = re.fullmatch(pattern, printed)
    figures = zip(NUMBER.finditer(quoted), match.groups()) if match else []
    return match is not None and all(
        float(one[0]) == pytest.approx(float(two), abs=tolerance(one[0], quoted[one.end():]))
        for one, two in figures)


def tolerance(figure: str, after: str) -> float:
    """Return how far a printed figure may be from a quoted one, in the unit after it."""
    unit = re.match(r' (?:m|rad|deg)(?=rees|[^\w/]|$)', after)
    return max(30.0 * 10.0 ** -len(figure.partition('.')[2]), LATE[unit[0]] if unit else 0.0)
