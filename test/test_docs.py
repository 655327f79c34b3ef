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
What the documentation tells a reader to do works, and what it quotes is what appears.

In Markdown, a hidden comment directly before a fenced block says what the block is::

    <!-- test: MARK -->

Marks of blocks of commands (``console``):

``run``
    The commands are run, by bash, in a scratch home; folder and environment last until the end of
    the document.  A line ``make TARGET`` must be one that ``.ci/run`` has too; it is left to that,
    unless it ends with one of our programs: then the program is run.  More words may follow, in
    this order: ``in FOLDER`` (``$SOURCE`` is a copy of this repository); ``with colcon`` (left out
    where there is none: ``make docs`` has it); ``with exit code N``;
    ``in another terminal until: TEXT`` (started there, and going on, once it has printed the
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
    What the run block before it printed: each line of it, in order, leaving out log lines of nodes
    that the block does not name, and other lines if it has none.  A line ``...`` stands for any
    lines, and ``...`` within one for anything.  Times are left out; figures with two digits after
    the point or more may differ a little.  A block with ``[INFO]`` in it needs no mark.
``run`` (Python)
    Run with a simulated robot of its own.

Every block of commands must have a mark, and every block of Python must compile.
"""

from __future__ import annotations

import ast
import contextlib
from dataclasses import dataclass
import os
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
import sys
import textwrap
import time

from program import ROOT
from program import script as user_script
import pytest

DOCUMENTS = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted(ROOT.glob('docs/**/*.md'))]
DOCUMENTS = [path for path in DOCUMENTS if path.is_file() and '_build' not in path.parts]
EXAMPLES = sorted(ROOT.glob('examples/*.py'))
COMMANDS = ('bash', 'console', 'sh', 'shell')
PROGRAMS = {
    'kachaka_simple_control': 'kachaka_simple_control',
    'kachaka_bridge': 'kachaka_simple_control.robot.bridge',
    'kachaka_sim': 'kachaka_simple_control.robot.sim_command',
}
MARK = re.compile(r'<!-- test: (.+?) -->')
RUN = re.compile(
    r'run'
    r'(?: in (?P<folder>(?!another terminal)[^ ,]+))?'
    r'(?P<colcon> with colcon)?'
    r'(?: with exit code (?P<code>\d+))?'
    r'(?: in another terminal until: (?P<until>.+?))?'
    r'(?P<close>, after the other terminals are closed)?'
    r'(?:, instead of cloning: (?P<instead>.+))?')
NOT_RUN = re.compile(r'(needs|not run:) .+')
PATIENCE = 300.0

needs_source = pytest.mark.skipif(
    not (ROOT / '.ci').is_dir(), reason='the whole source is not here')


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
        """Tell whether it holds commands that are run."""
        return self.language in COMMANDS and RUN.fullmatch(self.mark) is not None

    @property
    def is_output(self) -> bool:
        """Tell whether it quotes what a program prints."""
        return self.mark == 'output' or (self.language == 'text' and '[INFO]' in self.text)

    @property
    def run(self) -> re.Match[str]:
        """Return what its mark says of how to run it."""
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


ALL = [block for path in DOCUMENTS for block in blocks(path)]


@pytest.mark.parametrize('block', [b for b in ALL if b.language in COMMANDS], ids=str)
def test_every_block_of_commands_has_a_mark(block):
    assert block.mark, (
        f'{block}: say above this block whether its commands are tested: <!-- test: run -->, or '
        '<!-- test: not run: WHY -->; test_docs.py lists all marks')
    assert block.is_run or NOT_RUN.fullmatch(block.mark), (
        f'{block}: {block.mark!r} is no mark; test_docs.py lists them at its top')


@pytest.mark.parametrize('block', [b for b in ALL if b.language not in COMMANDS], ids=str)
def test_other_marks_are_known(block):
    known = ('', 'fragment', 'output', *(['run'] if block.language == 'python' else []))
    assert block.mark in known or block.file, (
        f'{block}: {block.mark!r} is no mark; test_docs.py lists them at its top')


@pytest.mark.parametrize('block', [b for b in ALL if b.language == 'python'], ids=str)
def test_python_compiles(block):
    ast.parse(textwrap.dedent(block.text), filename=str(block))


@needs_source
@pytest.mark.parametrize('block', [b for b in ALL if b.is_run], ids=str)
def test_every_make_is_one_that_ci_makes_too(block):
    lines = ROOT.joinpath('.ci', 'run').read_text().splitlines()
    for line in block.text.splitlines():
        assert not line.startswith('make ') or line in lines, (
            f'{block}: .ci/run has no line {line!r}, so nobody would notice if it broke')


def test_every_example_is_shown():
    shown = ROOT.joinpath('docs', 'examples.md')
    assert not EXAMPLES or all(f'../examples/{path.name}' in shown.read_text()
                               for path in EXAMPLES)


# What follows plays the reader.

MAKE = """#!/bin/bash
set -e
recipe=$({make} --silent --dry-run --no-print-directory -C {root} "$@")
last=${{recipe##*$'\\n'}}
case "$last" in
    */bin/kachaka_*) set -- ${{last##*/bin/}}; exec "$@" ;;
    *) echo "make $*: left to .ci/run" ;;
esac
"""
ROS2 = """#!/bin/bash
# ros2 run PACKAGE PROGRAM ARGUMENTS..., as far as it goes without the ros2 command
[ "$1" = run ] || { echo 'here, ros2 can only run programs' >&2; exit 2; }
for prefix in ${AMENT_PREFIX_PATH//:/ }; do
    program=$prefix/lib/$2/$3
    if [ -x "$program" ]; then exec "$program" "${@:4}"; fi
done
echo "Package '$2' not found" >&2
exit 1
"""


class Terminal:
    """A shell that a reader has opened, and what it shows."""

    def __init__(self, command: str, reader: Reader, number: int) -> None:
        """Start a command in it."""
        self._log = reader.scratch / f'terminal-{number}.txt'
        with self._log.open('w') as out:
            self._process = subprocess.Popen(
                ['bash', '-c', command], cwd=reader.home, env=reader.environment,
                stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT,
                start_new_session=True)

    @property
    def text(self) -> str:
        """Return what it shows."""
        return self._log.read_text()

    def wait_for(self, text: str) -> None:
        """Return when it shows a text."""
        end = time.monotonic() + 30.0
        while text not in self.text:
            assert time.monotonic() < end, f'{text!r} never came, but:\n{self.text}'
            assert self._process.poll() is None, f'{text!r} never came, but:\n{self.text}'
            time.sleep(0.05)

    def wait(self) -> int:
        """Return the exit code of what runs in it."""
        return self._process.wait(PATIENCE)

    def close(self) -> None:
        """Press Ctrl+C, and close it."""
        for signum in (signal.SIGINT, signal.SIGKILL):
            with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
                os.killpg(self._process.pid, signum)
                self._process.wait(10.0)


class Reader:
    """Somebody who does what a document says, line by line."""

    def __init__(self, scratch: Path) -> None:
        """Sit down at a machine with nothing but this repository's source."""
        self.scratch = scratch
        self.home, self.source = scratch / 'home', scratch / 'source'
        self._state = scratch / 'state'
        self._terminals: list[Terminal] = []
        self._count = 0
        self.output = ''
        self.home.mkdir()
        copy_source(self.source)
        tools = self._make_tools()
        path = os.pathsep.join([str(tools), str(Path(sys.prefix) / 'bin'), os.environ['PATH']])
        self.environment = {
            **os.environ, 'HOME': str(self.home), 'SOURCE': str(self.source), 'PATH': path,
            'PYTHONPATH': str(self.source), 'COLCON_HOME': str(scratch / 'colcon')}

    def _make_tools(self) -> Path:
        tools = self.scratch / 'bin'
        tools.mkdir()
        programs = {name: f'#!/bin/bash\nexec {sys.executable} -m {module} "$@"\n'
                    for name, module in PROGRAMS.items()}
        programs['make'] = MAKE.format(make=shutil.which('make'), root=shlex.quote(str(ROOT)))
        if shutil.which('ros2') is None:
            programs['ros2'] = ROS2
        for name, text in programs.items():
            tools.joinpath(name).write_text(text)
            tools.joinpath(name).chmod(0o755)
        # What `make` would have made.
        environment = self.source / '.venv'
        if sys.prefix != sys.base_prefix:
            environment.symlink_to(sys.prefix)
        else:
            environment.joinpath('bin').mkdir(parents=True)
            environment.joinpath('bin', 'activate').touch()
        return tools

    def do(self, block: Block) -> None:
        """Run the commands of a block, and look at how they end."""
        run = block.run
        if run['close']:
            self.close_terminals()
        text = (run['instead'] + '\n') if run['instead'] else block.text
        folder = f'cd "{run["folder"]}"\n' if run['folder'] else ''
        if run['until']:
            # Another terminal knows nothing of what was sourced here.
            terminal = self._open(folder + text)
            terminal.wait_for(run['until'])
            self.output = terminal.text
            return
        state = shlex.quote(str(self._state))
        terminal = self._open(
            f'if [ -e {state} ]; then source {state}; fi\nset -e\n{folder}{text}set +e\n'
            f'{{ export -p; printf "cd %q\\n" "$PWD"; }} >{state}\n')
        code = terminal.wait()
        self.output = terminal.text
        assert code == int(run['code'] or 0), (
            f'{block}: these commands ended with exit code {code}:\n{text}\n{self.output}')

    def type_file(self, block: Block) -> None:
        """Write down a file."""
        assert block.file is not None
        state = self._state.read_text() if self._state.exists() else ''
        folder = re.findall(r'^cd (.+)$', state, re.MULTILINE)
        path = Path(*shlex.split(folder[-1]) if folder else [self.home]) / block.file.replace(
            '~', str(self.home))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.text)

    def run_python(self, block: Block) -> None:
        """Run a block of Python with a simulated robot."""
        robot = self._open('kachaka_bridge --sim')
        robot.wait_for('ready: ')
        script = self.scratch / 'script.py'
        script.write_text(block.text)
        program = self._open(f'python3 {script}')
        code = program.wait()
        assert code == 0, f'{block}: ended with exit code {code}:\n{program.text}'
        assert 'Movement completed' in program.text, f'{block}: nothing moved:\n{program.text}'
        robot.close()

    def read_output(self, block: Block) -> None:
        """Compare what a block quotes with what has just been printed."""
        difference = compare(block.text.splitlines(), self.output.splitlines())
        assert difference is None, f'{block}: {difference}; it printed:\n{self.output}'

    def has_file_with(self, fragment: str) -> bool:
        """Tell whether a part of a file is in one of the files in the home."""
        wanted = re.sub(r'\s+', ' ', fragment.strip())
        files = [path for path in self.home.rglob('src/*/**/*') if path.is_file()
                 and path.suffix in ('.cfg', '.py', '.xml')]
        return any(wanted in re.sub(r'\s+', ' ', path.read_text()) for path in files)

    def close_terminals(self) -> None:
        """Press Ctrl+C in every terminal."""
        for terminal in self._terminals:
            terminal.close()
        self._terminals.clear()

    def _open(self, command: str) -> Terminal:
        self._count += 1
        self._terminals.append(Terminal(command, self, self._count))
        return self._terminals[-1]


def copy_source(folder: Path) -> None:
    """Copy what git knows or would know of this repository."""
    listing = subprocess.run(
        ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
        cwd=ROOT, capture_output=True, text=True, check=True)
    for name in filter(None, listing.stdout.split('\0')):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)


NUMBER = re.compile(r'(-?\d+\.\d{2,})')
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
            return f'{line!r} was to come, and not {rest[0] if rest else "the end"!r}'
        rest.pop(0)
        anything = False
    return None if anything or not rest else f'{rest[0]!r} is not quoted'


def agree(quoted: str, printed: str) -> bool:
    """Tell whether a quoted line is like a printed one, figures nearly so."""
    quoted, printed = (
        ' '.join(re.sub(r'^(\[\w+\]) \[[\d.]+\] ', r'\1 ', line).split())
        for line in (quoted, printed))
    pattern = NUMBER.sub('\0', quoted)
    pattern = re.escape(pattern).replace('\0', NUMBER.pattern).replace(r'\.\.\.', '.*')
    match = re.fullmatch(pattern, printed)
    figures = zip(NUMBER.findall(quoted), match.groups()) if match else []
    return match is not None and all(
        float(one) == pytest.approx(float(two), abs=30.0 * 10.0 ** -len(one.partition('.')[2]))
        for one, two in figures)


@pytest.mark.parametrize('quoted, printed, same', [
    (['a', 'b'], ['a', 'b'], True),
    (['a'], ['a', 'b'], False),
    (['a', '...'], ['a', 'b'], True),
    (['...', 'c'], ['a', 'b', 'c'], True),
    (['a ... c'], ['a b c'], True),
    (['x 0.1000 m'], ['x 0.1004  m'], True),
    (['x 0.1000 m'], ['x 0.1100 m'], False),
    (['Time=1.0 s'], ['Time=1.1 s'], False),
    (['[INFO] [a]: one'], ['[INFO] [12.5] [a]: one', '[INFO] [12.6] [b]: two', 'three'], True),
    (['[INFO] [a]: one'], ['[INFO] [12.5] [a]: one', '[INFO] [12.6] [a]: two'], False),
])
def test_quotes_are_compared_as_said_above(quoted, printed, same):
    assert (compare(quoted, printed) is None) == same


def plays() -> list[object]:
    """Return the documents to play, each with whether to do what needs colcon."""
    found: list[object] = []
    for path in DOCUMENTS:
        run = [block for block in blocks(path) if block.is_run or (
            block.language == 'python' and block.mark == 'run')]
        name = str(path.relative_to(ROOT))
        if any(block.is_run and block.run['colcon'] for block in run):
            found.append(pytest.param(path, True, id=f'{name} with colcon'))
        if run:
            found.append(pytest.param(path, False, id=name))
    return found


@needs_source
@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.parametrize('path, colcon', plays())
def test_what_it_says_works(path, colcon, tmp_path):
    pytest.importorskip('nav_msgs', reason='needs ROS 2')
    uses_colcon = any(block.is_run and block.run['colcon'] for block in blocks(path))
    if colcon and shutil.which('colcon', path=searched()) is None:
        pytest.skip('there is no colcon here; make docs has it')
    if uses_colcon and not colcon and shutil.which('colcon', path=searched()) is not None:
        pytest.skip('all of it is run, colcon included')
    reader = Reader(tmp_path)
    try:
        play(path, reader, colcon)
    finally:
        reader.close_terminals()


def searched() -> str:
    """Return where programs are looked for."""
    return os.pathsep.join([str(Path(sys.prefix) / 'bin'), os.environ['PATH']])


def play(path: Path, reader: Reader, colcon: bool) -> None:
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
    """Tell whether a fragment gets into its file by commands that are run with colcon."""
    texts = [other.text for other in blocks(block.path) if other.file]
    return not any(block.text.strip() in text for text in texts)


# The examples.

@pytest.fixture
def example(tmp_path):
    """Return what starts an example."""
    def start(name: str):
        return user_script(ROOT.joinpath('examples', name).read_text(), tmp_path)
    return start


@needs_source
@pytest.mark.ros
def test_forward_drives_forward(example, listener):
    with example('forward.py') as started:
        assert started.end() == 0, started.text
    held = listener.moves()
    assert [(held[0].linear_x, held[0].angular_z)] == [(h.linear_x, h.angular_z) for h in held]
    assert held[0].linear_x * held[0].duration == pytest.approx(0.1, rel=0.02)
    assert len(listener.released) == 1


@needs_source
@pytest.mark.ros
def test_square_is_a_square(example, listener):
    with example('square.py') as started:
        assert started.end() == 0, started.text
    held = listener.moves()
    assert [h.linear_x * h.duration for h in held] == pytest.approx(
        [0.2, 0.0] * 4, rel=0.02, abs=1e-9)
    assert sum(h.angular_z * h.duration for h in held) == pytest.approx(6.283, rel=0.02)


@needs_source
@pytest.mark.ros
def test_square_says_when_there_is_no_robot(example):
    with example('square.py') as started:
        assert started.end() == 1
    assert 'square: no robot listens on ' in started.text
    assert 'Traceback' not in started.text


@needs_source
@pytest.mark.ros
def test_nod_on_request_nods_and_stops_on_ctrl_c(example, listener):
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from std_srvs.srv import Trigger
    context = Context()
    context.init(args=[])
    node = Node('somebody', context=context)
    client = node.create_client(Trigger, '/kachaka_simple_control/nod')
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def nod():
        assert client.wait_for_service(20.0)
        future = client.call_async(Trigger.Request())
        executor.spin_until_future_complete(future, 20.0)
        return future.result()

    try:
        with example('nod_on_request.py') as started:
            assert nod().success
            assert nod().message == 'nodding already'
            listener.wait_for(lambda heard: heard.angular_z < 0.0)
            before = started.send(signal.SIGINT)
            assert started.end() == 130, started.text
            assert 'Traceback' not in started.text
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    assert [h.angular_z for h in listener.moves()] == [0.5, -0.5]
    assert not any(heard.moves for heard in listener.heard if heard.time > before + 0.1)
