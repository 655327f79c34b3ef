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
"""Only reading a file needs PyYAML and jsonschema; the error says how to install them."""

from __future__ import annotations

import subprocess

from program import environment, without
import pytest


def run(text: str, *blocked: str) -> str:
    """Return what a program prints that cannot import some modules."""
    result = subprocess.run(
        without(blocked, text), check=True, text=True, env=environment(), capture_output=True)
    return result.stdout


def test_motions_robots_and_plans_need_no_file():
    run("""
from kachaka_simple_control import Limits, Motion, Move, plan
from kachaka_simple_control.files.robot_profile import KACHAKA
import kachaka_simple_control.files.motion_file, kachaka_simple_control.files.robot_profile
plan(Motion('one', (Move(0.1, 0.0, 1.0),)), KACHAKA.limits, 10.0)
assert kachaka_simple_control.files.robot_profile.find_robot('kachaka') is KACHAKA
""", 'yaml', 'jsonschema')


@pytest.mark.parametrize('blocked', ['yaml', 'jsonschema'])
@pytest.mark.parametrize('what', [
    "from kachaka_simple_control.files.library import find; find('square')",
    "from kachaka_simple_control.files.motion_reader import loads; loads('steps: []')",
    "from kachaka_simple_control.files.robot_profile import find_robot; find_robot('generic')",
])
def test_the_error_of_reading_a_file_says_what_to_install(what, blocked):
    if blocked != 'yaml':
        pytest.importorskip('yaml', reason='needs PyYAML')
    said = run(f"""
try:
    {what}
except Exception as error:
    print(type(error).__name__, error)
""", blocked)
    assert said.startswith(('MotionFileError ', 'RobotFileError '))
    assert said.count('\n') == 1
    assert 'pip install PyYAML jsonschema' in said
    assert 'apt install python3-yaml python3-jsonschema' in said
