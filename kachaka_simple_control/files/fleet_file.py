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
Read a fleet from a YAML file: its robots, what each drives, and where each begins.

Each motion and each profile is read from its own file, at the path that the fleet's file gives.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
import os
from pathlib import PurePath
import re

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.files.document import (
    beside,
    Document,
    FileError,
    KeyPath,
    Node,
    parse_path,
    Problem,
    read_schema,
    UnreadableFileError,
)
from kachaka_simple_control.files.library import find, text_of
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.motion_reader import read_all_parameters
from kachaka_simple_control.files.parameters import assign
from kachaka_simple_control.files.robot_profile import find_robot, KACHAKA, RobotProfile
from kachaka_simple_control.files.schema_check import Schema
from kachaka_simple_control.files.yaml_document import look_up, names_in, read_document
from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.motion.units import (
    ANGLE,
    FREQUENCY,
    LENGTH,
    QUANTITIES,
    TOLERANCE,
)
from kachaka_simple_control.text import location, pluralize

SCHEMA = 'fleets/fleet.schema.json'
#: The largest number of robots: a guardian stops no more.
MAX_ROBOTS = 255
#: How near the outlines of two robots may come, unless the file says [m].
DEFAULT_MARGIN = 0.1
#: A name of a robot, which is also its namespace: the names of ROS have no double underscore.
_NAME = re.compile('(?!.*__)[A-Za-z_][A-Za-z0-9_]*')


@cache
def fleet_schema() -> Schema:
    """Return the JSON Schema of a fleet's file, without what the written one has for editors."""
    schema = read_schema(SCHEMA)
    robot = {key: part for key, part in schema['definitions']['robot'].items() if key != 'allOf'}
    return {**schema, 'definitions': {**schema['definitions'], 'robot': robot}}


class FleetFileError(FileError, UsageError):
    """A fleet cannot be read from a file, or cannot be driven as the file says."""


@dataclass(frozen=True)
class FleetRobot:
    """
    One robot of a fleet.

    :param name: its key in the file, which is also its ROS namespace
    :param start: where it stands at t = 0, in the frame of the floor that all robots share
    :param robot: the name or the path of its profile
    :param rate: how often a velocity is sent [Hz]; None if no file says
    :param simulation: the errors of the simulated robot, in SI units, by the names of the fields
        of ``SimulationParameters``
    """

    name: str
    motion_file: MotionFile
    robot: str
    profile: RobotProfile
    start: Pose
    rate: float | None
    simulation: Mapping[str, float] = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class FleetFile:
    """
    A fleet as its file describes it.

    :param robots: in the order of the file, at least one
    :param repeat: how often they drive their motions
    :param goes_on: whether the others drive on after a fault of one
    :param margin: how near the outlines of two robots may come [m]
    :param root: the values of the file, with their line numbers; None if there is no file
    """

    name: str
    description: str
    robots: tuple[FleetRobot, ...]
    repeat: int = 1
    goes_on: bool = False
    margin: float = DEFAULT_MARGIN
    source: str = ''
    root: Node | None = field(default=None, repr=False, compare=False)
    text: str = field(default='', repr=False, compare=False)

    def where(self, path: str) -> str:
        """Return file name and line of a value, as in ``minuet.yaml:4`` for ``robots.r1``."""
        return location(self.source, self._line(path))

    def has(self, path: str) -> bool:
        """Return whether the file gives a value, as in ``robots.r1.rate``."""
        parts = parse_path(path)
        return self.root is not None and len(self.root.along(parts)) > len(parts)

    def error(
            self, problems: Mapping[str, str] | Iterable[tuple[str, str]]) -> FleetFileError:
        """Return an error about values of the file: a line for each path and text."""
        pairs = problems.items() if isinstance(problems, Mapping) else problems
        return FleetFileError(self.source, [
            Problem(text, self._line(path), path) for path, text in pairs])

    def _line(self, path: str) -> int | None:
        return None if self.root is None else self.root.at(parse_path(path)).line


def fleets() -> list[str]:
    """Return the names of the fleets that come with the package, in alphabetical order."""
    return names_in('fleets')


def find_fleet(name_or_path: str | os.PathLike[str]) -> FleetFile:
    """
    Read a fleet by its name or by the path of its file.

    :param name_or_path: a text without dots and slashes is the name of one of the package
    :raises FleetFileError: if there is no such fleet, its file is invalid, or a robot cannot
        drive its motion; a line for each problem
    """
    with FleetFileError.naming(os.fspath(name_or_path)):
        source, text = look_up(name_or_path, 'fleets', fleets())
    return read_fleet(text, source)


def read_fleet(text: str, source: str) -> FleetFile:
    """
    Read a fleet from the text of its file; paths in it begin at the folder of the file.

    :raises FleetFileError: if the text is no valid fleet; a line for each problem
    """
    with FleetFileError.naming(source):
        document = read_document(text, fleet_schema())
        data = document.root.data if isinstance(document.root.data, dict) else {}
        found = data.get('robots')
        names = [*found] if isinstance(found, dict) else []
        if len(names) > MAX_ROBOTS:
            document.add_problem(['robots'], count_problem(len(names)))
            names = []
        robots = [_read_robot(document, str(name), source) for name in names]
        margin = document.read_quantities([], {'margin': TOLERANCE}).get('margin', DEFAULT_MARGIN)
        if document.problems:
            raise UnreadableFileError(*document.problems)
    return FleetFile(
        data.get('name', PurePath(source).stem), data.get('description', ''),
        tuple(robot for robot in robots if robot is not None), data.get('repeat', 1),
        data.get('on_fault') == 'go_on', margin, source, document.root, text)


def count_problem(count: int) -> str:
    """Return why a fleet cannot have this number of robots; empty if it can."""
    return '' if 1 <= count <= MAX_ROBOTS else (
        f'{pluralize(count, "robot")}; a fleet has from 1 to {MAX_ROBOTS}')


def name_problem(name: str) -> str:
    """Return why a robot cannot have a name; empty if it can."""
    return '' if _NAME.fullmatch(name) else (
        'this is no ROS namespace: a name has letters, digits and single underscores, and begins '
        'with no digit')


def _read_robot(document: Document, name: str, source: str) -> FleetRobot | None:
    path: KeyPath = ['robots', name]
    if text := name_problem(name):
        document.add_problem(path, text)
    start = document.read_quantities(
        [*path, 'start'], {'x': LENGTH, 'y': LENGTH, 'heading': ANGLE})
    rates = document.read_quantities(path, {'rate': FREQUENCY})
    simulation = _read_simulation(document, [*path, 'simulation'])
    if document.root.at(path).has_problem:
        return None
    motion_file = _read_motion(document, path, source)
    if motion_file is None:
        return None
    data = document.root.at(path).data
    robot = beside(source, data['robot']) if 'robot' in data else (
        motion_file.robot or KACHAKA.name)
    key = 'robot' if 'robot' in data else 'motion'
    try:
        profile = find_robot(robot)
    except FileError as error:
        _add_errors(document, [*path, key], error)
        return None
    return FleetRobot(
        name, motion_file, robot, profile,
        Pose(start.get('x', 0.0), start.get('y', 0.0), start.get('heading', 0.0)),
        rates.get('rate', motion_file.rate), simulation)


def _read_motion(document: Document, path: KeyPath, source: str) -> MotionFile | None:
    """Return the motion of a robot, with its values; None if it has problems, now recorded."""
    data = document.root.at(path).data
    name = beside(source, data['motion'])
    # As text, so that a number without a unit is not taken for one in SI units.
    given = {str(key): str(value) for key, value in data.get('with', {}).items()}
    try:
        return find(name, **given)
    except FileError as error:
        known = _add_value_problems(document, path, name, given)
        _add_errors(document, [*path, 'motion'], error, known)
    return None


def _add_value_problems(
        document: Document, path: KeyPath, name: str, given: Mapping[str, str]) -> set[str]:
    """Record what is wrong with the values of a motion; return the texts."""
    try:
        source, text, kept = text_of(name)
    except UnreadableFileError:
        return set()
    parameters = {parameter.name: parameter for parameter in read_all_parameters(text)}
    _, problems = assign(parameters, {**kept, **given})
    for key, problem in problems.items():
        where = f' ({location(source, parameters[key].line)})' if key in parameters else ''
        if key in given:
            document.add_problem([*path, 'with', key], f'{problem}{where}')
        else:
            document.add_problem([*path, 'with'], f'{key!r} is missing: {problem}{where}')
    return set(problems.values())


def _read_simulation(document: Document, path: KeyPath) -> dict[str, float]:
    nodes = document.root.along(path)
    if len(nodes) <= len(path) or not isinstance(nodes[-1].data, dict):
        return {}
    known = read_schema(SCHEMA)['definitions']['robot']['properties']['simulation']['properties']
    quantities = {key: QUANTITIES[schema['quantity']] for key, schema in known.items()
                  if 'quantity' in schema}
    ratios = {key: float(value) for key, value in nodes[-1].data.items()
              if key not in quantities and not nodes[-1].children[key].has_problem}
    return {**ratios, **document.read_quantities(path, quantities)}


def _add_errors(
        document: Document, path: KeyPath, error: FileError, known: Container[str] = ()) -> None:
    """Report each problem of another file, whose text is not known, at the line that names it."""
    for problem in error.problems:
        if problem.text not in known:
            document.add_problem(path, problem.describe(error.source))
