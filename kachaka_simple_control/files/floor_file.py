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
Read a floor for simulated robots from a YAML file: what stands on it, and what a laser is like.

Tested by test/files/test_floor_file.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
import math
import os
from pathlib import PurePath
from typing import Any, TypeVar

from kachaka_simple_control.errors import InvalidMotionError, UsageError
from kachaka_simple_control.files.document import (
    Document,
    FileError,
    KeyPath,
    read_schema,
    UnreadableFileError,
)
from kachaka_simple_control.motion.floor import Floor, Person, Post, require_wall, Wall
from kachaka_simple_control.motion.geometry import Point
from kachaka_simple_control.motion.units import (
    ANGLE,
    FREQUENCY,
    LENGTH,
    Quantity,
    require_between,
    SIZE,
    TIME,
    TOLERANCE,
)

SCHEMA = 'floors/floor.schema.json'
#: How often a simulated robot publishes at most, and so its laser [Hz].
MAX_LASER_RATE = 50.0
MIN_POINTS, MAX_POINTS = 4, 10_000
#: The keys of values that have another name in Python.
KEYS = {'begin': 'from', 'end': 'until'}
T = TypeVar('T')


class FloorFileError(FileError, UsageError):
    """A floor cannot be read from a file."""


@dataclass(frozen=True)
class LaserParameters:
    """
    The properties of a simulated Kachaka's laser; all of them are assumed.

    :param rate: of its scans [Hz]
    :param points: how many ranges a scan has, at times one less
    :param view: how much it sees around the robot, half of it on each side of ahead [rad]
    :param range: how far it sees [m]
    :param noise: standard deviation of a range [m]
    :param holes: which part of the ranges says nothing, from 0 to 1
    :param off_after: how long after the robot has come to rest it turns off [s]
    :raises InvalidMotionError: if a value is out of its range
    """

    rate: float = 10.0
    points: int = 360
    view: float = math.radians(270.0)
    range: float = 8.0  # noqa: A003
    noise: float = 0.01
    holes: float = 0.03
    off_after: float = 5.0

    def __post_init__(self) -> None:
        """Check each value."""
        require_between('rate', self.rate, 0.1, MAX_LASER_RATE, 'Hz')
        require_between('points', self.points, MIN_POINTS, MAX_POINTS)
        if not 0.0 < self.view <= math.tau * (1.0 + 1e-9):
            raise InvalidMotionError(
                f'{math.degrees(self.view):g} deg; it must be above 0 deg, and 360 deg at most',
                name='view')
        SIZE.require('range', self.range)
        TOLERANCE.require('noise', self.noise)
        require_between('holes', self.holes, 0.0, 1.0)
        TIME.require('off_after', self.off_after)

    @property
    def period(self) -> float:
        """Return the time between two scans [s]."""
        return 1.0 / self.rate


@dataclass(frozen=True)
class FloorFile:
    """
    A floor as its file describes it.

    :param floor: seen from where the robot starts; of a fleet, in the frame of its start poses
    :param source: the path of the file
    """

    name: str
    description: str
    floor: Floor
    laser: LaserParameters
    source: str = ''
    text: str = field(default='', repr=False, compare=False)


def floors() -> list[str]:
    """Return the names of the floors that come with the package, in alphabetical order."""
    from kachaka_simple_control.files.yaml_document import names_in
    return names_in('floors')


def find_floor(name_or_path: str | os.PathLike[str]) -> FloorFile:
    """
    Read a floor by its name or by the path of its file.

    :param name_or_path: a text without dots and slashes is the name of one of the package
    :raises FloorFileError: if there is no such floor, or its file is invalid; a line for each
        problem
    """
    # Import here: this module loads slowly, and simulated robots without a floor do not need it.
    from kachaka_simple_control.files.yaml_document import look_up
    with FloorFileError.naming(os.fspath(name_or_path)):
        source, text = look_up(name_or_path, 'floors', floors())
    return read_floor(text, source)


def read_floor(text: str, source: str) -> FloorFile:
    """
    Read a floor from the text of its file.

    :raises FloorFileError: if the text is no valid floor; a line for each problem
    """
    from kachaka_simple_control.files.yaml_document import read_document
    with FloorFileError.naming(source):
        document = read_document(text, read_schema(SCHEMA))
        walls = _read_list(document, 'walls', _read_wall)
        posts = _read_list(document, 'posts', _read_post)
        people = _read_list(document, 'people', _read_person)
        laser = _make(document, ['laser'], lambda: _read_laser(document))
        floor = None if document.problems else _make(
            document, [], lambda: Floor(tuple(walls), tuple(posts), tuple(people)))
        if floor is None or laser is None or document.problems:
            raise UnreadableFileError(*document.problems)
    data = document.root.data
    return FloorFile(
        data.get('name', PurePath(source).stem), data.get('description', ''), floor, laser,
        source, text)


def _read_list(
        document: Document, key: str, read: Callable[[Document, KeyPath], T | None]) -> list[T]:
    """Read each item of a list of the file whose values are what the schema wants."""
    path: KeyPath = [key]
    nodes = document.root.along(path)
    if len(nodes) <= len(path) or not isinstance(nodes[-1].data, list):
        return []
    items = (read(document, [key, index]) for index, node in nodes[-1].children.items()
             if not node.has_problem)
    return [item for item in items if item is not None]


def _make(document: Document, path: KeyPath, make: Callable[[], T]) -> T | None:
    """Return what a function makes; None, and a problem, if a value is out of its range."""
    try:
        return make()
    except InvalidMotionError as error:
        name = error.name or ''
        document.add_error(path, InvalidMotionError(error.message, name=KEYS.get(name, name)))
        return None


def _read_wall(document: Document, path: KeyPath) -> Wall | None:
    points = [_read_point(document, [*path, index])
              for index in range(len(document.root.at(path).data))]
    wall = tuple(point for point in points if point is not None)

    def check() -> Wall:
        require_wall('', wall)
        return wall
    return _make(document, path, check) if len(wall) == len(points) else None


def _read_post(document: Document, path: KeyPath) -> Post | None:
    values = _read_values(document, path, ('at',), {'radius': SIZE})
    return None if values is None else _make(document, path, lambda: Post(**values))


def _read_person(document: Document, path: KeyPath) -> Person | None:
    values = _read_values(
        document, path, ('at', 'to'), {'radius': SIZE, 'from': TIME, 'until': TIME})
    if values is None:
        return None
    names = {KEYS.get(name, name): name for name in ('at', 'radius', 'begin', 'end', 'to')}
    return _make(document, path, lambda: Person(
        **{names[key]: value for key, value in values.items()}))


def _read_laser(document: Document) -> LaserParameters:
    path: KeyPath = ['laser']
    nodes = document.root.along(path)
    if len(nodes) <= len(path) or nodes[-1].has_problem:
        return LaserParameters()
    numbers = document.read_quantities(path, {
        'rate': FREQUENCY, 'view': ANGLE, 'range': SIZE, 'noise': TOLERANCE, 'off_after': TIME})
    others: dict[str, Any] = {
        key: nodes[-1].data[key] for key in ('points', 'holes') if key in nodes[-1].data}
    return LaserParameters(**{**others, **numbers})


def _read_values(
        document: Document, path: KeyPath, points: tuple[str, ...],
        quantities: dict[str, Quantity]) -> dict[str, Any] | None:
    """Read points and numbers of a mapping; None after a problem with one of them."""
    node = document.root.at(path)
    values: dict[str, Any] = {
        key: _read_point(document, [*path, key]) for key in points if key in node.children}
    values.update(document.read_quantities(path, quantities))
    return None if node.has_problem else values


def _read_point(document: Document, path: KeyPath) -> Point | None:
    x, y = (document.read_quantity([*path, index], LENGTH) for index in range(2))
    return None if x is None or y is None else (x, y)
