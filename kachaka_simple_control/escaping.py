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
"""Text that comes from outside, as it can be printed: in one line, not too long, harmless."""

from __future__ import annotations


def escaped(text: object, most: int = 200) -> str:
    r"""
    Return a text so that it stands in one line and does nothing to a terminal.

    Line breaks, escape sequences and other characters that cannot be seen are written as Python
    writes them: ``\n``, ``\x1b``.

    :param text: the text, of any length
    :param most: how many characters there are for it
    :returns: what to print of it, with three dots where it was longer
    """
    line = ''.join(
        sign if sign.isprintable() else sign.encode('unicode_escape').decode('ascii')
        for sign in str(text)[:most + 1])
    return line if len(line) <= most else line[:most - 3] + '...'


def quoted(text: str, most: int = 40) -> str:
    """
    Return a text in quotes, in one line and not too long.

    :param text: the text
    :param most: how many of its characters are shown
    :returns: what to print of it
    """
    return repr(text if len(text) <= most else text[:most - 3] + '...')
