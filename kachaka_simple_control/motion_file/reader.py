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
"""Read motions from files."""

from __future__ import annotations

import os
from pathlib import PurePath
from types import MappingProxyType

from kachaka_simple_control.motion.steps import Motion
from kachaka_simple_control.motion.survey import MAX_STEPS
from kachaka_simple_control.motion_file.composer import compose
from kachaka_simple_control.motion_file.document import Document
from kachaka_simple_control.motion_file.motion_file import MotionFile
from kachaka_simple_control.motion_file.problems import MotionFileError, UnreadableFileError
from kachaka_simple_control.motion_file.quantities import LIMITS, read_quantities
from kachaka_simple_control.motion_file.schema import check
from kachaka_simple_control.motion_file.step_reader import count, read_steps
from kachaka_simple_control.motion_file.text import read_text, require_text
from kachaka_simple_control.motion_file.units import FREQUENCY

SCHEMA = 'motions/motion.schema.json'


def load(path: str | os.PathLike[str]) -> MotionFile:
    """
    Read a motion from a file.

    :param path: where the file is
    :returns: what is in it
    :raises MotionFileError: if it cannot be read, with a line for each thing that is wrong
    """
    source = os.fspath(path)
    try:
        text = read_text(source)
    except UnreadableFileError as error:
        raise MotionFileError(source, error.problems) from None
    return loads(text, source)


def loads(text: str, name: str = 'motion') -> MotionFile:
    """
    Read a motion from a text.

    :param text: what is in a file
    :param name: what errors call the file; a motion without a name of its own has its last part
    :returns: what is in it
    :raises MotionFileError: if it is no motion, with a line for each thing that is wrong
    """
    try:
        document = read_document(text, SCHEMA)
        file = _read(document, name)
    except UnreadableFileError as error:
        raise MotionFileError(name, error.problems) from None
    return file


def read_document(text: str, schema: str) -> Document:
    """
    Read YAML, and hold it against a schema.

    :param text: what is in a file
    :param schema: the schema's path in this package
    :returns: what is in the file, and what is wrong with it
    :raises UnreadableFileError: if it cannot be read at all
    """
    document = compose(require_text(text))
    check(document, schema)
    return document


def _read(document: Document, source: str) -> MotionFile:
    data = document.root.data if isinstance(document.root.data, dict) else {}
    steps = read_steps(document, ['steps'])
    limits = read_quantities(document, ['limits'], LIMITS)
    rate = read_quantities(document, [], {'rate': FREQUENCY}).get('rate')
    if count(steps) > MAX_STEPS:
        document.object_to(
            ['steps'], f'{count(steps)} steps, with all repeats; at most {MAX_STEPS} are read')
    if document.problems:
        raise UnreadableFileError(*document.problems)
    return MotionFile(
        motion=Motion(
            data.get('name', PurePath(source).stem), steps, data.get('description', '')),
        source=source, robot=data.get('robot'), limits=MappingProxyType(limits), rate=rate,
        root=document.root)
