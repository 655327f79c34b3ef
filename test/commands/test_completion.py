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
"""Completion of the command in a shell."""

import os
from pathlib import Path
import shlex
import subprocess
import sys

from program import COMMAND, environment
import pytest

#: Asks as a terminal's bash does when Tab is pressed, and prints what it offers.
BASH = """
eval "$({python} -c '
from argcomplete import shellcode
print(shellcode(["kachaka_simple_control"]))')"
kachaka_simple_control() {{ {command} "$@"; }}
COMP_LINE={line} COMP_POINT=${{#COMP_LINE}} COMP_TYPE=9
_python_argcomplete kachaka_simple_control
printf '%s\n' "${{COMPREPLY[@]}}"
"""
#: A library that cannot be imported, and would end the program if it were.
BROKEN = 'raise {error}'


def blocked(folder: Path, name: str, error: str) -> dict[str, str]:
    """Return an environment in which a library cannot be imported."""
    (folder / f'{name}.py').write_text(BROKEN.format(error=error))
    path = os.pathsep.join([str(folder), environment()['PYTHONPATH']])
    return {**os.environ, 'PYTHONPATH': path}


@pytest.mark.needs('argcomplete.shell_integration', 'yaml', 'jsonschema')
@pytest.mark.parametrize('typed, offered', [
    ('--', {'--plan', '--sim', '--wait', '--report', '--linear-gain'}),
    ('--ver', {'--version '}),
    ('', {'square', 'lesson', 'umbmark_cw', 'mine.yaml', 'runs/'}),
    ('squ', {'square', 'square_cw'}), ('mi', {'mine.yaml '}), ('runs/', {'runs/old.yml '}),
    ('square --pl', {'--plan', '--plot'}),
    ('square --plot ', {'runs/', 'plot.png'}), ('--robot gen', {'generic '}),
    ('--sim --floor cro', {'crossing '}),
    ('square --with ', {'side=', 'laps='}), ('square --plan --with la', {'laps='}),
    ('--report r', {'runs/'})])
def test_a_shell_is_told_what_a_word_may_become(typed, offered, tmp_path):
    """Without ROS, which takes long to import; what is no motion is not offered as one."""
    folder = tmp_path / 'here'
    (folder / 'runs').mkdir(parents=True)
    for name in ('mine.yaml', 'notes.txt', 'plot.png', 'runs/old.yml'):
        (folder / name).touch()
    script = BASH.format(
        python=sys.executable, command=shlex.join(COMMAND),
        line=shlex.quote(f'kachaka_simple_control {typed}'))
    result = subprocess.run(
        ['/bin/bash', '-c', script], cwd=folder, capture_output=True, text=True, timeout=30.0,
        env=blocked(tmp_path, 'rclpy', 'SystemExit("rclpy")'), check=False)
    words = set(result.stdout.splitlines())
    assert offered <= words, result
    assert 'notes.txt' not in words
    if not typed or typed.endswith('-'):
        assert len(words) > len(offered)
    else:
        assert words == offered


def test_without_argcomplete_tab_drives_nothing(tmp_path):
    """It once would have begun the lesson."""
    error = "ModuleNotFoundError('missing', name='argcomplete')"
    result = subprocess.run(
        [*COMMAND], capture_output=True, text=True, timeout=30.0, check=False,
        env={**blocked(tmp_path, 'argcomplete', error), '_ARGCOMPLETE': '1',
             'COMP_LINE': 'kachaka_simple_control ', 'COMP_POINT': '23'})
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert '`pip install argcomplete`' in line
