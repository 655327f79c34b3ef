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
The blocks of the documentation, and the hidden comments that mark them.

In Markdown, a hidden comment directly before a fenced block says what the block is::

    <!-- test: MARK -->

Marks of blocks of commands (``console``):

``run``
    The commands are run by bash in a scratch home; directory and environment last until the end
    of the document.  A line ``make TARGET`` must be one that ``.ci/run`` has too, which runs it;
    of a target that ends with one of our programs, the program is run here.  More words may
    follow, in this order: ``in FOLDER`` (``$SOURCE`` is a copy of this repository);
    ``with colcon`` (skipped without colcon: ``make docs`` has it); ``with exit code N``;
    ``in another terminal until: TEXT`` (started there; the next block runs once it has printed the
    text); ``, after the other terminals are closed``; ``, instead of cloning: COMMAND``.
``needs ros2: WHY``
    Run where there is the real command ``ros2``, which PyPI does not have.  Without it, a stand-in
    starts what ``ros2 run`` would start; it is all that ``run`` blocks may use.
``needs WHAT``, ``not run: WHY``
    Not run.

Marks of other blocks:

``file PATH``
    The reader types this file.
``fragment``
    A part of a file that the reader has by the end of the document.
``output``
    What the run block before it printed: each line of it, in order, without log lines of nodes
    that the block does not name, and without other lines if it has none.  A line ``...`` stands
    for any lines, and ``...`` within one for anything.  Times are ignored; figures with two digits
    after the point or more may differ a little.  A block with ``[INFO]`` in it needs no mark.
``run`` (Python)
    Run with a simulated robot of its own.

Every block of commands must have a mark, and every block of Python must compile.

A page that needs more than ROS and this package says so, and is skipped without::

    <!-- test: this page needs MODULE, MODULE -->
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
import re

from program import ROOT

DOCUMENTS = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted(ROOT.glob('docs/**/*.md'))]
DOCUMENTS = [path for path in DOCUMENTS if path.is_file() and '_build' not in path.parts]
COMMANDS = ('bash', 'console', 'sh', 'shell')
MARK = re.compile(r'<!-- test: (.+?) -->')
PAGE_NEEDS = re.compile(r'<!-- test: this page needs (.+?) -->')
#: What a page may need; a name that nobody knows would skip it everywhere.
LIBRARIES = {'jsonschema', 'kachaka_api', 'matplotlib', 'mcap', 'mcap_ros2', 'rosbags'}
RUN = re.compile(
    r'run'
    r'(?: in (?P<folder>(?!another terminal)[^ ,]+))?'
    r'(?P<colcon> with colcon)?'
    r'(?: with exit code (?P<code>\d+))?'
    r'(?: in another terminal until: (?P<until>.+?))?'
    r'(?P<close>, after the other terminals are closed)?'
    r'(?:, instead of cloning: (?P<instead>.+))?')
#: A placeholder: a line that is an upper-case word, or has a word such as TODO.
PLACEHOLDER = re.compile(r'\s*[A-Z][A-Z0-9_]+\s*|.*\b(TODO|TBD|FIXME|XXX)\b.*')
NOT_RUN = re.compile(r'(needs|not run:) .+')


@dataclass(frozen=True)
class Block:
    """A fenced block of a document."""

    path: Path
    line: int
    language: str
    mark: str
    text: str

    def __str__(self) -> str:
        """Return where it is."""
        return f'{self.path.relative_to(ROOT)}:{self.line}'

    @property
    def is_run(self) -> bool:
        """Return whether it has commands that are run."""
        return self.language in COMMANDS and RUN.fullmatch(self.mark) is not None

    @property
    def is_output(self) -> bool:
        """Return whether it quotes the output of a program."""
        return self.mark == 'output' or (self.language == 'text' and '[INFO]' in self.text)

    @property
    def run(self) -> re.Match[str]:
        """Return how to run it, by its mark."""
        match = RUN.fullmatch(self.mark)
        assert match is not None
        return match

    @property
    def file(self) -> str | None:
        """Return the name of the file that a reader makes of it."""
        return self.mark.removeprefix('file ') if self.mark.startswith('file ') else None


def blocks(path: Path) -> list[Block]:
    """Return the fenced blocks of a document."""
    found: list[Block] = []
    mark, language, begin = '', None, 0
    inside: list[str] = []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if language is not None:
            if line.strip() == '```':
                found.append(Block(path, begin, language, mark, '\n'.join(inside) + '\n'))
                mark, language, inside = '', None, []
            else:
                inside.append(line)
        elif line.startswith('```'):
            language, begin = line[3:].strip(), number
        elif line.strip():
            match = MARK.fullmatch(line.strip())
            mark = match.group(1) if match else ''
    return found


def needed(path: Path) -> list[str]:
    """Return the modules that a document says it needs."""
    return [name for names in PAGE_NEEDS.findall(path.read_text()) for name in names.split(', ')]


def placeholders(text: str) -> list[int]:
    """Return the numbers of the lines, outside of blocks, that are placeholders."""
    found: list[int] = []
    inside = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith('```'):
            inside = not inside
        elif not inside and PLACEHOLDER.fullmatch(line):
            found.append(number)
    return found
