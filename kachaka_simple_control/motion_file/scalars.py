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
"""What a word without quotes means, where YAML's versions and people disagree."""

from __future__ import annotations

import math
import re

from kachaka_simple_control.escaping import quoted
from kachaka_simple_control.motion_file.units import DIGITS

#: More characters than this no number needs: the longest float has 24.
MAX_NUMBER = 100
_NOTHING = ('', '~', 'null', 'Null', 'NULL')
_TRUTH = {
    'true': True, 'True': True, 'TRUE': True, 'false': False, 'False': False, 'FALSE': False}
_NUMBER = re.compile(f'[-+]?{DIGITS}')
_WHOLE = re.compile('[-+]?[0-9]{1,15}')
_LEADING_ZERO = re.compile('[-+]?0[0-9]+')
_NOT_FINITE = re.compile(r'[-+]?[.]?(inf(inity)?|nan)', re.IGNORECASE)


class ScalarError(ValueError):
    """A word means nothing that a file may say; the text says why."""


def resolve(word: str) -> bool | int | float | str | None:
    """
    Return what a word without quotes means.

    As in YAML 1.2: ``1e3`` is a number, ``yes``, ``on`` and ``1:30`` are text.

    :param word: the word
    :returns: nothing, a truth value, a finite number or a text
    :raises ScalarError: if it is a number that is not finite, endless, or read as octal by some
    """
    if word in _NOTHING:
        return None
    if word in _TRUTH:
        return _TRUTH[word]
    if _NUMBER.fullmatch(word):
        return _number(word)
    if _NOT_FINITE.fullmatch(word):
        raise ScalarError(f'{word} is not a finite number')
    return word


def _number(word: str) -> int | float:
    if len(word) > MAX_NUMBER:
        raise ScalarError(f'this number has {len(word)} characters; {MAX_NUMBER} are enough')
    if _LEADING_ZERO.fullmatch(word):
        raise ScalarError(
            f'{quoted(word)} has a leading zero, which makes it octal for some readers; '
            'leave the zero out')
    if _WHOLE.fullmatch(word):
        return int(word)
    number = float(word)
    if not math.isfinite(number):
        raise ScalarError(f'{quoted(word)} is too large a number')
    return number
