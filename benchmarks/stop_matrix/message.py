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
"""What a program said last; pure."""

from __future__ import annotations

import re

PREFIX = re.compile(r'^\[\w+\] \[[\d.]+\] \[[\w./]+\]: ')
NAME = re.compile(r'^(kachaka_simple_control: |kachaka_simple_control\.[\w.]+: )')
COLOUR = re.compile(r'\x1b\[[\d;]*m')
LONGEST = 100
#: What it says in any case.
ROUTINE = ('Robot control node has started', 'Robot has stopped', 'Movement completed')


def message(text: str, namespace: str, may_trace: bool) -> str:
    """
    Return what a program said last, its routine left out.

    :param text: all that it printed
    :param namespace: where its robot was; put as the robot's usual one
    :param may_trace: whether a traceback may be part of it: what a user's script did not catch
    :returns: one line; with ``Traceback`` before it if there was one that should not be
    """
    plain = COLOUR.sub('', text)
    lines = [NAME.sub('', PREFIX.sub('', line)).strip() for line in plain.splitlines()
             if not line.startswith((' ', 'Traceback'))]
    said = [line for line in lines if line and not line.startswith(ROUTINE)]
    last = (said[-1] if said else '').replace(namespace, 'kachaka')
    last = last if len(last) <= LONGEST else last[:LONGEST].rsplit(' ', 1)[0] + ' ...'
    return f'Traceback: {last}' if 'Traceback' in text and not may_trace else last
