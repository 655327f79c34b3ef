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
The lines between the console and the drive process, version 1.

Each line is a JSON object with the keys ``v`` (1) and ``type``.  The console writes commands to
the standard input of the drive process; the drive process writes reports to its standard output.
The file ``protocol.schema.json`` describes the same lines for programs in other languages.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

from kachaka_simple_control.files.messages import (
    by_type,
    from_json,
    MAX_INTEGER,
    MAX_SIZE,
    Message,
    MessageError,
    Range,
    schema_of,
    to_json,
    VERSION,
)

__all__ = [
    'COMMANDS',
    'FLEET_COMMANDS',
    'MAX_SIZE',
    'REPORTS',
    'SCHEMA',
    'VERSION',
    'Alive',
    'Answer',
    'Command',
    'Fleet',
    'FleetState',
    'FleetStateName',
    'FloorMap',
    'FloorRobot',
    'FloorRobotState',
    'Hand',
    'Log',
    'MessageError',
    'MotionText',
    'Pause',
    'Release',
    'Report',
    'Request',
    'Resume',
    'Robot',
    'Run',
    'RunFleet',
    'Scan',
    'Sent',
    'Speed',
    'Stamp',
    'State',
    'StateName',
    'Stop',
    'Take',
    'Watch',
    'WatchName',
    'protocol_schema',
    'read_command',
    'read_report',
    'to_json',
    'write_line',
]

#: The path of the schema file in the package.
SCHEMA = 'console/protocol.schema.json'

#: The state of the drive process.
StateName = Literal[
    'standing by', 'taking', 'ready', 'driving by hand', 'driving', 'paused', 'stopping',
    'stopped', 'ended']
#: The state of a fleet as a whole: ``taking`` while its robots get ready for a drive.
FleetStateName = Literal[
    'standing by', 'taking', 'driving', 'paused', 'stopping', 'stopped', 'ended']
#: The state of a robot of a fleet: ``done`` after a complete drive, ``stopped`` after another.
FloorRobotState = Literal[
    'standing by', 'taking', 'driving', 'paused', 'stopping', 'done', 'stopped']
#: What the obstacle watch says.
WatchName = Literal['clear', 'obstacle', 'no scan', 'blind']
#: x [m], y [m] and heading [rad] in the frame of the odometry at the start; for a fleet, in that
#: of the floor.
Pose = tuple[float, float, float]
#: x and y [m].
Point = tuple[float, float]
#: A whole number that the answer repeats; the console never uses one twice for one process.
Id = Annotated[int, Range(0, MAX_INTEGER)]


class Command(Message):
    """A line from the console to the drive process."""


@dataclass(frozen=True)
class Request(Command):
    """A command that the drive process answers."""

    id: Id  # noqa: A003


@dataclass(frozen=True)
class Take(Request):
    """Take the robot; answered when it is held at rest, ready for the hand, or refused."""

    TYPE: ClassVar[str] = 'take'


@dataclass(frozen=True)
class Release(Request):
    """Release the robot; the process answers and then ends with exit code 0."""

    TYPE: ClassVar[str] = 'release'


@dataclass(frozen=True)
class Hand(Command):
    """
    The velocity wanted by the hand; not answered.

    :param sequence: larger than in any earlier line of the same process
    :param stamp: the newest stamp that the page has seen [s]
    """

    TYPE: ClassVar[str] = 'hand'
    sequence: Id
    stamp: float
    linear_x: float
    angular_z: float


@dataclass(frozen=True)
class Run(Request):
    """
    Drive a motion; answered at once with accepted or refused.

    :param name: the path of its file, for messages and for the files that it includes
    :param values: of its parameters, by name
    :param included: the texts of the files that it includes, as in ``MotionFile.included_texts``;
        None: they are read
    """

    TYPE: ClassVar[str] = 'run'
    text: str
    name: str
    values: Mapping[str, str] = field(default_factory=dict)
    included: Mapping[str, str] | None = None


@dataclass(frozen=True)
class RunFleet(Request):
    """Drive all robots of a fleet from their starts; answered at once, accepted or refused."""

    TYPE: ClassVar[str] = 'run'


@dataclass(frozen=True)
class Stop(Request):
    """Stop the robot, or all of a fleet; answered when the stop is complete."""

    TYPE: ClassVar[str] = 'stop'


@dataclass(frozen=True)
class Pause(Request):
    """Pause the motion; answered at once."""

    TYPE: ClassVar[str] = 'pause'


@dataclass(frozen=True)
class Resume(Request):
    """Resume the paused motion; answered at once."""

    TYPE: ClassVar[str] = 'resume'


@dataclass(frozen=True)
class Speed(Request):
    """Set the speed factor of the console; answered at once."""

    TYPE: ClassVar[str] = 'speed'
    factor: Annotated[float, Range(0.01, 1.0)]


@dataclass(frozen=True)
class Alive(Command):
    """A page is open; sent every 0.25 s meanwhile, and not answered."""

    TYPE: ClassVar[str] = 'alive'


class Report(Message):
    """A line from the drive process to the console."""


@dataclass(frozen=True)
class FloorMap:
    """
    What stands on the floor of simulated robots.

    Of one robot in the frame in which it starts; of a fleet in that of its floor.

    :param walls: lines through points
    :param posts: x, y and radius of each [m]
    :param people: x, y and radius [m] of each place where somebody is for a time
    """

    walls: tuple[tuple[Point, ...], ...]
    posts: tuple[tuple[float, float, float], ...]
    people: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class Robot(Report):
    """
    The robot; the first line of a drive process, written once.

    :param has_odometry: whether the robot reports odometry; without it, no stop is confirmed
    :param max_linear_velocity: the largest forward velocity [m/s]
    :param max_backward_velocity: the largest backward velocity, as a positive number [m/s]
    :param max_angular_velocity: the largest angular velocity [rad/s]
    :param footprint: the corners of the robot's outline as x and y [m]; None if unknown
    :param is_driven_here: whether the commands drive the robot; false beside a drive that began in
        a terminal, where only ``stop``, ``pause``, ``resume`` and ``speed`` are executed
    :param floor: None if unknown
    """

    TYPE: ClassVar[str] = 'robot'
    robot: str
    topic: str
    has_odometry: bool
    max_linear_velocity: float
    max_backward_velocity: float
    max_angular_velocity: float
    footprint: tuple[Point, ...] | None = None
    is_driven_here: bool = True
    floor: FloorMap | None = None


@dataclass(frozen=True)
class MotionText(Report):
    """
    The motion that is driven; written only beside a drive that began in a terminal.

    :param name: the path of its file
    :param values: that its parameters were given, by name
    :param included: the texts of the files that it includes, as in ``MotionFile.included_texts``
    """

    TYPE: ClassVar[str] = 'motion'
    text: str
    name: str
    values: Mapping[str, str] = field(default_factory=dict)
    included: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Stamp(Report):
    """
    The clock of the drive process, every 0.05 s while the robot is taken.

    :param stamp: CLOCK_BOOTTIME [s]
    """

    TYPE: ClassVar[str] = 'stamp'
    stamp: float


@dataclass(frozen=True)
class Answer(Report):
    """
    The answer to a request.

    :param is_done: whether the request was accepted or, where it takes time, is complete
    :param text: for the user; with ``is_done`` false, the reason
    :param is_confirmed: for a stop, whether odometry has shown that the robot stands still; None
        if there is no odometry, and for other requests
    """

    TYPE: ClassVar[str] = 'answer'
    id: Id  # noqa: A003
    is_done: bool
    text: str = ''
    is_confirmed: bool | None = None


@dataclass(frozen=True)
class Watch:
    """
    What the obstacle watch says.

    :param distance: how far the robot can still drive on its planned path [m]; None without an
        obstacle
    :param angle: how far it can still turn on this way [rad]; None without an obstacle
    """

    state: WatchName
    distance: float | None = None
    angle: float | None = None


@dataclass(frozen=True)
class State(Report):
    """
    The state of the drive, at most 20 times a second, and only when something has changed.

    :param motion: the name of the motion that is driven or was driven last; None before any
    :param step: the number of the current step, from 1; None outside a motion
    :param steps: how many steps the motion has; None outside a motion
    :param progress: the share of the motion's duration that is over, from 0 to 1
    :param remaining: the time left at the current speed factors [s]
    :param factors: the speed factors, by the name of who has set them
    :param start: the pose at the start of the motion; None outside a motion, or without odometry
    :param odometry_age: the age of the newest odometry [s]
    :param battery: the charge of the robot's battery, from 0 to 1; None if the robot does not tell
    :param robot_errors: the errors that the robot reports; None if there are none, or the robot
        does not tell
    :param reason: why the last motion ended, or why the process stops
    :param is_still: whether odometry shows that the robot stands still; None without recent
        odometry
    :param watch: None without an obstacle watch
    :param held_by: why the robot is ``paused``, if only the obstacle watch holds it
    """

    TYPE: ClassVar[str] = 'state'
    state: StateName
    motion: str | None = None
    step: int | None = None
    steps: int | None = None
    progress: Annotated[float, Range(0.0, 1.0)] | None = None
    remaining: float | None = None
    factors: Mapping[str, float] = field(default_factory=dict)
    start: Pose | None = None
    planned: Pose | None = None
    driven: Pose | None = None
    velocity: tuple[float, float] = (0.0, 0.0)
    odometry_age: float | None = None
    battery: Annotated[float, Range(0.0, 1.0)] | None = None
    robot_errors: str | None = None
    reason: str | None = None
    is_still: bool | None = None
    watch: Watch | None = None
    held_by: str | None = None


@dataclass(frozen=True)
class Scan(Report):
    """
    A scan of the laser, at most 5 times a second, while the obstacle watch is on.

    It is dropped if the reader of the lines does not keep up.

    :param pose: of the robot by odometry when the scan came; None without odometry
    :param points: what the laser has seen, at most 180 of its points, in the frame of the robot: x
        ahead, y to the left [m]
    """

    TYPE: ClassVar[str] = 'scan'
    pose: Pose | None
    points: tuple[Point, ...]


@dataclass(frozen=True)
class Sent(Report):
    """
    The velocities that were really sent while a hand drove; equal neighbours are merged.

    :param segments: for each velocity that has ended, the linear velocity [m/s], the angular
        velocity [rad/s] and how long it was held [s]
    """

    TYPE: ClassVar[str] = 'sent'
    segments: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class FloorRobot:
    """
    A robot of a fleet on the floor.

    :param motion: the name of its motion, with the values of its parameters
    :param start: where it stands at t = 0
    :param duration: of its motion [s]
    :param path: points on its planned path
    :param outline: the number of its outline in those of the fleet, from 0; None if unknown
    """

    name: str
    motion: str
    start: Pose
    duration: float
    path: tuple[Point, ...]
    outline: int | None = None


@dataclass(frozen=True)
class Fleet(Report):
    """
    A fleet; the first line of its drive process, written once.

    :param source: the path of its file
    :param margin: how near two outlines may come [m]
    :param rounds: how often the motions are driven
    :param duration: of one round [s]
    :param outlines: the corners of each kind of robot as x (ahead) and y (left) [m]
    :param floor: None if unknown
    """

    TYPE: ClassVar[str] = 'fleet'
    name: str
    source: str
    margin: float
    rounds: int
    duration: float
    outlines: tuple[tuple[Point, ...], ...]
    robots: tuple[FloorRobot, ...]
    floor: FloorMap | None = None


@dataclass(frozen=True)
class FleetState(Report):
    """
    The state of a fleet, at most 20 times a second, and only when something has changed.

    A list has a value for each robot, in the order of ``fleet``.

    :param round: from 1; None before the first
    :param plan_time: how far the round has come, in the time of its plan [s]; None outside a round
    :param speed: relative to the motions, from 0 to 1; that of the slowest robot
    :param apart: by how much the plans of the robots had come apart by a pause, before all went on
        in step [s]; None if they never had
    :param reason: why the last drive ended early, or why the process stops
    :param is_still: whether odometry shows that all robots stand still; None without recent
        odometry of each
    :param poses: where the robots are by odometry; None before the first drive, or without it
    :param troubles: what is wrong with a robot, by its name
    :param watch: of the robot that holds all; None if none does
    :param held_by: why the robots are ``paused``, if only an obstacle watch holds them
    """

    TYPE: ClassVar[str] = 'fleet_state'
    state: FleetStateName
    round: int | None = None  # noqa: A003
    plan_time: float | None = None
    speed: Annotated[float, Range(0.0, 1.0)] = 1.0
    apart: float | None = None
    reason: str | None = None
    is_still: bool | None = None
    states: tuple[FloorRobotState, ...] = ()
    poses: tuple[Pose | None, ...] = ()
    troubles: Mapping[str, str] = field(default_factory=dict)
    watch: Watch | None = None
    held_by: str | None = None


@dataclass(frozen=True)
class Log(Report):
    """A message of the log."""

    TYPE: ClassVar[str] = 'log'
    level: Literal['debug', 'info', 'warning', 'error']
    text: str


_COMMANDS: tuple[type[Command], ...] = (
    Take, Release, Hand, Run, Stop, Pause, Resume, Speed, Alive)
_REPORTS: tuple[type[Report], ...] = (
    Robot, MotionText, Stamp, Answer, State, Scan, Sent, Fleet, FleetState, Log)
#: The classes of commands, by type.
COMMANDS = by_type(_COMMANDS)
#: The classes of the commands to a fleet, by type.
FLEET_COMMANDS: dict[str, type[Command]] = by_type((
    RunFleet, Release, Stop, Pause, Resume, Alive))
#: The classes of reports, by type.
REPORTS = by_type(_REPORTS)


def read_command(
        line: str | bytes, kinds: Mapping[str, type[Command]] = COMMANDS) -> Command:
    """
    Read a command from a line; the line may end with a line break.

    :param kinds: the classes of the commands, by type
    :raises MessageError: if the line is no valid command
    """
    return from_json(line.rstrip(), kinds)


def read_report(line: str | bytes) -> Report:
    """
    Read a report from a line; the line may end with a line break.

    :raises MessageError: if the line is no valid report
    """
    return from_json(line.rstrip(), REPORTS)


def write_line(message: Message) -> bytes:
    """
    Return a message as a line, with the line break.

    :raises MessageError: if a number of the message is NaN or infinite, or the message is too long
    """
    return to_json(message).encode('ascii') + b'\n'


def protocol_schema() -> dict[str, Any]:
    """Return the JSON Schema of all lines, which ``protocol.schema.json`` contains."""
    return schema_of(
        'A line between the console and the drive process', (*_COMMANDS, RunFleet, *_REPORTS))
