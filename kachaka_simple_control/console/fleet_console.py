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
The console of a fleet without its network: all robots at once, and no driving by hand.

Tested by test/console/test_fleet_console.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import time

from kachaka_simple_control.console.base_console import BaseConsole, DriveFactory, ONLY_LOOK
from kachaka_simple_control.console.fleet_page_protocol import (
    FleetPageState,
    FleetWelcome,
    Ping,
    read_fleet_page_message,
)
from kachaka_simple_control.console.open_pages import OpenPage, Page
from kachaka_simple_control.console.page_protocol import Hello, Start
from kachaka_simple_control.console.reports import Reports
from kachaka_simple_control.files.messages import Message
from kachaka_simple_control.files.protocol import (
    Fleet,
    FleetState,
    Log,
    Pause,
    Release,
    Report,
    Request,
)
from kachaka_simple_control.process.version import installed_version


class FleetConsole(BaseConsole):
    """
    Open pages on the one side, the drive process of a fleet on the other.

    Nobody has a lease: what two pages want at the same time, the drive process decides.
    """

    PAGE = 'fleet.html'
    _read = staticmethod(read_fleet_page_message)

    def __init__(
            self, make_drive: DriveFactory, reports: Reports,
            clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(make_drive, reports, clock)
        self._fleet: Fleet | None = None
        self._state = FleetState('standing by')

    def _handle(self, page: Page, entry: OpenPage, message: Message) -> None:
        if isinstance(message, Hello):
            self._welcome(page, entry)
            return
        assert isinstance(message, Request)
        if not (page.may_drive or isinstance(message, (Pause, Ping))):
            self._answer(page, message, (False, ONLY_LOOK))
            return
        match message:
            case Ping():
                self._answer(page, message, (True, ''))
            case Start():
                self._answer(page, message, self._start_again())
            case Release():
                self._answer_later(page, message, self.drive.released())
            case _:
                self._answer_later(page, message, self.drive.request(message))

    def _welcome(self, page: Page, entry: OpenPage) -> None:
        page.send(FleetWelcome(page.may_drive, installed_version(), self._fleet))
        for line in self.pages.log_lines:
            page.send(line)
        entry.shown = {}
        self._show()

    def _take_report(self, report: Report) -> None:
        match report:
            case FleetState():
                self._state = report
                self._show()
            case Log():
                self.pages.log(report)
            case Fleet():
                self._fleet = report
                self.pages.send(report)

    def _process_changed(self) -> None:
        if self.drive.state == 'starting':
            self._state = FleetState('standing by')
        elif self.drive.state == 'ended':
            self.reports.note_end()
            self._state = replace(
                self._state, state='ended', reason=self.drive.reason, watch=None, held_by=None)
            if self.drive.reason:
                self.pages.log(Log('warning', self.drive.reason))
        self._show()

    def _show(self) -> None:
        self.pages.show(vars(FleetPageState(
            **vars(self._state), process=self.drive.state, watchers=len(self.pages),
            report=self.reports.newest)))
