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
A few lines at the bottom of a terminal that stay while others write above them.

The terminal is told to scroll all lines but the lowest ones.  So whoever else writes to it goes
on writing as ever, straight to the terminal, and what he writes scrolls above the lines that
stay.  Nothing of it passes through us, and nobody has to wait for us.  Each of these texts is to
be written at once, for then nothing of others comes in between.
"""

from __future__ import annotations

from collections.abc import Sequence

_SAVE, _RESTORE = '\x1b7', '\x1b8'
_HIDE, _SHOW = '\x1b[?25l', '\x1b[?25h'
_SCROLL_ALL = '\x1b[r'
_CLEAR_BELOW, _CLEAR_LINE = '\x1b[J', '\x1b[2K'

#: Takes the lines away, whatever became of them; the cursor stays after what others wrote.
#: Harmless where there are none.
RELEASE_ROWS = f'{_SAVE}{_SCROLL_ALL}{_RESTORE}{_CLEAR_BELOW}{_SHOW}'


def reserve_rows(rows: int, height: int) -> str:
    """
    Return what makes room below the cursor.

    :param rows: how many lines the terminal has
    :param height: how many of them are to stay
    :returns: the text; what is below the cursor is cleared
    """
    room = '\n' * height + f'\x1b[{height}A'
    return f'{_CLEAR_BELOW}{room}{_SAVE}\x1b[1;{rows - height}r{_RESTORE}'


def draw_rows(rows: int, lines: Sequence[str]) -> str:
    """
    Return what draws the lines that stay.

    :param rows: how many lines the terminal has
    :param lines: the lines, none wider than the terminal
    :returns: the text; the cursor stays where it is
    """
    first = rows - len(lines) + 1
    drawn = ''.join(
        f'\x1b[{first + place};1H{_CLEAR_LINE}{line}' for place, line in enumerate(lines))
    return f'{_SAVE}{_HIDE}{drawn}{_RESTORE}{_SHOW}'
