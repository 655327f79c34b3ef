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
once it is known, ``robot``.  Messages that the drive process has as well, such as ``stop`` and
``hand``, are those of ``files/protocol.py``.

A page message with an ``id`` gets exactly one ``answer`` with the same number, except ``preview``,
``open`` and ``list``, which get a ``preview``, ``file`` or ``motions`` instead, or an ``answer``
with ``is_done`` false.  The page chooses the numbers, each once for a connection.  A message above
the rate limit gets no answer.  A message that is invalid is answered by a ``log``, and nothing
else happens.  ``take``, ``release``, ``run``, ``resume``, ``speed`` and ``record`` need the lease.

Tested by test/files/test_protocol.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from kachaka_simple_control.files.messages import by_type, from_json, Message
from kachaka_simple_control.files.protocol import (
    Answer,
    Hand,
    Id,
    Log,
    Pause,
    Pose,
    Release,
    Request,
    Resume,
    Robot,
    Scan,
    Speed,
    Stamp,
    State,
    Stop,
    Take,
)

#: The largest size of a message to the page [bytes].
MAX_SENT = 1_000_000
#: The state of the drive process, as the console sees it.
ProcessName = Literal['starting', 'running', 'ended']
#: Who has the lease of the hand.
DriverName = Literal['nobody', 'you', 'another']


@dataclass(frozen=True)
class Hello(Message):
    """The first message of a page."""

    TYPE: ClassVar[str] = 'hello'


@dataclass(frozen=True)
class Lease(Request):
    """Ask for the lease of the hand, or give it up."""

    TYPE: ClassVar[str] = 'lease'
    want: bool


@dataclass(frozen=True)
class Start(Request):
    """Start a new drive process after the last one has ended."""

    TYPE: ClassVar[str] = 'start'


@dataclass(frozen=True)
class RunMotion(Request):
    """
    Drive a motion; needs the lease.

    :param name: the name of a motion of the package, or of a file in the folder; with a text, only
        the name that errors and the state show
    :param text: the text of a motion file; None to drive the motion of the name
    :param values: of its parameters, by name
    :param included: as its ``preview`` says, so that what is driven is what was planned
    """

    TYPE: ClassVar[str] = 'run'
    name: str | None = None
    text: str | None = None
    values: Mapping[str, str] = field(default_factory=dict)
    included: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class AskPreview(Request):
    """
    Check the text of a motion file and plan it; a newer one replaces one that still waits.

    :param name: of the file, for messages
    :param values: of its parameters, by name; one that the text does not have is left out
    :param included: the texts of the files that it includes; None: those of the folder
    """

    TYPE: ClassVar[str] = 'preview'
    text: str
    name: str = 'motion.yaml'
    values: Mapping[str, str] = field(default_factory=dict)
    included: Mapping[str, str] | None = None


@dataclass(frozen=True)
class SaveFile(Request):
    """
    Write a file into the folder.

    :param file: the file name, ``[A-Za-z0-9_.-]+.yaml``
    :param may_overwrite: whether the user has agreed to replace an existing file
    """

    TYPE: ClassVar[str] = 'save'
    file: str
    text: str
    may_overwrite: bool = False


@dataclass(frozen=True)
class OpenFile(Request):
    """Ask for the text of a motion."""

    TYPE: ClassVar[str] = 'open'
    name: str


@dataclass(frozen=True)
class ListMotions(Request):
    """Ask for the motions again, for example after a file was added by another program."""

    TYPE: ClassVar[str] = 'list'


@dataclass(frozen=True)
class Record(Request):
    """
    Begin or end a recording of the velocities of the hand; needs the lease.

    :param on: whether to record; at the end, a ``recorded`` follows
    """

    TYPE: ClassVar[str] = 'record'
    on: bool


@dataclass(frozen=True)
class Motion:
    """A motion that can be driven."""

    name: str
    is_file: bool


@dataclass(frozen=True)
class Welcome(Message):
    """
    The answer to ``hello``.

    :param may_drive: whether this page may ask for the lease; a viewer may not
    :param folder: the name of the folder of motion files; None if nothing can be saved
    :param robot: the robot; None until it is known
    """

    TYPE: ClassVar[str] = 'welcome'
    may_drive: bool
    version: str
    folder: str | None
    robot: Robot | None
    motions: tuple[Motion, ...]


@dataclass(frozen=True)
class StateChanges(Message):
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
    :param report: the number of the newest report, at ``/report/N``; None if there is none
    """

    process: ProcessName = 'starting'
    driver: DriverName = 'nobody'
    watchers: int = 0
    is_recording: bool = False
    report: int | None = None


@dataclass(frozen=True)
class PageAnswer(Answer):
    """
    The answer to a request of a page.

    :param may_overwrite: for a ``save`` that was refused because the file exists: true; the page
        asks the user and may send the request again, with ``may_overwrite``
    """

    may_overwrite: bool = False


@dataclass(frozen=True)
class LineError:
    """
    A problem in the text of a motion.

    :param line: the line, from 1, for a problem in an included file that of the include; None if
        it is about the whole text
    :param parameter: the name of the parameter whose value is missing or wrong; None if it is
        about something else
    """

    line: int | None
    text: str
    parameter: str | None = None


@dataclass(frozen=True)
class MotionParameter:
    """
    A parameter of a motion.

    :param default: its value if none is given; None if one must be given
    :param bounds: as text, such as ``20 cm to 4 m``; empty without bounds
    """

    name: str
    description: str
    default: str | None
    bounds: str


@dataclass(frozen=True)
class Plan:
    """
    The plan of a motion that starts at x = 0, y = 0, heading 0.

    :param points: the path as x [m], y [m] and heading [rad]
    :param box: the smallest and largest x and y of the path [m]: x0, y0, x1, y1
    :param steps: how many steps the motion has
    """

    points: tuple[Pose, ...]
    box: tuple[float, float, float, float]
    duration: float
    steps: int


@dataclass(frozen=True)
class Preview(Message):
    """
    The answer to ``preview``.

    :param errors: the problems of the text; empty if it can be driven
    :param plan: the plan; None if there are errors
    :param parameters: also those of a text with errors
    :param included: the texts of the files of the folder that it includes, by name
    """

    TYPE: ClassVar[str] = 'preview'
    id: Id  # noqa: A003
    errors: tuple[LineError, ...]
    plan: Plan | None
    parameters: tuple[MotionParameter, ...] = ()
    included: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class FileText(Message):
    """The answer to ``open``."""

    TYPE: ClassVar[str] = 'file'
    id: Id  # noqa: A003
    name: str
    text: str


@dataclass(frozen=True)
class Motions(Message):
    """
    The answer to ``list``, and sent to every page after a file was saved.

    :param id: the number of the request; None after a file was saved
    """

    TYPE: ClassVar[str] = 'motions'
    id: Id | None  # noqa: A003
    motions: tuple[Motion, ...]


@dataclass(frozen=True)
class Driven(Message):
    """The motion that is or was driven last; sent when it begins, and after ``welcome``."""

    TYPE: ClassVar[str] = 'driven'
    plan: Plan


@dataclass(frozen=True)
class Recorded(Message):
    """
    The recording, after ``record`` was turned off or the hand has lost the lease.

    :param text: the text of a motion file; empty if nothing was driven
    """

    TYPE: ClassVar[str] = 'recorded'
    text: str


#: The classes of messages from the page, by type.
PAGE_MESSAGES: dict[str, type[Message]] = by_type((
    Hello, Lease, Start, Take, Release, RunMotion, Stop, Pause, Resume, Speed, Hand, AskPreview,
    SaveFile, OpenFile, ListMotions, Record))
#: The classes of messages to the page, by type.
CONSOLE_MESSAGES: dict[str, type[Message]] = by_type((
    Welcome, Robot, StateChanges, Scan, Stamp, PageAnswer, Preview, FileText, Motions, Log, Driven,
    Recorded))


def read_page_message(text: str | bytes) -> Message:
    """
    Read a message from the page.

    :raises MessageError: if the text is no valid message
    """
    return from_json(text, PAGE_MESSAGES)
