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
Make the virtual environment of the project, unless it exists.

If ROS 2 is sourced, the environment uses its rclpy, and installs only the tools from PyPI.
Otherwise it also installs rclpy from PyPI.  Every problem is reported in one line.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import contextlib
from dataclasses import dataclass
import hashlib
import importlib.util
import os
from pathlib import Path
import platform
import shutil
import subprocess
import sys
import time

ROOT = Path(__file__).resolve().parent.parent
DISTROS = ('jazzy', 'kilted')
NEWEST_PYTHON = (3, 14)
#: The Python of Ubuntu 22.04; a newer Python cannot use the oldest releases of some libraries.
LOWEST_PYTHON = (3, 10)
GLIBC = (2, 28)
STAMP = 'set-up-of'
LOG = 'set-up.log'
#: The Python that makes environments.  Where one is activated, it is not the link in it, because
#: that environment may be made again.
PYTHON = sys.executable if sys.prefix == sys.base_prefix else os.path.realpath(sys.executable)
#: The files that an environment depends on, in addition to its lock files.
INPUTS = ('setup.py', 'setup.cfg', 'tools/environment.py')
#: The check of ROS.  A folder without code can be imported as ``rclpy``, so a module in it is
#: imported.  A message is created, because messages need more libraries, for example numpy.
USE_ROS = 'import rclpy.node; from geometry_msgs.msg import Twist; Twist()'
#: The optional libraries with their purpose and the command that installs them.  A sourced ROS may
#: lack them; matplotlib from PyPI would need another numpy than this ROS.
OPTIONAL = {
    'jinja2': ('the page of a report', 'sudo apt install python3-jinja2'),
    'matplotlib': ('a picture of a plan or report', 'sudo apt install python3-matplotlib'),
    'rich': ('the live display', 'sudo apt install python3-rich'),
    'argcomplete': ('completion by Tab', 'sudo apt install python3-argcomplete'),
    'tornado': ('the console in the browser', 'sudo apt install python3-tornado'),
    'mcap': ('the recording beside a report', "pip install 'mcap>=1.5'"),
    'grpc': ('a real robot', 'pip install grpcio protobuf'),
    'numpy': ('a real robot', 'sudo apt install python3-numpy'),
    'kachaka_api': ('a real robot', 'pip install --no-deps kachaka-api'),
}
#: The purposes that need only their own lock file and no ROS, with a description.
ALONE = {'humble-linters': 'the linters of Humble', 'lowest': 'the oldest releases'}
#: The line of pip after what a build has printed.
END_OF_BUILD = '[end of output]'
#: The messages of pip if the package index does not respond.
UNREACHABLE = ('connection broken', 'Could not fetch URL', 'ReadTimeoutError')


class RefusalError(Exception):
    """The environment cannot be made here; the text gives the reason and the remedy."""


@dataclass(frozen=True)
class Recipe:
    """
    The description of an environment to make.

    :param folder: the folder of the environment, below the project's root
    :param distro: the ROS 2 distro; empty for none
    :param sourced: whether the distro is sourced here; if not, it is installed from PyPI
    :param purpose: the name of the lock file of the tools: ``development``, ``colcon``, or
        without ROS ``lowest`` (the oldest releases of all libraries) or ``humble-linters``
    """

    folder: Path
    distro: str
    sourced: bool
    purpose: str

    def locks(self) -> list[Path]:
        """
        Return the lock files to install.

        :returns: their paths, in the order of installation
        """
        distro = [] if self.sourced else [self.distro]
        names = ['build', self.purpose] if self.purpose in ALONE else [
            'build', self.purpose, 'kachaka', 'recording', *distro]
        return [ROOT / 'requirements' / f'{name}.txt' for name in names]

    def digest(self) -> str:
        """
        Return a digest that changes when the environment must be made again.

        :returns: the digest
        """
        made_from = [*self.locks(), *(ROOT / name for name in INPUTS)]
        # Where the environment is activated, its Python is a link to the one that made it.
        python = os.path.realpath(sys.executable)
        circumstances = repr((self, str(ROOT), python, sys.version))
        digest = hashlib.sha256(circumstances.encode())
        for path in made_from:
            digest.update(path.read_bytes())
        return digest.hexdigest()

    def __str__(self) -> str:
        """
        Return the description as text.

        :returns: a part of a sentence
        """
        python = f'{self.folder.name}: Python {platform.python_version()}'
        if self.purpose in ALONE:
            return f'{python}, {ALONE[self.purpose]}, without ROS'
        origin = 'as sourced here' if self.sourced else 'from PyPI'
        return f'{python}, ROS 2 {self.distro} {origin}, {self.purpose} tools'


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Make the environment that the arguments name, unless it exists.

    :param arguments: the arguments without the program's name; None for the process's arguments
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
    Choose the source of ROS, and return the description of the environment.

    :param folder: the folder of the environment
    :param distro: the requested distro; None for the sourced distro, or else the default
    :param purpose: the purpose of the environment
    :returns: the description
    :raises RefusalError: if the request cannot be met here
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
    Return the name of the sourced ROS distro that this Python can use.

    :returns: the name; None if no ROS is sourced
    :raises RefusalError: if the sourced ROS is for another Python, because its path would come
        first
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
    Check that PyPI has rclpy for this machine and this Python.

    :raises RefusalError: if PyPI does not have it
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
    Make an environment, unless it exists and is up to date.

    :param wanted: the description of the environment
    :raises RefusalError: if the environment cannot be made
    """
    stamp = wanted.folder / STAMP
    digest = wanted.digest()
    if stamp.is_file() and stamp.read_text() == digest:
        return
    begin = time.monotonic()
    print(f'set-up: {wanted}; this takes about a minute', flush=True)
    with kept_on_failure(wanted.folder):
        make(wanted)
        stamp.write_text(digest)
    print(f'set-up: done in {time.monotonic() - begin:.0f} s', flush=True)


@contextlib.contextmanager
def kept_on_failure(folder: Path) -> Iterator[None]:
    """
    Keep a complete environment while a new one is made, and move it back on failure.

    :param folder: the folder of both environments
    """
    before = folder.with_name(f'{folder.name}-before')
    if (folder / STAMP).is_file():
        shutil.rmtree(before, ignore_errors=True)
        with contextlib.suppress(OSError):  # such as a folder that is mounted
            folder.rename(before)
    try:
        yield
    except BaseException:
        if before.is_dir():
            log = folder / LOG
            if log.is_file():
                log.replace(before / LOG)
            shutil.rmtree(folder, ignore_errors=True)
            before.rename(folder)
            print(f'set-up: {folder.name} stays as it was', flush=True)
        raise
    shutil.rmtree(before, ignore_errors=True)


def make(wanted: Recipe) -> None:
    """
    Make a new environment, and remove the old content of its folder.

    :param wanted: the description of the environment
    :raises RefusalError: if the environment cannot be made
    """
    if importlib.util.find_spec('ensurepip') is None or importlib.util.find_spec('venv') is None:
        raise RefusalError(
            'this Python cannot make environments; on Debian and Ubuntu: '
            f'sudo apt install python3.{sys.version_info[1]}-venv')
    options = ['--system-site-packages'] if wanted.sourced else []
    run(wanted, [PYTHON, '-m', 'venv', '--clear', *options, str(wanted.folder)])
    for lock in wanted.locks():
        # A lock file names all packages; other dependencies are left out on purpose.
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
    Return the reason why an environment cannot use ROS, and the remedy.

    :param wanted: the description of the environment
    :param failure: the error of the check
    :returns: the text of a refusal
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
    Return the optional libraries that an environment lacks.

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
    Install packages into an environment with pip.

    :param wanted: the description of the environment
    :param arguments: the arguments that name the packages
    :raises RefusalError: if the installation fails
    """
    python = str(wanted.folder / 'bin' / 'python')
    # Isolated builds would download packages that no lock file names.  Compiling all modules would
    # take a third of the time, and Python compiles each module at its first import.
    run(wanted, [python, '-m', 'pip', '--quiet', '--disable-pip-version-check', 'install',
                 '--no-compile', '--no-input', '--no-build-isolation', *arguments])


def run(wanted: Recipe, command: list[str]) -> None:
    """
    Run one command of the set-up, and show no output unless it fails.

    :param wanted: the description of the environment, whose folder gets the log of a failure
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
    Return the reason of a failed command in one line.

    :param output: the output of the command
    :returns: the line
    """
    if any(sign in output for sign in UNREACHABLE):
        return 'the download failed, for the package index does not answer; is there a network?'
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    if END_OF_BUILD in lines[1:]:
        # What a build has printed ends with its error; pip's own words after it say nothing of it.
        return lines[lines.index(END_OF_BUILD) - 1]
    errors = [line for line in lines if line.startswith('ERROR:')]
    said = [line for line in lines if not line.startswith(('hint:', 'note:'))]
    return (errors or said or lines or ['a command failed without a word'])[-1]
