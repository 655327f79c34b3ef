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
What a console of one robot and that of a fleet have in common: pages, stops and answers.

Everything here happens in the thread of the event loop, and nothing here waits.  So a stop is
handled as soon as it has arrived.

Tested by test/console/test_server.py and test/console/test_fleet_console.py.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
import asyncio
from collections.abc import Callable
import time

from kachaka_simple_control.console.drive_process import DriveProcess
from kachaka_simple_control.console.open_pages import OpenPage, OpenPages, Page
from kachaka_simple_control.console.page_protocol import PageAnswer
from kachaka_simple_control.console.reports import Reports
from kachaka_simple_control.files.messages import Message, MessageError
from kachaka_simple_control.files.protocol import Answer, Log, Report, Request, Stop

#: How often the drive process hears that a page is open [s].
ALIVE_PERIOD = 0.25
#: A longer message than any stop; above the rate limit it is dropped unread.
MAX_STOP = 200
ONLY_LOOK = 'this link is for viewers: it can stop and pause, but not drive'
Outcome = tuple[bool, str]
DriveFactory = Callable[[Callable[[Report], None], Callable[[], None]], DriveProcess]


class BaseConsole(ABC):
    """
    Open pages on the one side, the drive process on the other.

    :param make_drive: makes the drive process from two functions: one that is called with each
        report, and one that is called when the state of the process has changed
    """

    #: the file of the page
    PAGE = 'index.html'

    def __init__(
            self, make_drive: DriveFactory, reports: Reports,
            clock: Callable[[], float] = time.monotonic) -> None:
        self.drive = make_drive(self._take_report, self._process_changed)
        self.pages, self.reports = OpenPages(), reports
        self._clock = clock
        self._ticker: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start the drive process and the clock that tells it that pages are open."""
        self.drive.start()
        self._ticker = asyncio.get_running_loop().create_task(self._tick_forever())

    async def close(self) -> None:
        """End the drive process and all other work."""
        if self._ticker is not None:
            self._ticker.cancel()
        await self.drive.close()

    def open_page(self, page: Page) -> None:
        """Take a new page."""
        self.pages.add(page, self._clock())
        self._show()

    def close_page(self, page: Page) -> None:
        """Forget a page."""
        if self.pages.remove(page):
            self._show()

    def receive(self, page: Page, text: str | bytes) -> None:
        """Handle a message of a page.  A stop is always handled; others only within their rate."""
        entry = self.pages.find(page)
        if entry is None:
            return
        now = self._clock()
        if len(text) > MAX_STOP and not entry.other_rate.has_left(now):
            return
        try:
            message = self._read(text)
        except MessageError as error:
            if entry.other_rate.allows(now):
                page.send(Log('error', f'a message of this page is invalid: {error}'))
            return
        if isinstance(message, Stop):
            self._answer_later(page, message, self.drive.stop(now))
        else:
            self._take(page, entry, message, now)

    def tick(self) -> None:
        """Do what is due from time to time; the console calls this every ``ALIVE_PERIOD``."""
        if self.pages:
            self.drive.keep_alive()
        self._show()

    @staticmethod
    @abstractmethod
    def _read(text: str | bytes) -> Message:
        """
        Read a message of a page.

        :raises MessageError: if the text is no valid message
        """

    @abstractmethod
    def _handle(self, page: Page, entry: OpenPage, message: Message) -> None:
        """Handle a message that is no stop, and within the rate."""

    @abstractmethod
    def _take_report(self, report: Report) -> None:
        """Handle a report of the drive process."""

    @abstractmethod
    def _process_changed(self) -> None:
        """React to a new state of the drive process."""

    @abstractmethod
    def _show(self) -> None:
        """Send each page what has changed since its last state."""

    def _take(self, page: Page, entry: OpenPage, message: Message, now: float) -> None:
        """Handle a message that is no stop, unless the page sends too many."""
        if entry.other_rate.allows(now):
            self._handle(page, entry, message)

    def _answer_later(
            self, page: Page, message: Request, future: asyncio.Future[Answer]) -> None:
        def send(done: asyncio.Future[Answer]) -> None:
            if page in self.pages and not done.cancelled():
                answer = done.result()
                page.send(PageAnswer(
                    message.id, answer.is_done, answer.text, answer.is_confirmed))
        future.add_done_callback(send)

    def _answer(self, page: Page, message: Request, outcome: Outcome) -> None:
        page.send(PageAnswer(message.id, *outcome))

    def _start_again(self) -> Outcome:
        if self.drive.state != 'ended':
            return False, 'the drive process runs'
        self.drive.start()
        return True, 'started'

    async def _tick_forever(self) -> None:
        while True:
            await asyncio.sleep(ALIVE_PERIOD)
            self.tick()
