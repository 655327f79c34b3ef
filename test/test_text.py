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
"""Text from outside, as it is printed."""

from kachaka_simple_control.kachaka.robot_status import ErrorTexts
from kachaka_simple_control.text import escaped, quoted
import pytest


@pytest.mark.parametrize('text, shown', [
    ('plain, with ü and 机器人', 'plain, with ü and 机器人'),
    ('two\nlines\r\n', r'two\nlines\r\n'),
    ('\x1b[31mred\x07', r'\x1b[31mred\x07'),
    ('\u202eright to left', r'\u202eright to left'),
    ('\udcff', r'\udcff'),
    ('', ''),
])
def test_what_cannot_be_printed_is_escaped(text, shown):
    assert escaped(text) == shown


def test_it_is_no_longer_than_asked_for():
    assert escaped('a' * 100_000, 60) == 'a' * 57 + '...'
    assert escaped('a' * 60, 60) == 'a' * 60
    assert len(escaped('\n' * 100_000, 60)) == 60
    assert quoted('a' * 100_000, 60) == repr('a' * 57 + '...')


def test_errors_of_a_robot_are_escaped():
    texts = ErrorTexts(r'[{"code": 7, "title_en": "\u001b[2J' + 'a' * 1000 + '"}]')
    described = texts.describe(7)
    assert described.startswith(r'error 7 (\x1b[2Jaaa')
    assert len(described) < 250
