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
"""Files that are large, deep, endless or no files: one clear line, quickly, in little memory."""

from __future__ import annotations

import os
import time

from kachaka_simple_control.files.document import MotionFileError
from kachaka_simple_control.files.motion_reader import load
from motion_texts import refusal
from optional_libraries import MISSING, optional_imports
import pytest

yaml = MISSING
with optional_imports():
    import yaml

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

MEGABYTE = 1_000_000
LAUGHS = 'a: &a [x]\n' + ''.join(
    f'{two}: &{two} [*{one},*{one}]\n' for one, two in zip('abcdefghijkl', 'bcdefghijklm'))
HOSTILE = {
    'a list in a list in a list': '[' * MEGABYTE,
    'the same, in the style of blocks': '- ' * (MEGABYTE // 2),
    'keys in keys': '{a: ' * (MEGABYTE // 4),
    'keys of keys': '? ' * (MEGABYTE // 2),
    'too many steps': 'steps:\n' + '- wait: 0\n' * 99_000,
    'too many empty lists': '[' + '[],' * 300_000 + ']',
    'too many bad steps': 'steps:\n' + '- wiat: 0\n' * 33_000,
    'too many bad keys': ''.join(f'key{index}: 0\n' for index in range(45_000)),
    'too many keys alike': 'a: 1\n' * 190_000,
    'a laugh doubled and doubled': LAUGHS,
    'anchors': '[' + '&a b, ' * 150_000 + ']',
    'aliases': '[' + '*a, ' * 200_000 + ']',
    'a tag without an end': 'a: !' + 'a' * 900_000 + ' b',
    'a key without an end': 'a' * 990_000 + ': 1',
    'a number without an end': 'steps:\n- wait: ' + '9' * 900_000,
    'a number in quotes without an end': 'steps:\n- wait: "' + '9' * 900_000 + ' m"',
    'decimal commas in braces': 'steps: [' + '{wait: 1,5}, ' * 70_000 + ']',
    'one of them without an end': '{wait: 1,' + '9' * 900_000 + '}',
    'spaces before a unit': 'steps:\n- wait: "1' + ' ' * 900_000 + 'x"',
    'documents': '---\n' * 250_000,
    'quotes': '"' * MEGABYTE,
    'nothing': '\n' * MEGABYTE,
    'a sum of ten thousand': 'steps:\n- forward: ' + ' + '.join(['1 m'] * 10_000),
    'signs': 'steps:\n- forward: "' + '$' * 900_000 + '"',
    'digits of an expression': 'steps:\n- forward: "' + '1' * 900_000 + '$"',
    'spaces of an expression': 'steps:\n- forward: "1 m' + ' ' * 900_000 + '$"',
    'many products': 'parameters: {a: 1e90}\nsteps:\n' + (
        '- forward: 1 m *' + '*'.join(['$a'] * 300) + '\n') * 900,
    'many sums': 'parameters: {a: 1 m}\nsteps:\n' + '- forward: $a * 2 + 0.1 s\n' * 33_000,
    'a thousand million repeats': 'parameters: {a: 1e6}\nsteps: [' + (
        '{repeat: {times: $a * 1000, steps: [' * 20) + '{wait: 0}' + ']}}' * 20 + ']',
    'repeats in repeats': 'steps: [' + '{repeat: {times: 1000000, steps: [' * 20 + (
        '{wait: 0}' + ']}}' * 20) + ']',
    'parameters': 'parameters:\n' + ''.join(
        f'  a{index}: 1 m\n' for index in range(60_000)) + 'steps: []',
    'includes of what is not there': 'steps:\n' + '- include: ./none.yaml\n' * 30_000,
}


@pytest.mark.slow
@pytest.mark.skipif(
    not getattr(yaml, '__with_libyaml__', False),
    reason='without libyaml, which Ubuntu has, it takes longer')
@pytest.mark.parametrize('what', HOSTILE)
def test_a_hostile_text_is_refused_quickly(what):
    begin = time.process_time()
    lines = refusal(HOSTILE[what])
    # Enough for a slow machine, but not for work that grows faster than the text.
    assert time.process_time() - begin < 10.0
    assert len(lines) <= 21
    assert all(line.startswith('bad.yaml') and len(line) < 400 for line in lines)


@pytest.mark.parametrize('what', ['too many bad steps', 'too many bad keys'])
def test_after_many_problems_the_rest_is_not_checked(what):
    assert refusal(HOSTILE[what])[-1] == 'bad.yaml: and many more'


@pytest.mark.parametrize('data, line', [
    (b'steps: []'.ljust(MEGABYTE + 1), 'this is more than 1000000 bytes, the most that is read'),
    ('steps: []'.encode('utf-16'), 'this is text in UTF-16; save it as UTF-8'),
    ('steps: []'.encode('utf-16-le'),
     '1: U+0000 cannot be in a text; is this one, saved as UTF-8?'),
    ('steps: []\nname: Zoë'.encode('latin-1'),
     '2: byte 0xeb is not UTF-8; is this a text, saved as UTF-8?'),
    (b'\x89PNG\r\n\x1a\n\0\0', '1: byte 0x89 is not UTF-8; is this a text, saved as UTF-8?'),
    (b'steps: []\n\x1b[31m', '2: U+001B cannot be in a text; is this one, saved as UTF-8?'),
    ('steps: []\u2028name: a'.encode(),
     '1: U+2028 cannot be in a text; is this one, saved as UTF-8?'),
    (b'', 'the file is empty'),
    (b'\xef\xbb\xbf', 'the file is empty'),
])
def test_what_is_no_text_is_refused(tmp_path, data, line):
    path = tmp_path / 'bad.yaml'
    path.write_bytes(data)
    with pytest.raises(MotionFileError) as caught:
        load(path)
    assert str(caught.value) == f'{path}:{"" if line[0].isdigit() else " "}{line}'


@pytest.mark.parametrize('text, line', [
    ('steps:\n  - forward: 0.5 m\n\t- turn: 90 deg\n',
     '3: this is not YAML: a tab indents this line; indent with spaces'),
    ('steps:\n  - forward: 0.5 m\n  \t- turn: 90 deg\n',
     '3: this is not YAML: a tab indents this line; indent with spaces'),
    ('steps:\n\t- forward: 0.5 m\n',
     '2: this is not YAML: a tab indents this line; indent with spaces'),
    ("steps:\n  - forward: '0.5 m\n", '2: this is not YAML: close the quote that begins here'),
    ('steps:\n  - forward: "0.5 m\n  - turn: 90 deg\n',
     '2: this is not YAML: close the quote that begins here'),
    ('# my square\n# one metre\n',
     "1: 'steps' is missing: a list of steps, each beginning with '- '"),
])
@pytest.mark.parametrize('loader', ['CSafeLoader', 'SafeLoader'])
def test_a_mistake_of_a_beginner_is_named_at_its_line(monkeypatch, text, line, loader):
    monkeypatch.setattr(yaml, 'CSafeLoader', getattr(yaml, loader, yaml.SafeLoader), raising=False)
    assert refusal(text) == [f'bad.yaml:{line}']


def refused(path: str | os.PathLike[str]) -> str:
    """Return the error of a path, and assert that reading it does not wait."""
    begin = time.monotonic()
    with pytest.raises(MotionFileError) as caught:
        load(path)
    assert time.monotonic() - begin < 2.0
    return str(caught.value)


def test_what_is_no_file_is_refused_without_waiting(tmp_path):
    pipe = tmp_path / 'pipe.yaml'
    os.mkfifo(pipe)
    assert refused(pipe) == f'{pipe}: this is a device or a pipe, not a file'
    assert refused('/dev/zero') == '/dev/zero: this is a device or a pipe, not a file'
    assert refused(tmp_path) == f'{tmp_path}: this is a folder; name a file in it'
    missing = tmp_path / 'missing.yaml'
    assert refused(missing) == f'{missing}: there is no such file'
    assert refused(missing / 'b.yaml') == f'{missing}/b.yaml: there is no such file'
    missing.symlink_to(missing)
    assert 'it cannot be read: ' in refused(missing)
    assert refused('a\0.yaml') == r"'a\x00.yaml': no file can have this name"
    assert 'it cannot be read: ' in refused('a' * 300 + '.yaml')


def test_an_unreadable_file_is_refused(tmp_path, monkeypatch):
    path = tmp_path / 'secret.yaml'
    path.touch(mode=0)
    if os.geteuid() == 0:  # who may read everything
        def deny(*_: object) -> int:
            raise PermissionError(13, 'Permission denied')
        monkeypatch.setattr(os, 'open', deny)
    assert refused(path) == f'{path}: you are not allowed to read this file'
