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
"""Run what a document tells its reader to do, in terminals like theirs."""

from __future__ import annotations

import os
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
import sys

from doc_blocks import Block
from doc_output import compare
from program import Program, ROOT

PROGRAMS = {
    'kachaka_simple_control': 'kachaka_simple_control',
    'kachaka_calibrate': 'kachaka_simple_control.commands.calibrate',
    'kachaka_compare': 'kachaka_simple_control.commands.compare',
    'kachaka_fleet': 'kachaka_simple_control.commands.fleet',
    'kachaka_bridge': 'kachaka_simple_control.kachaka.bridge_command',
    'kachaka_sim': 'kachaka_simple_control.kachaka.sim_command',
}
#: How long the commands of a block may take, and a program until it is there, and to end after
#: Ctrl+C [s].
COMMAND_TIMEOUT, READY_TIMEOUT, EXIT_TIMEOUT = 300.0, 30.0, 10.0

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


class Reader:
    """Does what a document says, block by block."""

    def __init__(self, scratch: Path) -> None:
        """Start with an empty home directory and a copy of this repository's source."""
        self.scratch = scratch
        self.home, self.source = scratch / 'home', scratch / 'source'
        self._state = scratch / 'state'
        self._terminals: list[Program] = []
        self._count = 0
        self.output = ''
        self.home.mkdir()
        copy_source(self.source)
        tools = self._make_tools()
        path = os.pathsep.join([str(tools), str(Path(sys.prefix) / 'bin'), os.environ['PATH']])
        self.environment = {
            **os.environ, 'HOME': str(self.home), 'SOURCE': str(self.source), 'PATH': path,
            # A sourced ROS is found there, too.
            'PYTHONPATH': os.pathsep.join(
                filter(None, [str(self.source), os.environ.get('PYTHONPATH')])),
            'COLCON_HOME': str(scratch / 'colcon')}

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
        # What `make setup` would have made.
        environment = self.source / '.venv'
        if sys.prefix != sys.base_prefix:
            environment.symlink_to(sys.prefix)
        else:
            environment.joinpath('bin').mkdir(parents=True)
            environment.joinpath('bin', 'activate').touch()
        return tools

    def do(self, block: Block) -> None:
        """Run the commands of a block, and check their exit code."""
        run = block.run
        if run['close']:
            self.close_terminals()
        text = (run['instead'] + '\n') if run['instead'] else block.text
        folder = f'cd "{run["folder"]}"\n' if run['folder'] else ''
        if run['until']:
            # Another terminal does not have what was sourced here.
            terminal = self._open(folder + text)
            terminal.wait_for_text(run['until'], READY_TIMEOUT)
            self.output = terminal.text
            return
        state = shlex.quote(str(self._state))
        terminal = self._open(
            f'if [ -e {state} ]; then source {state}; fi\nset -e\n{folder}{text}set +e\n'
            f'{{ export -p; printf "cd %q\\n" "$PWD"; }} >{state}\n')
        code = terminal.end(COMMAND_TIMEOUT)
        self.output = terminal.text
        assert code == int(run['code'] or 0), (
            f'{block}: these commands ended with exit code {code}:\n{text}\n{self.output}')

    def type_file(self, block: Block) -> None:
        """Write a file of the document."""
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
        robot.wait_for_text('ready: ', READY_TIMEOUT)
        script = self.scratch / 'script.py'
        script.write_text(block.text)
        program = self._open(f'python3 {script}')
        code = program.end(COMMAND_TIMEOUT)
        assert code == 0, f'{block}: ended with exit code {code}:\n{program.text}'
        assert 'Movement completed' in program.text, f'{block}: nothing moved:\n{program.text}'
        robot.close(EXIT_TIMEOUT, signal.SIGINT)

    def read_output(self, block: Block) -> None:
        """Compare what a block quotes with the last output."""
        difference = compare(block.text.splitlines(), self.output.splitlines())
        assert difference is None, f'{block}: {difference}; it printed:\n{self.output}'

    def has_file_with(self, fragment: str) -> bool:
        """Return whether a part of a file is in one of the files in the home."""
        wanted = re.sub(r'\s+', ' ', fragment.strip())
        files = [path for path in self.home.rglob('src/*/**/*') if path.is_file()
                 and path.suffix in ('.cfg', '.py', '.xml')]
        return any(wanted in re.sub(r'\s+', ' ', path.read_text()) for path in files)

    def close_terminals(self) -> None:
        """Press Ctrl+C in every terminal."""
        for terminal in self._terminals:
            terminal.close(EXIT_TIMEOUT, signal.SIGINT)
        self._terminals.clear()

    def _open(self, command: str) -> Program:
        """Start a command in a shell of its own."""
        self._count += 1
        self._terminals.append(Program(
            ['bash', '-c', command], self.scratch / f'terminal-{self._count}.txt', cwd=self.home,
            env=self.environment))
        return self._terminals[-1]


def copy_source(folder: Path) -> None:
    """Copy the files of this repository that git knows or would add."""
    listing = subprocess.run(
        ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
        cwd=ROOT, capture_output=True, text=True, check=True)
    for name in filter(None, listing.stdout.split('\0')):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)


def searched() -> str:
    """Return the search path of programs."""
    return os.pathsep.join([str(Path(sys.prefix) / 'bin'), os.environ['PATH']])
