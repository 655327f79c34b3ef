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
"""Find the last message of a program in its output."""

from __future__ import annotations

import re

LOG_PREFIX = re.compile(r'^\[\w+\] \[[\d.]+\] \[[\w./]+\]: ')
PROGRAM_PREFIX = re.compile(r'^(kachaka_simple_control: |kachaka_simple_control\.[\w.]+: )')
COLOUR = re.compile(r'\x1b\[[\d;]*m')
#: Matches the path of a trial's script.
SCRIPT = re.compile(r'/\S*/script\.py')
MAX_LENGTH = 100
#: Lines that each program logs.
ROUTINE = (
    'Robot control node has started', 'Robot has stopped', 'Movement completed', 'Paused: ',
    'Resumed', 'Calibrated: ', 'The robot did not confirm')


def last_message(text: str, namespace: str, traceback_expected: bool) -> str:
    """
    Return the last printed line of a program, without routine log lines.

    :param text: the whole output of the program
    :param namespace: the robot's namespace, which is replaced with the default namespace
    :param traceback_expected: whether a traceback is correct, from an error that a user's script
        does not catch
    :returns: one line, which starts with ``Traceback: `` after an unexpected traceback
    """
    plain = COLOUR.sub('', text)
    lines = [PROGRAM_PREFIX.sub('', LOG_PREFIX.sub('', line)).strip()
             for line in plain.splitlines() if not line.startswith((' ', 'Traceback'))]
    messages = [line for line in lines if line and not line.startswith(ROUTINE)]
    last = (messages[-1] if messages else '').replace(namespace, 'kachaka')
    last = SCRIPT.sub('script.py', last)
    last = last if len(last) <= MAX_LENGTH else last[:MAX_LENGTH].rsplit(' ', 1)[0] + ' ...'
    return f'Traceback: {last}' if 'Traceback' in text and not traceback_expected else last
