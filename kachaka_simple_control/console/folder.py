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
"""List, read and write the motion files of one folder, and nothing outside of it."""

from __future__ import annotations

import contextlib
from importlib.resources import files
import os
from pathlib import Path, PurePath
import re
import secrets
import stat

from kachaka_simple_control.console.page_protocol import Motion
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.files.document import PACKAGE
from kachaka_simple_control.files.library import LESSON, lesson_motion, library
from kachaka_simple_control.files.messages import MAX_SIZE
from kachaka_simple_control.files.motion_writer import dump
from kachaka_simple_control.files.yaml_document import SUFFIX
from kachaka_simple_control.text import quoted

#: The name of a file: no folder, and no hidden file or option.
NAME = re.compile(r'[A-Za-z0-9_][A-Za-z0-9_.-]*[.]yaml')
MAX_NAME = 100
#: So many files are listed; no more are written.
MAX_FILES = 500
#: The longest text of a motion, so that it fits into a message, also escaped [bytes].
MAX_TEXT = MAX_SIZE - 4000


def file_name(name: str | None) -> str:
    """Return the name that a page gives a text, without a folder; ``motion.yaml`` for none."""
    return PurePath(name or '').name or 'motion.yaml'


class FolderError(ControlError):
    """A file cannot be read or written; the text says why."""


class FileExistsInFolderError(FolderError):
    """A file exists, and the user has not agreed to replace it."""


class Folder:
    """
    A folder with motion files, and the motions of the package.

    A link in the folder is not followed, because it could lead to any file of the user.

    :param path: the folder; None to offer the motions of the package only
    :raises FolderError: if the folder cannot be opened
    """

    def __init__(self, path: str | None) -> None:
        self.name = None if path is None else Path(path).resolve().name or '/'
        self._folder: int | None = None
        if path is not None:
            try:
                # Kept open: all names are looked up in this folder, even if it is moved.
                self._folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            except OSError as error:
                raise FolderError(
                    f'the folder {quoted(path, 200)} cannot be opened: {error.strerror}') from None

    @property
    def handle(self) -> int | None:
        """Return the file descriptor of the folder; None without a folder."""
        return self._folder

    def close(self) -> None:
        """Close the folder."""
        if self._folder is not None:
            os.close(self._folder)
            self._folder = None

    def motions(self) -> tuple[Motion, ...]:
        """Return the motions of the package and the files of the folder, each sorted by name."""
        own = [Motion(name, True) for name in self._names()[:MAX_FILES]]
        return (*(Motion(name, False) for name in library()), *own)

    def read(self, name: str) -> str:
        """
        Return the text of a motion.

        :raises FolderError: if there is no such motion, or it cannot be read
        """
        if name == LESSON:
            return dump(lesson_motion())
        if name in library():
            return (files(PACKAGE) / 'motions' / (name + SUFFIX)).read_text('utf-8')
        folder = self._checked(name)
        try:
            # Not blocking: the file could be a pipe.
            handle = os.open(
                name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, dir_fd=folder)
        except OSError as error:
            raise FolderError(f'{name} cannot be read: {error.strerror}') from None
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            os.close(handle)
            raise FolderError(f'{name} is no file')
        with os.fdopen(handle, 'rb') as stream:
            data = stream.read(MAX_TEXT + 1)
        if len(data) > MAX_TEXT:
            raise FolderError(f'{name} has more than {MAX_TEXT} bytes')
        try:
            return data.decode('utf-8-sig')
        except UnicodeDecodeError:
            raise FolderError(f'{name} is no text in UTF-8') from None

    def write(self, name: str, text: str, may_overwrite: bool) -> None:
        """
        Write a file of the folder, completely or not at all.

        :param may_overwrite: whether an existing file may be replaced
        :raises FileExistsInFolderError: if the file exists and may not be replaced
        :raises FolderError: if the name is invalid, or the file cannot be written
        """
        folder = self._checked(name)
        data = text.encode('utf-8')
        if len(data) > MAX_TEXT:
            raise FolderError(f'{name} would have more than {MAX_TEXT} bytes')
        names = self._names()
        if name not in names and len(names) >= MAX_FILES:
            raise FolderError(f'the folder has {len(names)} files; no more are written')
        draft = f'.{name}.{secrets.token_hex(4)}'
        try:
            self._check_target(folder, name, may_overwrite)
            handle = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
                             | os.O_CLOEXEC, 0o644, dir_fd=folder)
            with os.fdopen(handle, 'wb') as stream:
                stream.write(data)
                stream.flush()
                os.fsync(handle)
            if may_overwrite:
                os.replace(draft, name, src_dir_fd=folder, dst_dir_fd=folder)
            else:
                # Unlike a rename, a link never replaces a file that has come in between.
                os.link(draft, name, src_dir_fd=folder, dst_dir_fd=folder)
        except FileExistsError:
            raise FileExistsInFolderError(f'{name} exists') from None
        except OSError as error:
            raise FolderError(f'{name} cannot be written: {error.strerror}') from None
        finally:
            with contextlib.suppress(OSError):
                os.unlink(draft, dir_fd=folder)

    def _check_target(self, folder: int, name: str, may_overwrite: bool) -> None:
        try:
            mode = os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode
        except FileNotFoundError:
            return
        if not stat.S_ISREG(mode):
            raise FolderError(f'{name} exists and is no file')
        if not may_overwrite:
            raise FileExistsInFolderError(f'{name} exists')

    def _checked(self, name: str) -> int:
        if self._folder is None:
            raise FolderError('no folder was chosen; start the console with --folder')
        if not NAME.fullmatch(name) or len(name) > MAX_NAME:
            raise FolderError(
                f'{quoted(name, MAX_NAME)} is no file name here; use letters, digits, _ . - and '
                f'{SUFFIX} at the end')
        return self._folder

    def _names(self) -> list[str]:
        if self._folder is None:
            return []
        with os.scandir(self._folder) as entries:
            return sorted(
                entry.name for entry in entries
                if NAME.fullmatch(entry.name) and len(entry.name) <= MAX_NAME
                and entry.is_file(follow_symlinks=False))
