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
"""Find robots by their names, and read profiles of robots from files."""

from __future__ import annotations

from collections.abc import Iterable
import math
import os
from pathlib import PurePath
from typing import TYPE_CHECKING

from kachaka_simple_control.errors import InvalidMotionError, UsageError
from kachaka_simple_control.files.diagnostics import (
    format_problems,
    Problem,
    sort_problems,
    UnreadableFileError,
)
from kachaka_simple_control.files.robot_profile import KACHAKA, RobotProfile
from kachaka_simple_control.motion.geometry import Box, Disc, Footprint
from kachaka_simple_control.motion.limits import LIMIT_QUANTITIES, Limits
from kachaka_simple_control.motion.units import COMMAND_TIMEOUT, LENGTH, SIZE

if TYPE_CHECKING:
    from kachaka_simple_control.files.document import Document

SCHEMA = 'robots/robot.schema.json'


class RobotFileError(UsageError):
    """
    A robot's profile could not be read from a file; the text has a line for each problem.

    :ivar source: the file
    :ivar problems: what is wrong with it, in the order of its lines
    """

    def __init__(self, source: str, problems: Iterable[Problem]) -> None:
        self.source = source
        self.problems = sort_problems(problems)
        super().__init__(format_problems(source, self.problems))


def robots() -> list[str]:
    """Return the names of the robots that the package knows, in alphabetical order."""
    from kachaka_simple_control.files.library import names_in
    return sorted([KACHAKA.name, *names_in('robots')])


def find_robot(name_or_path: str | os.PathLike[str]) -> RobotProfile:
    """
    Return a robot that the package knows by its name, or read one of your own by its path.

    :param name_or_path: a word without a dot and a slash is a name, all else is a path
    :raises RobotFileError: if there is none, or it cannot be read
    """
    if name_or_path == KACHAKA.name:
        return KACHAKA
    # Reading files takes long to import, which the lesson need not wait for.
    from kachaka_simple_control.files.library import look_up
    from kachaka_simple_control.files.schema import read_document, read_schema
    source = os.fspath(name_or_path)
    try:
        source, text = look_up(name_or_path, 'robots', robots())
        return _read(read_document(text, read_schema(SCHEMA)), source)
    except UnreadableFileError as error:
        raise RobotFileError(source, error.problems) from None


def _read(document: Document, source: str) -> RobotProfile:
    data = document.root.data if isinstance(document.root.data, dict) else {}
    hold = document.read_quantities([], {'hold': COMMAND_TIMEOUT})
    timeout = document.read_quantities(['manual_control'], {'timeout': COMMAND_TIMEOUT})
    limits = _limits(document)
    footprint = _footprint(document)
    if document.problems or limits is None:
        raise UnreadableFileError(*document.problems)
    return RobotProfile(
        name=data.get('name', PurePath(source).stem),
        namespace=data.get('namespace', '/'),
        velocity_topic=data['velocity_topic'],
        odometry_topic=data.get('odometry_topic'),
        manual_control_service=(data.get('manual_control') or {}).get('service'),
        manual_control_timeout=timeout.get('timeout', math.inf),
        hold=hold['hold'],
        limits=limits,
        message_type=data.get('message_type', 'Twist'),
        frame=data.get('frame', 'base_link'),
        footprint=footprint)


def _limits(document: Document) -> Limits | None:
    numbers = document.read_quantities(['limits'], LIMIT_QUANTITIES)
    if document.root.at(['limits']).has_problem or document.root.has_problem:
        return None
    try:
        return Limits(**numbers)
    except InvalidMotionError as error:
        document.add_error(['limits'], error)
        return None


def _footprint(document: Document) -> Footprint | None:
    node = document.root.children.get('footprint')
    if node is None or node.data is None:
        return None
    numbers = document.read_quantities(
        ['footprint'], {'length': SIZE, 'width': SIZE, 'ahead': LENGTH, 'radius': SIZE})
    if not node.has_problem:
        if set(numbers) == {'radius'}:
            return Disc(**numbers)
        if set(numbers) - {'ahead'} == {'length', 'width'}:
            return Box(**numbers)
        document.add_problem(['footprint'], 'it must be length and width, or radius alone')
    return None
