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
Break the package in one place at a time, and see that the tests notice.

Each ``*.diff`` beside this file is a mutant: one line says what it breaks and for whom that
matters, ``Reach:`` which files of tests reach its line, and ``Killed by:`` tests that failed with
it.  It is applied to a copy of the source; first the tests that killed it are run, and if they
pass the rest of those that reach it.

After a change that moves the line of a mutant, write its diff anew: the mistake stays the same.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tempfile
import time

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
FAILED = re.compile(r'^(?:FAILED|ERROR) (test/[^\s:]+::[^\s\[]+)', re.MULTILINE)
#: The timeout of the tests of one mutant [s]; a mutant that hangs the tests counts as killed.
TIMEOUT = 900.0
#: The largest number of test names in a diff.
LISTED = 4


@dataclass(frozen=True)
class Mutant:
    """
    A mutant: a change that breaks one place of the package.

    :param file: its diff
    :param reach: the test files whose tests reach the changed line
    :param killers: the tests that failed with it
    """

    file: Path
    reach: tuple[str, ...]
    killers: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return the name of the mutant."""
        return self.file.stem

    @property
    def is_pure(self) -> bool:
        """Return whether no test that reaches the mutant needs ROS."""
        return not any(
            'pytest.mark.ros' in (ROOT / file).read_text() for file in self.reach)


def load(file: Path) -> Mutant:
    """Load a mutant from its diff."""
    head = file.read_text().partition('diff --git ')[0]
    fields = dict(re.findall(r'^(Reach|Killed by):(.*)$', head, re.MULTILINE))
    return Mutant(file, tuple(fields['Reach'].split()), tuple(fields['Killed by'].split(' ; ')))


def copy_source(folder: Path) -> None:
    """Copy the tracked and the untracked, not ignored files of this repository to a folder."""
    listing = subprocess.run(
        ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
        cwd=ROOT, capture_output=True, text=True, check=True)
    for name in filter(None, listing.stdout.split('\0')):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)


def run_tests(folder: Path, tests: tuple[str, ...]) -> list[str] | None:
    """
    Run tests in a copy of the source until the first failure.

    :returns: the failed tests; empty if all passed; None if no test could be run
    """
    try:
        result = subprocess.run(
            [sys.executable, '-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider', *tests],
            cwd=folder, capture_output=True, text=True, timeout=TIMEOUT, check=False,
            stdin=subprocess.DEVNULL, env={
                # Each pytest session claims its own ROS domain.
                **{name: value for name, value in os.environ.items() if name != 'ROS_DOMAIN_ID'},
                'PYTHONPATH': os.pathsep.join(
                    filter(None, [str(folder), os.environ.get('PYTHONPATH')]))})
    except subprocess.TimeoutExpired:
        return ['(hung)']
    if result.returncode == 0:
        return []
    return FAILED.findall(result.stdout) or None


def judge(mutant: Mutant, is_mutated: bool = True) -> tuple[str, str]:
    """
    Run the tests that reach a mutant.

    :param mutant: the mutant
    :param is_mutated: whether to apply the mutant
    :returns: ``killed``, ``survived`` or an error; and the first failed test
    """
    with tempfile.TemporaryDirectory(prefix='mutant-') as scratch:
        folder = Path(scratch)
        copy_source(folder)
        if is_mutated and subprocess.run(
                ['git', 'apply', str(mutant.file)], cwd=folder, check=False).returncode:
            return 'does not apply', ''
        names = [name for name in mutant.killers if name.split('::')[0] in mutant.reach]
        for tests in (tuple(filter(None, names)), mutant.reach):
            if not tests:
                continue
            failed = run_tests(folder, tests)
            if failed:
                return 'killed', failed[0]
            if failed is None and tests is mutant.reach:
                return 'no test was run', ''
        return 'survived', ''


def main() -> int:
    """
    Run the mutants that the arguments name.

    :returns: the exit code: 0 if all are killed
    """
    parser = argparse.ArgumentParser(prog='mutants', description=(__doc__ or '').splitlines()[1])
    parser.add_argument('names', nargs='*', help='the mutants; all without a name')
    parser.add_argument('--pure', action='store_true', help='only those that need no ROS')
    parser.add_argument('--jobs', type=int, default=1, help='how many at a time')
    parser.add_argument('--baseline', action='store_true', help='run their tests unmutated')
    parser.add_argument('--record', action='store_true', help='write down which test killed each')
    options = parser.parse_args()
    mutants = [load(file) for file in sorted(HERE.glob('*.diff'))
               if not options.names or file.stem in options.names]
    chosen = [mutant for mutant in mutants if mutant.is_pure or not options.pure]
    wanted = 'survived' if options.baseline else 'killed'

    def show(mutant: Mutant) -> bool:
        began = time.monotonic()
        outcome, test = judge(mutant, not options.baseline)
        duration = time.monotonic() - began
        print(f'{mutant.name:36} {outcome:8} {duration:5.0f} s  {test}', flush=True)
        if options.record and outcome == 'killed' and '::' in test:
            record(mutant, test)
        return outcome == wanted

    with ThreadPoolExecutor(options.jobs) as pool:
        results = [*pool.map(show, chosen)]
    print(f'{sum(results)} of {len(results)} {wanted}')
    return 0 if results and all(results) else 1


def record(mutant: Mutant, test: str) -> None:
    """Add a test to the list of tests that killed a mutant, in its diff."""
    names = [*filter(None, mutant.killers), test]
    names = [*dict.fromkeys(name.strip() for name in names)][:LISTED]
    text = re.sub(
        r'^Killed by:.*$', lambda _: f'Killed by: {" ; ".join(names)}', mutant.file.read_text(),
        count=1, flags=re.MULTILINE)
    mutant.file.write_text(text)


if __name__ == '__main__':
    sys.exit(main())
