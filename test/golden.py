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
"""Compare a text with the one of ``test/golden/NAME.txt``; ``UPDATE_GOLDEN=1`` writes it anew."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import difflib
import os
from pathlib import Path
import textwrap

FOLDER = Path(__file__).parent / 'golden'
#: How much of a case is shown [characters].
MAX_SHOWN = 300


def compare(name: str, text: str) -> None:
    """Fail with the difference if a text is not the golden one of a name."""
    file = FOLDER / f'{name}.txt'
    if os.environ.get('UPDATE_GOLDEN'):
        file.write_text(text, encoding='utf-8')
    difference = '\n'.join(difflib.unified_diff(
        file.read_text(encoding='utf-8').splitlines(), text.splitlines(), str(file), 'now',
        lineterm=''))
    assert not difference, f'if it should be so: UPDATE_GOLDEN=1\n{difference}'


def answers(cases: Iterable[str], answer: Callable[[str], str]) -> str:
    """Return a text with the answer to each case, indented below it."""
    return ''.join(
        f'{case[:MAX_SHOWN]}\n{textwrap.indent(answer(case), " -> ")}\n\n' for case in cases)
