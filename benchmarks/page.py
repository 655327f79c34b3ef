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
"""Replace the measured part of a page; pure."""

from __future__ import annotations

BEGIN = '<!-- measured: written by make bench, changes here are lost -->'
END = '<!-- measured: end -->'


def updated(page: str, measured: str, begin: str = BEGIN, end: str = END) -> str:
    """
    Return a page with the part between two lines replaced.

    :raises ValueError: if the page has not one such part
    """
    if page.count(begin) != 1 or page.count(end) != 1 or page.index(end) < page.index(begin):
        raise ValueError(f'the page must have one line {begin!r} and one line {end!r} after it')
    head, _, rest = page.partition(begin)
    _, _, tail = rest.partition(end)
    return f'{head}{begin}\n\n{measured.strip()}\n\n{end}{tail}'
