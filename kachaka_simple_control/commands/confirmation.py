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
"""Ask somebody at the terminal whether a robot may drive."""

from __future__ import annotations

import contextlib
import sys
import termios

from kachaka_simple_control.errors import UsageError

#: The answers that let it drive; the empty one is Enter alone.
CONSENT = ('', 'y', 'yes')


def confirm(floor_size: str, before: str = '') -> None:
    """
    Ask whether a robot may drive; return if it may.

    Lines typed before the question do not answer it.

    :param floor_size: how much free floor it needs, in words
    :param before: what to do before
    :raises UsageError: if nobody can be asked, or the answer is not Enter, y or yes
    """
    if not sys.stdin.isatty():
        raise UsageError('a robot will move: pass --yes, for there is no terminal to ask at')
    print(f'\nThe robot needs {floor_size} of free floor.  {before}Enter drives, n or Ctrl+C '
          'ends.', flush=True)
    with contextlib.suppress(OSError, termios.error):
        termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
    answer = sys.stdin.readline()
    if not answer or answer.strip().lower() not in CONSENT:
        raise UsageError('not confirmed: nothing was driven')
