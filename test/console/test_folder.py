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
"""The folder of the console: its own files, and no others."""

from __future__ import annotations

import os
from pathlib import Path

from kachaka_simple_control.console.folder import (
    FileExistsInFolderError,
    Folder,
    FolderError,
    MAX_TEXT,
)
from kachaka_simple_control.console.page_protocol import Motion
import pytest

pytestmark = pytest.mark.needs('yaml', 'jsonschema')

TEXT = 'steps:\n  - wait: 1 s\n'
#: Names that lead out of the folder, or mean something to a shell, a page or the system.
BAD_NAMES = (
    '', '.yaml', '..yaml', '../x.yaml', '/etc/x.yaml', 'a/b.yaml', 'x.yml', 'x.yaml\n', 'x.yaml/',
    '-x.yaml', '.x.yaml', 'a b.yaml', 'ä.yaml', 'x\0.yaml', '<b>.yaml', 'x' * 200 + '.yaml',
    'x.YAML', '\\x.yaml', 'no_motion')


def names_in(path: Path) -> list[str]:
    return sorted(entry.name for entry in path.iterdir())


@pytest.fixture(name='place')
def _place(tmp_path: Path):
    (tmp_path / 'in').mkdir()
    folder = Folder(str(tmp_path / 'in'))
    yield folder, tmp_path / 'in'
    folder.close()


def test_a_file_is_read_as_it_was_written(place: tuple[Folder, Path]):
    folder, path = place
    folder.write('mine.yaml', TEXT + '# \u20ac\n', False)
    assert TEXT + '# \u20ac\n' == folder.read('mine.yaml')
    assert Motion('mine.yaml', True) == folder.motions()[-1]
    assert ['mine.yaml'] == names_in(path)


def test_a_file_is_replaced_only_on_demand(place: tuple[Folder, Path]):
    folder, path = place
    folder.write('mine.yaml', TEXT, False)
    with pytest.raises(FileExistsInFolderError, match='mine.yaml exists'):
        folder.write('mine.yaml', 'other', False)
    assert TEXT == folder.read('mine.yaml')
    folder.write('mine.yaml', 'other', True)
    assert 'other' == folder.read('mine.yaml')
    assert ['mine.yaml'] == names_in(path)


@pytest.mark.parametrize('name', BAD_NAMES)
def test_no_other_name_is_read_or_written(place: tuple[Folder, Path], name: str):
    folder, path = place
    (path.parent / 'x.yaml').write_text('secret')
    with pytest.raises(FolderError):
        folder.read(name)
    with pytest.raises(FolderError):
        folder.write(name, TEXT, True)
    assert [] == names_in(path)
    assert 'secret' == (path.parent / 'x.yaml').read_text()


def test_no_link_is_followed(place: tuple[Folder, Path]):
    folder, path = place
    outside = path.parent / 'secret.yaml'
    outside.write_text('secret')
    (path / 'link.yaml').symlink_to(outside)
    with pytest.raises(FolderError):
        folder.read('link.yaml')
    for may_overwrite in (False, True):
        with pytest.raises(FolderError):
            folder.write('link.yaml', TEXT, may_overwrite)
    assert 'secret' == outside.read_text()
    assert not [motion for motion in folder.motions() if motion.is_file]


def test_what_is_no_plain_text_file_is_refused(place: tuple[Folder, Path]):
    folder, path = place
    os.mkfifo(path / 'pipe.yaml')
    (path / 'folder.yaml').mkdir()
    (path / 'bytes.yaml').write_bytes(b'\xff\xfe')
    (path / 'long.yaml').write_text('x' * (MAX_TEXT + 1))
    for name in ('pipe.yaml', 'folder.yaml', 'bytes.yaml', 'long.yaml', 'absent.yaml'):
        with pytest.raises(FolderError):
            folder.read(name)
    for name in ('pipe.yaml', 'folder.yaml'):
        with pytest.raises(FolderError):
            folder.write(name, TEXT, True)
    with pytest.raises(FolderError, match='more than'):
        folder.write('new.yaml', 'x' * (MAX_TEXT + 1), False)


def test_motions_of_the_package_are_read_by_name(place: tuple[Folder, Path]):
    folder, _ = place
    for motion in folder.motions():
        assert 'steps:' in folder.read(motion.name)


def test_without_a_folder_nothing_is_written():
    folder = Folder(None)
    assert folder.name is None
    assert 'steps:' in folder.read('square')
    with pytest.raises(FolderError, match='--folder'):
        folder.write('mine.yaml', TEXT, False)
    with pytest.raises(FolderError, match='--folder'):
        folder.read('mine.yaml')


def test_a_folder_that_is_not_there_is_named():
    with pytest.raises(FolderError, match="'/nowhere' cannot be opened"):
        Folder('/nowhere')
