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
"""The motions that come with the package, found by their names."""

from __future__ import annotations

from importlib.resources import files
import os

from kachaka_simple_control.files import lesson
from kachaka_simple_control.files.diagnostics import MotionFileError, Problem, UnreadableFileError
from kachaka_simple_control.files.motion_file import loads, MotionFile
from kachaka_simple_control.files.schema import nearest, PACKAGE
from kachaka_simple_control.files.yaml_document import decode, read_text

SUFFIX = '.yaml'


def library() -> list[str]:
    """Return the names of the motions that come with the package, in alphabetical order."""
    return sorted([*names_in('motions'), lesson.NAME])


def find(name_or_path: str | os.PathLike[str]) -> MotionFile:
    """
    Read a motion of the library by its name, or one of your own by its path.

    :param name_or_path: a word without a dot and a slash is a name, all else is a path
    :raises MotionFileError: if there is none, or it cannot be read
    """
    if name_or_path == lesson.NAME:
        return MotionFile(lesson.lesson(), str(lesson.SOURCE))
    try:
        source, text = look_up(name_or_path, 'motions', library())
    except UnreadableFileError as error:
        raise MotionFileError(os.fspath(name_or_path), error.problems) from None
    return loads(text, source)


def names_in(folder: str) -> list[str]:
    """Return the names of the YAML files in a folder of the package, without their suffix."""
    found = (entry.name for entry in files(PACKAGE).joinpath(folder).iterdir())
    return sorted(name.removesuffix(SUFFIX) for name in found if name.endswith(SUFFIX))


def look_up(
        name_or_path: str | os.PathLike[str], folder: str, known: list[str]) -> tuple[str, str]:
    """
    Return a file of the package by its name, or any other by its path.

    :param name_or_path: a word without a dot and a slash is a name, all else is a path
    :param folder: the folder of the package
    :param known: the names that an error suggests
    :returns: the file, as errors call it, and its text
    :raises UnreadableFileError: if there is none, or it cannot be read
    """
    name = os.fspath(name_or_path)
    if not isinstance(name_or_path, str) or set(name) & {'.', '/', os.sep}:
        return name, read_text(name)
    if name not in names_in(folder):
        near = nearest(name, known)
        raise UnreadableFileError(Problem(
            f'there is no {folder.removesuffix("s")} of this name'
            f'{f"; did you mean {near!r}?  Known are" if near else "; known are"} '
            f'{", ".join(known)}; a file of your own is named by its path, as in ./mine{SUFFIX}'))
    entry = files(PACKAGE) / folder / (name + SUFFIX)
    return str(entry), decode(entry.read_bytes())
