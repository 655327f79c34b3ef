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
Find the files that a motion includes among given texts, instead of on the disk.

Tested by test/files/test_included_texts.py.
"""

from __future__ import annotations

from collections.abc import Mapping

from kachaka_simple_control.files.document import is_path, Problem, UnreadableFileError
from kachaka_simple_control.files.motion_file import included_key
from kachaka_simple_control.files.motion_reader import find_included, Finder


def find_among(texts: Mapping[str, str]) -> Finder:
    """
    Return a finder of files whose texts are given, and of motions of the package.

    :param texts: the texts by key, as in ``MotionFile.included_texts``
    """
    def find(source: str, name_or_path: str) -> tuple[str, str]:
        key = included_key(source, name_or_path)
        if key in texts:
            return key, texts[key]
        if is_path(name_or_path):
            raise UnreadableFileError(Problem('the text of this file was not given'))
        return find_included(source, name_or_path)
    return find
