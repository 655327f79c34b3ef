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
"""The commands of the documentation work, and print what it quotes."""

from __future__ import annotations

import ast
import fcntl
from pathlib import Path
import shutil
import textwrap

from doc_blocks import (
    Block,
    blocks,
    COMMANDS,
    DOCUMENTS,
    LIBRARIES,
    needed,
    NOT_RUN,
)
from doc_output import compare
from doc_runner import Reader, searched
from program import ROOT
import pytest

ALL = [block for path in DOCUMENTS for block in blocks(path)]

# There are as many groups as `make docs` has processes: in more, a long page could begin last.
pytestmark = pytest.mark.xdist_group('others')
needs_source = pytest.mark.skipif(
    not (ROOT / '.ci').is_dir(), reason='the whole source is not here')


@pytest.mark.parametrize('block', [b for b in ALL if b.language in COMMANDS], ids=str)
def test_every_block_of_commands_has_a_mark(block):
    assert block.mark, (
        f'{block}: say above this block whether its commands are tested: <!-- test: run -->, or '
        '<!-- test: not run: WHY -->; doc_blocks.py lists all marks')
    assert block.is_run or NOT_RUN.fullmatch(block.mark), (
        f'{block}: {block.mark!r} is no mark; doc_blocks.py lists them at its top')


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_page_needs_only_libraries_that_are_known(path):
    assert set(needed(path)) <= LIBRARIES


@pytest.mark.parametrize('block', [b for b in ALL if b.language == 'python'], ids=str)
def test_python_compiles(block):
    ast.parse(textwrap.dedent(block.text), filename=str(block))


@pytest.mark.parametrize(
    'block', [b for b in ALL if b.file and '\ndef main(' in b.text], ids=str)
def test_a_whole_program_also_runs_without_an_entry_point(block):
    assert "\nif __name__ == '__main__':\n    main()" in block.text


@needs_source
@pytest.mark.parametrize('block', [b for b in ALL if b.is_run], ids=str)
def test_every_make_target_is_run_by_ci_too(block):
    lines = ROOT.joinpath('.ci', 'run').read_text().splitlines()
    for line in block.text.splitlines():
        assert not line.startswith('make ') or line in lines, (
            f'{block}: .ci/run has no line {line!r}, so no check would fail if it broke')


@pytest.mark.parametrize('quoted, printed, same', [
    (['a', 'b'], ['a', 'b'], True),
    (['a'], ['a', 'b'], False),
    (['a', '...'], ['a', 'b'], True),
    (['...', 'c'], ['a', 'b', 'c'], True),
    (['a ... c'], ['a b c'], True),
    (['x 0.1000 m'], ['x 0.1004  m'], True),
    (['x 0.1000 m'], ['x 0.1200 m'], False),
    (['1.0000 rad, 0.00 degrees after 0.00 s'], ['1.0200 rad, 1.40 degrees after 0.25 s'], True),
    (['1.0000 rad'], ['1.0300 rad'], False),
    (['0.00 degrees'], ['1.60 degrees'], False),
    (['0.1000 m/s'], ['0.1100 m/s'], False),
    (['after 0.00 s'], ['after 0.40 s'], False),
    (['Time=1.0 s'], ['Time=1.1 s'], False),
    (['[INFO] [a]: one'], ['[INFO] [12.5] [a]: one', '[INFO] [12.6] [b]: two', 'three'], True),
    (['[INFO] [a]: one'], ['[INFO] [12.5] [a]: one', '[INFO] [12.6] [a]: two'], False),
])
def test_quotes_are_compared_approximately_and_with_wildcards(quoted, printed, same):
    assert (compare(quoted, printed) is None) == same


#: The pages that take longest, by which process of ``make docs`` runs them, one after the other.
GROUPS = (('floor', 'fleet'), ('tape_measure', 'calibration'), ('README', 'report'))


def documents_to_run() -> list[object]:
    """Return the documents to run, each with whether to run what needs colcon."""
    found: list[object] = []
    for path in DOCUMENTS:
        run = [block for block in blocks(path) if block.is_run or (
            block.language == 'python' and block.mark == 'run')]
        name = str(path.relative_to(ROOT))
        group = next((group for group in GROUPS if path.stem in group), ('others',))
        marks = [pytest.mark.needs(*needed(path)), pytest.mark.xdist_group(group[0])]
        if any(block.is_run and block.run['colcon'] for block in run):
            found.append(pytest.param(path, True, id=f'{name} with colcon', marks=marks))
        if run:
            found.append(pytest.param(path, False, id=name, marks=marks))
    return found


@needs_source
@pytest.mark.ros
@pytest.mark.document
@pytest.mark.parametrize('path, colcon', documents_to_run())
def test_commands_of_a_document_work(path, colcon, tmp_path):
    pytest.importorskip('nav_msgs', reason='needs ROS 2')
    uses_colcon = any(block.is_run and block.run['colcon'] for block in blocks(path))
    has_colcon = shutil.which('colcon', path=searched()) is not None
    if colcon != (uses_colcon and has_colcon):
        pytest.skip('with colcon, as in make docs, all of it is run')
    with Path(__file__).open() as lock:
        if '--grpc-port' in path.read_text():  # two pages start the robot's service at its port
            fcntl.flock(lock, fcntl.LOCK_EX)
        reader = Reader(tmp_path)
        try:
            run_document(path, reader, colcon)
        finally:
            reader.close_terminals()


def run_document(path: Path, reader: Reader, colcon: bool) -> None:
    """Do what a document says."""
    was_run = False
    for block in blocks(path):
        if block.language in COMMANDS:
            real = block.mark.startswith('needs ros2:') and shutil.which('ros2') is not None
            was_run = block.is_run and (colcon or not block.run['colcon'])
            if was_run:
                reader.do(block)
            elif real:
                reader.do(Block(block.path, block.line, block.language, 'run', block.text))
        elif block.file is not None:
            reader.type_file(block)
        elif block.is_output and was_run:
            reader.read_output(block)
        elif block.language == 'python' and block.mark == 'run':
            reader.run_python(block)
    for block in blocks(path):
        if block.mark == 'fragment' and (colcon or not needs_edit(block)):
            assert reader.has_file_with(block.text), f'{block}: no file of the reader has this'


def needs_edit(block: Block) -> bool:
    """Return whether a fragment gets into its file by commands that are run with colcon."""
    texts = [other.text for other in blocks(block.path) if other.file]
    return not any(block.text.strip() in text for text in texts)
