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
The messages between the page and the console, over the WebSocket ``/ws``.

Each message is a JSON object with the keys ``v`` (1) and ``type``, in one text message.  The
page's first message is ``hello``; the console answers with ``welcome``, the whole ``state`` and,
once it is known, ``robot``.

A page message with a ``request`` gets exactly one ``answer`` with the same number, except
``preview``, ``open`` and ``list``, which get a ``preview``, ``file`` or ``motions`` instead, or an
``answer`` with ``is_done`` false.  The page chooses the numbers, each once for a connection.  A
message above the rate limit gets no answer.  A message that is invalid, from a page that may not
send it, is answered by a ``log``, and nothing else happens.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from kachaka_simple_control.console.messages import by_type, from_json, Message, Range
from kachaka_simple_control.console.protocol import Id, Pose, Robot, State

#: The largest size of a message to the page [bytes].
MAX_SENT = 1_000_000
#: The state of the drive process, as the console sees it.
ProcessName = Literal['starting', 'running', 'ended']
#: Who has the lease of the hand.
DriverName = Literal['nobody', 'you', 'another']


class PageMessage(Message):
    """A message from the page to the console."""


@dataclass(frozen=True)
class PageRequest(PageMessage):
    """
    A message that is answered.

    :param request: the number that the answer repeats
    """

    request: Id


@dataclass(frozen=True)
class Hello(PageMessage):
    """The first message of a page."""

    TYPE: ClassVar[str] = 'hello'


@dataclass(frozen=True)
class Lease(PageRequest):
    """
    Ask for the lease of the hand, or give it up.

    :param want: whether the page wants the lease
    """

    TYPE: ClassVar[str] = 'lease'
    want: bool


@dataclass(frozen=True)
class Start(PageRequest):
    """Start a new drive process after the last one has ended."""

    TYPE: ClassVar[str] = 'start'


@dataclass(frozen=True)
class TakeRobot(PageRequest):
    """Take the robot; needs the lease, and a person who has looked at the floor."""

    TYPE: ClassVar[str] = 'take'


@dataclass(frozen=True)
class ReleaseRobot(PageRequest):
    """Release the robot; needs the lease."""

    TYPE: ClassVar[str] = 'release'


@dataclass(frozen=True)
class RunMotion(PageRequest):
    """
    Drive a motion; needs the lease.

    :param name: the name of a motion of the package, or of a file in the folder; with a text, only
        the name that errors and the state show
    :param text: the text of a motion file; None to drive the motion of the name
    """

    TYPE: ClassVar[str] = 'run'
    name: str | None = None
    text: str | None = None


@dataclass(frozen=True)
class StopRobot(PageRequest):
    """Stop the robot; needs no lease and has no rate limit."""

    TYPE: ClassVar[str] = 'stop'


@dataclass(frozen=True)
class PauseMotion(PageRequest):
    """Pause the motion; needs no lease."""

    TYPE: ClassVar[str] = 'pause'


@dataclass(frozen=True)
class ResumeMotion(PageRequest):
    """Resume the paused motion; needs the lease."""

    TYPE: ClassVar[str] = 'resume'


@dataclass(frozen=True)
class SetSpeed(PageRequest):
    """
    Set the speed factor of the console; needs the lease.

    :param factor: the factor by which all speeds of a motion are multiplied
    """

    TYPE: ClassVar[str] = 'speed'
    factor: Annotated[float, Range(0.01, 1.0)]


@dataclass(frozen=True)
class HandInput(PageMessage):
    """
    The velocity wanted by the hand, while a direction is held and once when it is let go.

    :param sequence: larger than in any earlier message of the page
    :param stamp: the newest stamp that the page has seen [s]
    :param linear_x: the wanted velocity [m/s]
    :param angular_z: the wanted angular velocity [rad/s]
    """

    TYPE: ClassVar[str] = 'hand'
    sequence: Id
    stamp: float
    linear_x: float
    angular_z: float


@dataclass(frozen=True)
class AskPreview(PageRequest):
    """
    Check the text of a motion file and plan it; a newer one replaces one that still waits.

    :param text: the text of a motion file
    """

    TYPE: ClassVar[str] = 'preview'
    text: str


@dataclass(frozen=True)
class SaveFile(PageRequest):
    """
    Write a file into the folder.

    :param file: the file name, ``[A-Za-z0-9_.-]+.yaml``
    :param text: the text of the file
    :param may_overwrite: whether the user has agreed to replace an existing file
    """

    TYPE: ClassVar[str] = 'save'
    file: str
    text: str
    may_overwrite: bool = False


@dataclass(frozen=True)
class OpenFile(PageRequest):
    """
    Ask for the text of a motion.

    :param name: the name of a motion of the package, or of a file in the folder
    """

    TYPE: ClassVar[str] = 'open'
    name: str


@dataclass(frozen=True)
class ListMotions(PageRequest):
    """Ask for the motions again, for example after a file was added by another program."""

    TYPE: ClassVar[str] = 'list'


@dataclass(frozen=True)
class Record(PageRequest):
    """
    Begin or end a recording of the velocities of the hand; needs the lease.

    :param on: whether to record; at the end, a ``recorded`` follows
    """

    TYPE: ClassVar[str] = 'record'
    on: bool


class ConsoleMessage(Message):
    """A message from the console to the page."""


@dataclass(frozen=True)
class Motion:
    """
    A motion that can be driven.

    :param name: what ``run`` and ``open`` take: the name of a motion of the package, or a file
        name with ``.yaml``
    :param is_file: whether it is a file of the folder, and not of the package
    """

    name: str
    is_file: bool


@dataclass(frozen=True)
class Welcome(ConsoleMessage):
    """
    The answer to ``hello``.

    :param may_drive: whether this page may ask for the lease; a viewer may not
    :param version: the version of the program
    :param folder: the name of the folder of motion files; None if nothing can be saved
    :param robot: the robot; None until it is known
    :param motions: the motions
    """

    TYPE: ClassVar[str] = 'welcome'
    may_drive: bool
    version: str
    folder: str | None
    robot: Robot | None
    motions: tuple[Motion, ...]


@dataclass(frozen=True)
class RobotFound(ConsoleMessage):
    """
    A drive process has found its robot.

    :param robot: the robot
    """

    TYPE: ClassVar[str] = 'robot'
    robot: Robot


@dataclass(frozen=True)
class StateChanges(ConsoleMessage):
    """
    What has changed since the last ``state``; the first one of a connection has every key.

    :param changes: the new values by key; the keys are those of :class:`PageState`
    """

    TYPE: ClassVar[str] = 'state'
    changes: Mapping[str, Any]


@dataclass(frozen=True)
class PageState(State):
    """
    The keys of ``state``: those of the drive process and these.

    :param process: the drive process; after ``ended`` only ``start`` starts a new one, and
        ``reason`` says why it ended
    :param driver: who has the lease of the hand
    :param watchers: how many pages are open
    :param is_recording: whether the velocities of the hand are recorded
    """

    process: ProcessName = 'starting'
    driver: DriverName = 'nobody'
    watchers: int = 0
    is_recording: bool = False


@dataclass(frozen=True)
class StampSeen(ConsoleMessage):
    """
    A stamp of the drive process, unchanged; sent to the page that has the lease.

    :param stamp: the clock of the drive process [s]
    """

    TYPE: ClassVar[str] = 'stamp'
    stamp: float


@dataclass(frozen=True)
class PageAnswer(ConsoleMessage):
    """
    The answer to a request.

    :param request: the number of the request
    :param is_done: whether the request was accepted or, where it takes time, is complete
    :param text: for the user; with ``is_done`` false, the reason, in one or several lines
    :param is_confirmed: for a stop, whether odometry has shown that the robot stands still; None
        if it is sent but unconfirmed, and for other requests
    :param may_overwrite: for a ``save`` that was refused because the file exists: true; the page
        asks the user and may send the request again, with ``may_overwrite``
    """

    TYPE: ClassVar[str] = 'answer'
    request: Id
    is_done: bool
    text: str = ''
    is_confirmed: bool | None = None
    may_overwrite: bool = False


@dataclass(frozen=True)
class LineError:
    """
    A problem in the text of a motion.

    :param line: the line, from 1; None if it is about the whole text
    :param text: the problem
    """

    line: int | None
    text: str


@dataclass(frozen=True)
class Plan:
    """
    The plan of a motion that starts at x = 0, y = 0, heading 0.

    :param points: the path as x [m], y [m] and heading [rad]
    :param box: the smallest and largest x and y of the path [m]: x0, y0, x1, y1
    :param duration: the duration [s]
    :param steps: how many steps the motion has
    """

    points: tuple[Pose, ...]
    box: tuple[float, float, float, float]
    duration: float
    steps: int


@dataclass(frozen=True)
class Preview(ConsoleMessage):
    """
    The answer to ``preview``.

    :param request: the number of the request
    :param errors: the problems of the text; empty if it can be driven
    :param plan: the plan; None if there are errors
    """

    TYPE: ClassVar[str] = 'preview'
    request: Id
    errors: tuple[LineError, ...]
    plan: Plan | None


@dataclass(frozen=True)
class FileText(ConsoleMessage):
    """
    The answer to ``open``.

    :param request: the number of the request
    :param name: the name of the motion
    :param text: the text of its file
    """

    TYPE: ClassVar[str] = 'file'
    request: Id
    name: str
    text: str


@dataclass(frozen=True)
class Motions(ConsoleMessage):
    """
    The answer to ``list``, and sent to every page after a file was saved.

    :param request: the number of the request; None after a file was saved
    :param motions: the motions
    """

    TYPE: ClassVar[str] = 'motions'
    request: Id | None
    motions: tuple[Motion, ...]


@dataclass(frozen=True)
class LogLine(ConsoleMessage):
    """
    A message of the log.

    :param level: the level
    :param text: the text
    """

    TYPE: ClassVar[str] = 'log'
    level: Literal['debug', 'info', 'warning', 'error']
    text: str


@dataclass(frozen=True)
class Recorded(ConsoleMessage):
    """
    The recording, after ``record`` was turned off or the hand has lost the lease.

    :param text: the text of a motion file; empty if nothing was driven
    """

    TYPE: ClassVar[str] = 'recorded'
    text: str


_PAGE: tuple[type[PageMessage], ...] = (
    Hello, Lease, Start, TakeRobot, ReleaseRobot, RunMotion, StopRobot, PauseMotion, ResumeMotion,
    SetSpeed, HandInput, AskPreview, SaveFile, OpenFile, ListMotions, Record)
_CONSOLE: tuple[type[ConsoleMessage], ...] = (
    Welcome, RobotFound, StateChanges, StampSeen, PageAnswer, Preview, FileText, Motions, LogLine,
    Recorded)
#: The classes of messages from the page, by type.
PAGE_MESSAGES = by_type(_PAGE)
#: The classes of messages to the page, by type.
CONSOLE_MESSAGES = by_type(_CONSOLE)


def read_page_message(text: str | bytes) -> PageMessage:
    """
    Read a message from the page.

    :param text: the message
    :raises MessageError: if the text is no valid message
    """
    return from_json(text, PAGE_MESSAGES)


def read_console_message(text: str | bytes) -> ConsoleMessage:
    """
    Read a message to the page, as a test or another client does.

    :param text: the message
    :raises MessageError: if the text is no valid message
    """
    return from_json(text, CONSOLE_MESSAGES, MAX_SENT)
