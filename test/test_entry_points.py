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
"""How a command begins: silent at Ctrl+C, and with streams that may be closed."""

import os
import subprocess
import sys

from program import COMMAND, environment, quick_drive
import pytest

#: Presses Ctrl+C when a module is imported; Python runs it before anything else.
SITECUSTOMIZE = """
import os, signal, sys
class Finder:
    def find_spec(self, name, *_):
        if name == 'kachaka_simple_control.IMPORTED':
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
"""


def run(command, **options):
    """Run a command to its end."""
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, text=True, check=False, timeout=60,
        **{'env': environment(), **options})


def entry_point(name):
    """Return a command that does what the script of an entry point does."""
    text = f'import sys\nfrom kachaka_simple_control.{name}\nsys.exit(main())'
    return [sys.executable, '-c', text]


@pytest.mark.parametrize('command, imported', [
    # What comes first, and in the script of the command as well.
    ([*COMMAND], 'errors'),
    ([*COMMAND, 'square'], 'motion.plan'),
    (entry_point('__main__ import main'), 'errors'),
    ([*entry_point('__main__ import main'), 'square'], 'motion.plan'),
    (entry_point('__main__ import main'), 'commands.cli'),
    ([*entry_point('__main__ import main'), 'square'], 'commands.drive'),
    (entry_point('entry_points import calibrate as main'), 'commands.calibrate_options'),
    (entry_point('entry_points import compare as main'), 'report.comparison'),
    (entry_point('entry_points import bridge as main'), 'errors'),
    (entry_point('entry_points import simulate as main'), 'kachaka.program'),
])
def test_ctrl_c_while_modules_are_imported_is_silent(command, imported, tmp_path):
    (tmp_path / 'sitecustomize.py').write_text(SITECUSTOMIZE.replace('IMPORTED', imported))
    path = os.pathsep.join([str(tmp_path), environment()['PYTHONPATH']])
    ended = run(command, capture_output=True, env=environment(PYTHONPATH=path))
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, '', '')


@pytest.mark.parametrize('redirection', ['<&-', '2>&-', '2>/dev/full', '<&- >&- 2>&-'])
def test_a_stream_that_is_closed_or_full_is_no_error(redirection):
    ended = run(['sh', '-c', f'exec "$@" {redirection}', 'sh', *COMMAND, 'square', '--plan'],
                stdout=subprocess.DEVNULL)
    assert ended.returncode == 0


@pytest.mark.ros
@pytest.mark.needs('rclpy', 'yaml', 'jsonschema')
@pytest.mark.parametrize('redirection', ['2>&-', '2>/dev/full', '<&- >&- 2>&-'])
def test_a_drive_needs_no_standard_stream(redirection, listener, tmp_path):
    ended = run(['sh', '-c', f'exec "$@" {redirection}', 'sh', *quick_drive(tmp_path)],
                stdout=subprocess.DEVNULL)
    assert ended.returncode == 0
    assert any(velocity.moves for velocity in listener.received)
