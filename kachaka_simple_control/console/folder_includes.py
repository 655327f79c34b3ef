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
Read the files that a text of a page includes, in the folder of the console and nowhere else.

Tested by test/console/test_plan_preview.py.
"""

from __future__ import annotations

import json

from kachaka_simple_control.console.folder import Folder, FolderError, MAX_TEXT, NAME
from kachaka_simple_control.files.document import is_path, Problem, UnreadableFileError
from kachaka_simple_control.files.motion_file import included_key
from kachaka_simple_control.files.motion_reader import find_included


class FolderIncludes:
    """
    The files that one text includes.

    :ivar texts: those that were read, by name
    """

    def __init__(self, folder: Folder, text: str) -> None:
        self.texts: dict[str, str] = {}
        self._folder = folder
        #: how much more text fits into one message [bytes]
        self._room = MAX_TEXT - _size(text)

    def find(self, source: str, name_or_path: str) -> tuple[str, str]:
        """
        Find a motion of the package, or a file of the folder: a ``Finder``.

        :raises UnreadableFileError: if it is neither, or too large with the others
        """
        if not is_path(name_or_path):
            return find_included(source, name_or_path)
        file = included_key(source, name_or_path)
        if file not in self.texts:
            self.texts[file] = self._read(file)
        return file, self.texts[file]

    def _read(self, file: str) -> str:
        if not NAME.fullmatch(file):
            raise UnreadableFileError(Problem(
                'the console includes motions of the package and files of its folder alone, as in '
                './mine.yaml'))
        try:
            text = self._folder.read(file)
        except FolderError as error:
            raise UnreadableFileError(Problem(str(error))) from None
        size = _size(file) + _size(text)
        if size > self._room:
            raise UnreadableFileError(Problem(
                f'with this file the motion has more than {MAX_TEXT} bytes, which the console '
                'does not pass on'))
        self._room -= size
        return text


def _size(text: str) -> int:
    """Return how long a text is in a message [bytes]."""
    return len(json.dumps(text))
