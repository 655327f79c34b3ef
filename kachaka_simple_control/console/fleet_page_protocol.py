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
The messages between the page of a fleet and the console, over the WebSocket ``/ws``.

Their form, and those that are not here, are in ``page_protocol.py``.  There is no lease: each page
but a viewer's may ``run``, ``resume``, ``release`` and ``start``.

Tested by test/console/test_fleet_console.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kachaka_simple_control.console.page_protocol import (
    Hello,
    PageAnswer,
    ProcessName,
    Start,
    StateChanges,
)
from kachaka_simple_control.files.messages import by_type, from_json, Message
from kachaka_simple_control.files.protocol import (
    Fleet,
    FleetState,
    Log,
    Pause,
    Release,
    Request,
    Resume,
    RunFleet,
    Stop,
)


@dataclass(frozen=True)
class Ping(Request):
    """Ask for an answer, which shows that the connection works."""

    TYPE: ClassVar[str] = 'ping'


@dataclass(frozen=True)
class FleetWelcome(Message):
    """
    The answer to ``hello``.

    :param may_drive: whether this page may run the fleet; a viewer may not
    :param fleet: None until it is known
    """

    TYPE: ClassVar[str] = 'welcome'
    may_drive: bool
    version: str
    fleet: Fleet | None


@dataclass(frozen=True)
class FleetPageState(FleetState):
    """
    The keys of ``state``: those of the drive process and these.

    :param process: the drive process; after ``ended`` only ``start`` starts a new one, and
        ``reason`` says why it ended
    :param report: the number of the newest report, at ``/report/N``; None if there is none
    """

    process: ProcessName = 'starting'
    watchers: int = 0
    report: int | None = None


#: The classes of messages from the page, by type.
FLEET_PAGE_MESSAGES: dict[str, type[Message]] = by_type((
    Hello, Ping, Start, RunFleet, Stop, Pause, Resume, Release))
#: The classes of messages to the page, by type.
FLEET_CONSOLE_MESSAGES: dict[str, type[Message]] = by_type((
    FleetWelcome, Fleet, StateChanges, PageAnswer, Log))


def read_fleet_page_message(text: str | bytes) -> Message:
    """
    Read a message from the page of a fleet.

    :raises MessageError: if the text is no valid message
    """
    return from_json(text, FLEET_PAGE_MESSAGES)
