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
"""Compare two runs; ``python -m benchmarks.compare BEFORE.json AFTER.json``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
import math
from pathlib import Path
from typing import Any

from benchmarks.figures import figures
from benchmarks.tables import NAMES, number, Table

#: The smallest relative change that is shown.
NOISE = 0.1


def compare(before: dict[str, Any], after: dict[str, Any]) -> Table:
    """Return a table that compares two runs, with a row for each figure of both runs."""
    others = {(figure.what, figure.loop): figure for figure in figures(after)}
    rows = []
    for one in figures(before):
        two = others.get((one.what, one.loop))
        if two is not None:
            rows.append((one.what, NAMES[one.loop], f'{number(one.value)} {one.unit}'.strip(),
                         f'{number(two.value)} {two.unit}'.strip(), change(one.value, two.value)))
    return Table('Two runs', ('figure', 'loop', 'before', 'after', 'change'), tuple(rows))


def change(before: float, after: float) -> str:
    """Return the change of a figure in percent; empty if it is small."""
    if before == after:
        return ''
    if before == 0.0 or math.isinf(before) or math.isinf(after):
        return 'changed'
    part = after / before - 1.0
    return '' if abs(part) < NOISE else f'{100.0 * part:+.0f} %'


def differences(before: dict[str, str], after: dict[str, str]) -> list[str]:
    """Return a line for each difference between the machine descriptions of two runs."""
    return [f'{name}: {before.get(name, "-")} -> {after.get(name, "-")}'
            for name in {**before, **after} if before.get(name) != after.get(name)]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the comparison of the two runs that the arguments name."""
    parser = argparse.ArgumentParser(
        prog='benchmarks.compare', description='Set two runs of the benchmarks side by side.')
    parser.add_argument('before', type=Path)
    parser.add_argument('after', type=Path)
    options = parser.parse_args(arguments)
    before, after = (json.loads(path.read_text()) for path in (options.before, options.after))
    print('\n'.join(differences(before['machine'], after['machine'])))
    print(compare(before, after).text())


if __name__ == '__main__':
    main()
