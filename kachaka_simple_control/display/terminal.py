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
Reserve fixed rows at the bottom of the terminal.

The scroll region of the terminal excludes the lowest rows.  Other programs write directly to the
terminal, and their output scrolls above the fixed rows.  Each text from this module must be
written in one call, so that no other output comes in between.

The driving program imports this module, so it must load quickly, and without rich.
"""

from __future__ import annotations

from collections.abc import Sequence
import os

from kachaka_simple_control.control.output import STDERR

_SAVE, _RESTORE = '\x1b7', '\x1b8'
_HIDE, _SHOW = '\x1b[?25l', '\x1b[?25h'
_SCROLL_ALL = '\x1b[r'
_CLEAR_BELOW, _CLEAR_LINE = '\x1b[J', '\x1b[2K'

#: The text that removes the fixed rows and keeps the cursor; harmless without fixed rows.
RELEASE_ROWS = f'{_SAVE}{_SCROLL_ALL}{_RESTORE}{_CLEAR_BELOW}{_SHOW}'


def reserve_rows(rows: int, height: int) -> str:
    """
    Return the text that reserves fixed rows at the bottom, and clears the rows below the cursor.

    :param rows: the number of rows of the terminal
    :param height: the number of fixed rows
    """
    room = '\n' * height + f'\x1b[{height}A'
    return f'{_CLEAR_BELOW}{room}{_SAVE}\x1b[1;{rows - height}r{_RESTORE}'


def draw_rows(rows: int, lines: Sequence[str]) -> str:
    """
    Return the text that draws the fixed rows and keeps the cursor.

    :param rows: the number of rows of the terminal
    :param lines: the lines of the fixed rows, none wider than the terminal
    """
    first = rows - len(lines) + 1
    drawn = ''.join(
        f'\x1b[{first + index};1H{_CLEAR_LINE}{line}' for index, line in enumerate(lines))
    return f'{_SAVE}{_HIDE}{drawn}{_RESTORE}{_SHOW}'


def is_terminal(descriptor: int) -> bool:
    """Return whether a file descriptor is a terminal that supports fixed rows."""
    try:
        return os.isatty(descriptor) and os.environ.get('TERM', 'dumb') not in ('', 'dumb')
    except OSError:
        return False


def should_display(is_lesson: bool) -> bool:
    """
    Return whether to start a display.

    A lesson without a terminal needs none, because the node logs each of its movements.

    :param is_lesson: whether the drive is the lesson
    """
    return not is_lesson or is_terminal(STDERR)
