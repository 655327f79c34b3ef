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
Make the environment that the project runs in, once.

Where ROS 2 is sourced, its rclpy is the one to run with, and PyPI gives the tools alone;
elsewhere PyPI gives rclpy too.  Every problem is reported in one line.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
import hashlib
import importlib.util
import os
from pathlib import Path
import platform
import subprocess
import sys
import time

ROOT = Path(__file__).resolve().parent.parent
DISTROS = ('jazzy', 'kilted')
NEWEST_PYTHON = (3, 14)
#: What Ubuntu 22.04 has, and newer ones do not take the oldest releases of some libraries.
LOWEST_PYTHON = (3, 10)
GLIBC = (2, 28)
STAMP = 'set-up-of'
LOG = 'set-up.log'
#: What an environment is made from, beside its locks.
INPUTS = ('setup.py', 'setup.cfg', 'tools/environment.py')
#: A folder without any code can be imported as rclpy, so ask for a module in it; and messages
#: import more than rclpy does, such as numpy.
USE_ROS = 'import rclpy.node; from geometry_msgs.msg import Twist; Twist()'
#: What the program can do without, what for, and how to install it: a sourced ROS may be without,
#: and from PyPI matplotlib would want another numpy than that ROS.
OPTIONAL = {
    'jinja2': ('the page of a report', 'sudo apt install python3-jinja2'),
    'matplotlib': ('a picture of a plan or report', 'sudo apt install python3-matplotlib'),
    'rich': ('the live display', 'sudo apt install python3-rich'),
    'argcomplete': ('completion by Tab', 'sudo apt install python3-argcomplete'),
    'mcap': ('the recording beside a report', "pip install 'mcap>=1.5'"),
    'grpc': ('a real robot', 'pip install grpcio protobuf'),
    'numpy': ('a real robot', 'sudo apt install python3-numpy'),
    'kachaka_api': ('a real robot', 'pip install --no-deps kachaka-api'),
}
#: Purposes that take no ROS and nothing but a lock of their own, and what that has.
ALONE = {'humble-linters': 'the linters of Humble', 'lowest': 'the oldest releases'}
#: What pip says when nobody answers; a refused or unknown release reads otherwise.
UNREACHABLE = ('connection broken', 'Could not fetch URL', 'ReadTimeoutError')


class RefusalError(Exception):
    """The environment cannot be made here; the text says why, and what to do."""


@dataclass(frozen=True)
class Recipe:
    """
    What to make.

    :param folder: where, below the project's root
    :param distro: the ROS 2 distro; empty for none
    :param sourced: whether it is the one sourced here, so that none of it comes from PyPI
    :param purpose: the lock of the tools that go in: ``development``, ``colcon``, or one of
        those without ROS: ``lowest``, the oldest releases of everything, or ``humble-linters``
    """

    folder: Path
    distro: str
    sourced: bool
    purpose: str

    def locks(self) -> list[Path]:
        """
        Return the locks to install.

        :returns: their paths, in the order to install them in
        """
        distro = [] if self.sourced else [self.distro]
        names = ['build', self.purpose] if self.purpose in ALONE else [
            'build', self.purpose, 'kachaka', 'recording', *distro]
        return [ROOT / 'requirements' / f'{name}.txt' for name in names]

    def digest(self) -> str:
        """
        Return what changes whenever the environment has to be made anew.

        :returns: a digest
        """
        made_from = [*self.locks(), *(ROOT / name for name in INPUTS)]
        circumstances = repr((self, str(ROOT), sys.executable, sys.version))
        digest = hashlib.sha256(circumstances.encode())
        for path in made_from:
            digest.update(path.read_bytes())
        return digest.hexdigest()

    def __str__(self) -> str:
        """
        Return the recipe in words.

        :returns: a part of a sentence
        """
        python = f'{self.folder.name}: Python {platform.python_version()}'
        if self.purpose in ALONE:
            return f'{python}, {ALONE[self.purpose]}, without ROS'
        origin = 'as sourced here' if self.sourced else 'from PyPI'
        return f'{python}, ROS 2 {self.distro} {origin}, {self.purpose} tools'


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Make the environment that the arguments ask for, unless it is there.

    :param arguments: the arguments without the program's name; None for those of the process
    :returns: the exit code
    """
    parser = argparse.ArgumentParser(prog='set-up', description='Make an environment.')
    parser.add_argument('folder', help="its name below the project's root, such as .venv")
    parser.add_argument('--distro', choices=DISTROS, help='the ROS 2 that it must have')
    parser.add_argument(
        '--for', dest='purpose', default='development',
        choices=('development', 'colcon', *ALONE))
    options = parser.parse_args(arguments)
    try:
        set_up(recipe(ROOT / options.folder, options.distro, options.purpose))
    except RefusalError as refusal:
        print(f'set-up: {refusal}', file=sys.stderr)
        return 1
    return 0


def recipe(folder: Path, distro: str | None, purpose: str) -> Recipe:
    """
    Decide where ROS comes from.

    :param folder: where the environment is to be
    :param distro: the distro asked for; None for the one sourced here, or else the default
    :param purpose: what the environment is for
    :returns: what to make
    :raises RefusalError: if what is asked for cannot be had here
    """
    if purpose == 'lowest' and sys.version_info[:2] != LOWEST_PYTHON:
        raise RefusalError(
            'the oldest releases need Python 3.10, and this is '
            f'{platform.python_version()}; install it, on Ubuntu: sudo apt install python3.10')
    if purpose in ALONE:
        return Recipe(folder, '', False, purpose)
    sourced = sourced_distro()
    if sourced is None:
        require_wheels()
        return Recipe(folder, distro or DISTROS[0], False, purpose)
    if distro not in (None, sourced):
        raise RefusalError(
            f'ROS 2 {sourced} is sourced here; for {distro}, use a shell where none is')
    return Recipe(folder, sourced, True, purpose)


def sourced_distro() -> str | None:
    """
    Return the name of the ROS distro that this Python can use without our help.

    :returns: the name; None where no ROS is sourced
    :raises RefusalError: if one is sourced for another Python: it would stand before any other
    """
    distro = os.environ.get('ROS_DISTRO')
    if not distro:
        return None
    trial = subprocess.run(
        [sys.executable, '-c', USE_ROS], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, check=False)
    if trial.returncode == 0:
        return distro
    if os.environ.get('AMENT_PREFIX_PATH'):
        raise RefusalError(
            f'ROS 2 {distro} is sourced here, but {sys.executable} cannot use it '
            f'({reason(trial.stdout)}); name the Python that it is for, as in: '
            'make setup PYTHON=/usr/bin/python3')
    return None


def require_wheels() -> None:
    """
    Require a machine and a Python for which PyPI has rclpy.

    :raises RefusalError: if it has none
    """
    libc, libc_version = platform.libc_ver()
    machine = platform.machine()
    if (sys.platform, machine, libc) != ('linux', 'x86_64', 'glibc') or sys.maxsize < 2**32:
        raise RefusalError(
            'PyPI has ROS 2 for Linux on x86-64 with glibc alone, and this is '
            f'{platform.system()} on {machine}{" with " + libc if libc else ""}; '
            'install ROS 2 (README.md says how), source its setup.bash, and try again')
    if tuple(int(part) for part in libc_version.split('.')[:2]) < GLIBC:
        raise RefusalError(
            f'PyPI has ROS 2 for glibc 2.28 and newer, and this is {libc_version}; '
            'install ROS 2, source its setup.bash, and try again')
    if sys.version_info[:2] > NEWEST_PYTHON:
        raise RefusalError(
            f'PyPI has ROS 2 for Python 3.10 to 3.{NEWEST_PYTHON[1]}, and this is '
            f'{platform.python_version()}; name one, as in: make setup PYTHON=python3.12')


def set_up(wanted: Recipe) -> None:
    """
    Make an environment, unless it is there.

    :param wanted: which one
    :raises RefusalError: if it cannot be made
    """
    stamp = wanted.folder / STAMP
    digest = wanted.digest()
    if stamp.is_file() and stamp.read_text() == digest:
        return
    begin = time.monotonic()
    print(f'set-up: {wanted}; this takes a minute', flush=True)
    make(wanted)
    stamp.write_text(digest)
    print(f'set-up: done in {time.monotonic() - begin:.0f} s', flush=True)


def make(wanted: Recipe) -> None:
    """
    Make an environment from nothing.

    :param wanted: which one
    :raises RefusalError: if it cannot be made
    """
    if importlib.util.find_spec('ensurepip') is None or importlib.util.find_spec('venv') is None:
        raise RefusalError(
            'this Python cannot make environments; on Debian and Ubuntu: '
            f'sudo apt install python3.{sys.version_info[1]}-venv')
    options = ['--system-site-packages'] if wanted.sourced else []
    run(wanted, [sys.executable, '-m', 'venv', '--clear', *options, str(wanted.folder)])
    for lock in wanted.locks():
        # A lock names all that is wanted; more than that would be what it left out on purpose.
        pip(wanted, '--no-deps', '--require-hashes', f'--requirement={lock}')
    if wanted.purpose not in ('colcon', 'humble-linters'):
        pip(wanted, '--no-deps', f'--editable={ROOT}')
    if wanted.purpose in ALONE:
        return
    python = wanted.folder / 'bin' / 'python'
    try:
        run(wanted, [str(python), '-c', USE_ROS])
    except RefusalError as refusal:
        raise RefusalError(no_ros(wanted, str(refusal))) from None
    for name in lacking(python) if wanted.sourced else ():
        purpose, command = OPTIONAL[name]
        if command.startswith('pip '):
            command = f'{wanted.folder.name}/bin/python -m {command}'
        print(f'set-up: {purpose} needs {name}, which is not here: {command}', flush=True)


def no_ros(wanted: Recipe, failure: str) -> str:
    """
    Return why an environment cannot use ROS, and what to do.

    :param wanted: the environment
    :param failure: what the trial ended with
    :returns: the sentence of a refusal
    """
    text = f'ROS 2 {wanted.distro} cannot be used in {wanted.folder.name}: {failure}'
    if not wanted.sourced or sys.prefix == sys.base_prefix:
        return text
    return (
        f'{text}; {sys.executable} is itself a virtual environment, and a new one does not see '
        f'its libraries: install into it, with {sys.executable} -m pip install -e . , or name the '
        "system's Python, as in: make setup PYTHON=/usr/bin/python3")


def lacking(python: Path) -> list[str]:
    """
    Return which optional libraries an environment does not have.

    :param python: the Python of the environment
    :returns: their names
    """
    search = (
        'import sys; from importlib.util import find_spec; '
        'print(*[name for name in sys.argv[1:] if find_spec(name) is None])')
    found = subprocess.run(
        [str(python), '-c', search, *OPTIONAL], capture_output=True, text=True, check=True)
    return found.stdout.split()


def pip(wanted: Recipe, *arguments: str) -> None:
    """
    Let pip install something into an environment.

    :param wanted: the environment
    :param arguments: what to install
    :raises RefusalError: if it could not
    """
    python = str(wanted.folder / 'bin' / 'python')
    # Isolated builds would fetch what no lock names.  Python compiles what it imports by itself:
    # to compile all would be a third of the time.
    run(wanted, [python, '-m', 'pip', '--quiet', '--disable-pip-version-check', 'install',
                 '--no-compile', '--no-input', '--no-build-isolation', *arguments])


def run(wanted: Recipe, command: list[str]) -> None:
    """
    Run one command of the set-up, in silence unless it fails.

    :param wanted: the environment that it works on, where a failure is written down
    :param command: the command
    :raises RefusalError: if it fails
    """
    result = subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, check=False)
    if result.returncode == 0:
        return
    wanted.folder.mkdir(exist_ok=True)
    log = wanted.folder / LOG
    log.write_text(f'{command}\n{result.stdout}')
    raise RefusalError(f'{reason(result.stdout)} (all of it: {log.relative_to(ROOT)})')


def reason(output: str) -> str:
    """
    Return in one line why a command failed.

    :param output: what it printed
    :returns: the line
    """
    if any(sign in output for sign in UNREACHABLE):
        return 'the download failed, for the package index does not answer; is there a network?'
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith('ERROR:')]
    return (errors or lines or ['a command failed without a word'])[-1]
