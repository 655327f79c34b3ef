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
The terminal of a drive: rows at its bottom that stay.

The terminal is told to scroll all rows but the lowest ones.  What others write goes straight to
the terminal as before, and scrolls above the rows that stay; no one has to wait.  Each of the
texts here must be written at once, so that nothing of others comes in between.

The program that drives imports this module: it must load quickly, and without rich.
"""

from __future__ import annotations

from collections.abc import Sequence
import os

from kachaka_simple_control.control.output import STDERR

_SAVE, _RESTORE = '\x1b7', '\x1b8'
_HIDE, _SHOW = '\x1b[?25l', '\x1b[?25h'
_SCROLL_ALL = '\x1b[r'
_CLEAR_BELOW, _CLEAR_LINE = '\x1b[J', '\x1b[2K'

#: Removes the rows; the cursor stays after what others wrote.  Harmless where there are none.
RELEASE_ROWS = f'{_SAVE}{_SCROLL_ALL}{_RESTORE}{_CLEAR_BELOW}{_SHOW}'


def reserve_rows(rows: int, height: int) -> str:
    """
    Return the text that makes room below the cursor, and clears what is there.

    :param rows: how many rows the terminal has
    :param height: how many of them are to stay
    """
    room = '\n' * height + f'\x1b[{height}A'
    return f'{_CLEAR_BELOW}{room}{_SAVE}\x1b[1;{rows - height}r{_RESTORE}'


def draw_rows(rows: int, lines: Sequence[str]) -> str:
    """
    Return the text that draws the rows that stay; the cursor stays where it is.

    :param rows: how many rows the terminal has
    :param lines: the lines, none wider than the terminal
    """
    first = rows - len(lines) + 1
    drawn = ''.join(
        f'\x1b[{first + index};1H{_CLEAR_LINE}{line}' for index, line in enumerate(lines))
    return f'{_SAVE}{_HIDE}{drawn}{_RESTORE}{_SHOW}'


def is_terminal(descriptor: int) -> bool:
    """Return whether a descriptor is a terminal that can keep rows."""
    try:
        return os.isatty(descriptor) and os.environ.get('TERM', 'dumb') not in ('', 'dumb')
    except OSError:
        return False


def should_display(is_lesson: bool) -> bool:
    """
    Return whether a display has anything to show.

    :param is_lesson: whether the node's own log lines describe each step
    """
    return not is_lesson or is_terminal(STDERR)
