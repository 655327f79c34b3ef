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
Pass messages between the open pages and the drive process, and decide which ones may pass.

Everything here happens in the thread of the event loop, and nothing here waits: what takes time
(files, plans, the end of a recording) is a task of its own.  So a stop is handled as soon as it
has arrived.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, replace
from datetime import datetime
from functools import partial
import time
from typing import Literal

from kachaka_simple_control.console.drive_process import DriveProcess
from kachaka_simple_control.console.folder import Folder, FolderError
from kachaka_simple_control.console.lease import HandLease, IDLE_TIME
from kachaka_simple_control.console.messages import Message, MessageError
from kachaka_simple_control.console.open_pages import OpenPage, OpenPages, Page
from kachaka_simple_control.console.page_protocol import (
    AskPreview,
    Driven,
    Hello,
    Lease,
    ListMotions,
    OpenFile,
    PageAnswer,
    PageState,
    read_page_message,
    Record,
    Recorded,
    RunMotion,
    Start,
    Welcome,
)
from kachaka_simple_control.console.page_work import in_thread, PageWork
from kachaka_simple_control.console.preview import PreviewWorker
from kachaka_simple_control.console.protocol import (
    Answer,
    Hand,
    Log,
    MotionText,
    Pause,
    Release,
    Report,
    Request,
    Resume,
    Robot,
    Run,
    Sent,
    Speed,
    Stamp,
    State,
    Stop,
    Take,
)
from kachaka_simple_control.console.recording import Recording
from kachaka_simple_control.console.reports import Reports
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.version import installed_version

#: How often the drive process hears that a page is open [s].
ALIVE_PERIOD = 0.25
#: How long a recording waits for the last segments after its end [s].
LAST_SEGMENTS = 0.3
#: A stop that comes so soon after another, with nothing in between, shares its answer [s].
SAME_STOP = 0.1
#: How many lines of the log a new page gets.
LOG_LENGTH = 50
#: A longer message than any stop; above the rate limit it is dropped unread.
MAX_STOP = 200
#: In these states the robot is held, and no motion is driven.
HELD_STATES = ('ready', 'driving by hand')
#: In these states the robot is released when nobody has driven it for a while.
IDLE_STATES = (*HELD_STATES, 'paused')
#: In these states the lease does not end by itself.
BUSY_STATES = ('taking', 'driving', 'paused', 'stopping')
NO_LEASE = 'this page does not drive: ask for the lease first'
BESIDE = (
    'the drive was begun in a terminal; here it can be stopped, paused, resumed and slowed down')
ONLY_LOOK = 'this link is for viewers: it can stop and pause, but not drive'
Outcome = tuple[bool, str]
DriveFactory = Callable[[Callable[[Report], None], Callable[[], None]], DriveProcess]


class Hub:
    """
    The console without its network: pages on the one side, the drive process on the other.

    :param make_drive: makes the drive process from two functions: one that is called with each
        report, and one that is called when the state of the process has changed
    """

    def __init__(
            self, make_drive: DriveFactory, folder: Folder, previews: PreviewWorker,
            reports: Reports, clock: Callable[[], float] = time.monotonic) -> None:
        self.drive = make_drive(self._take_report, self._process_changed)
        self.lease: HandLease[Page] = HandLease()
        self.reports = reports
        self._clock = clock
        self._pages = OpenPages()
        self._work = PageWork(folder, previews, lambda: tuple(self._pages))
        self._robot: Robot | None = None
        self._state = State('standing by')
        #: the motion that was started last
        self._driven: Driven | None = None
        self._recording: Recording | None = None
        self._logs: deque[Log] = deque(maxlen=LOG_LENGTH)
        self._sequence = 0
        self._last_stamp: float | None = None
        self._was_given_up = False
        self._is_releasing = False
        self._stop: asyncio.Future[Answer] | None = None
        self._stop_time = 0.0
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
        await self._work.close()

    @property
    def page_count(self) -> int:
        """Return how many pages are open."""
        return len(self._pages)

    def open_page(self, page: Page) -> None:
        """Take a new page."""
        self._pages.add(page, self._clock())
        self._show()

    def close_page(self, page: Page) -> None:
        """Forget a page; if it has driven, a zero is sent at once."""
        if self._pages.remove(page):
            self._lose_lease(page)
            self._show()

    def receive(self, page: Page, text: str | bytes) -> None:
        """Handle a message of a page.  A stop is always handled; others only within their rate."""
        entry = self._pages.find(page)
        if entry is None:
            return
        now = self._clock()
        if len(text) > MAX_STOP and not entry.other_rate.has_left(now):
            return
        try:
            message = read_page_message(text)
        except MessageError as error:
            if entry.other_rate.allows(now):
                page.send(Log('error', f'a message of this page is invalid: {error}'))
            return
        if isinstance(message, Stop):
            self._answer_later(page, message, self._stop_answer(now))
        elif isinstance(message, Hand):
            if entry.hand_rate.allows(now):
                self._take_hand(page, entry, message, now)
        elif entry.other_rate.allows(now):
            self._handle(page, entry, message, now)

    # From the pages

    def _take_hand(self, page: Page, entry: OpenPage, hand: Hand, now: float) -> None:
        """
        Pass a velocity on at once, or drop it; it is never kept or sent again.

        The stamp passes unchanged, because only the drive process can tell its age.  The sequence
        is counted anew: that of another page begins elsewhere.
        """
        if self.lease.holder is not page or hand.sequence <= entry.sequence:
            return
        entry.sequence = hand.sequence
        self.lease.note_input(page, now)
        self._last_stamp = hand.stamp
        self._send_hand(hand.stamp, hand.linear_x, hand.angular_z)

    def _stop_answer(self, now: float) -> asyncio.Future[Answer]:
        """
        Return the answer of a stop; it is sent, unless the same stop has just been sent.

        Who floods with stops must not fill the pipe, where the next command waits behind them.
        """
        is_same = (self._stop is not None and not self._stop.done()
                   and now - self._stop_time < SAME_STOP)
        if self._stop is None or not is_same:
            self._stop, self._stop_time = self.drive.request(Stop(0)), now
        return self._stop

    def _send_hand(self, stamp: float, linear_x: float, angular_z: float) -> None:
        self._stop = None
        self._sequence += 1
        self.drive.hand(Hand(self._sequence, stamp, linear_x, angular_z))

    def _handle(self, page: Page, entry: OpenPage, message: Message, now: float) -> None:
        if isinstance(message, Hello):
            self._welcome(page, entry)
            return
        assert isinstance(message, Request)
        refusal = self._refusal(page, message)
        if refusal:
            page.send(PageAnswer(message.id, False, refusal))
            return
        self._note_input(page, message, now)
        match message:
            case Take() | Pause() | Resume() | Speed():
                self._relay(page, message, message)
            case Release():
                self._stop = None
                self._answer_later(page, message, self.drive.released())
            case Lease():
                self._answer(page, message, self._change_lease(page, message.want, now))
            case Start():
                self._answer(page, message, self._start_again())
            case Record():
                self._answer(page, message, self._record(page, message.on))
            case RunMotion():
                self._work.spawn(self._run(page, message))
            case _:
                self._work.handle(page, message)

    def _note_input(self, page: Page, message: Request, now: float) -> None:
        # A page asks for these by itself.
        if not isinstance(message, (AskPreview, OpenFile, ListMotions)):
            self.lease.note_input(page, now)

    def _refusal(self, page: Page, message: Request) -> str:
        for_all = isinstance(message, (Pause, AskPreview, OpenFile, ListMotions))
        if not for_all and not page.may_drive:
            return ONLY_LOOK
        if self._robot is not None and not self._robot.is_driven_here:
            return BESIDE if isinstance(message, (Lease, Start, Record, RunMotion)) else ''
        needs_lease = isinstance(message, (
            Take, Release, RunMotion, Resume, Speed, Record))
        return NO_LEASE if needs_lease and self.lease.holder is not page else ''

    def _welcome(self, page: Page, entry: OpenPage) -> None:
        async def welcome() -> None:
            motions = await self._work.motions()
            page.send(Welcome(page.may_drive, installed_version(), self._work.folder_name,
                              self._robot, motions))
            for line in self._logs:
                page.send(line)
            if self._driven is not None:
                page.send(self._driven)
            entry.shown = {}
            self._show()
        self._work.spawn(welcome())

    def _relay(self, page: Page, message: Request, command: Request) -> asyncio.Future[Answer]:
        """
        Send a command to the drive process; its answer goes to the page.

        :returns: the future of the answer
        """
        self._stop = None  # what is sent now comes after that stop
        answer = self.drive.request(command)
        self._answer_later(page, message, answer)
        return answer

    def _answer_later(
            self, page: Page, message: Request, future: asyncio.Future[Answer]) -> None:
        def send(done: asyncio.Future[Answer]) -> None:
            if page in self._pages and not done.cancelled():
                answer = done.result()
                page.send(PageAnswer(
                    message.id, answer.is_done, answer.text, answer.is_confirmed))
        future.add_done_callback(send)

    def _answer(self, page: Page, message: Request, outcome: Outcome) -> None:
        page.send(PageAnswer(message.id, *outcome))

    def _change_lease(self, page: Page, want: bool, now: float) -> Outcome:
        if not want:
            has_changed = self._lose_lease(page)
            self._was_given_up = has_changed
            outcome = has_changed, 'released' if has_changed else 'this page does not drive'
        elif self.lease.ask(page, now):
            self._is_releasing = False
            outcome = True, 'this page drives'
        else:
            outcome = False, 'another page drives'
        self._show()
        return outcome

    def _lose_lease(self, page: Page) -> bool:
        had_it = self.lease.give_up(page, self._clock())
        if had_it:
            self._was_given_up = False
            if self._last_stamp is not None:
                # Sooner than the lapse of the last velocity.  A zero is never wrong.
                self._send_hand(self._last_stamp, 0.0, 0.0)
                self._last_stamp = None
            if self._recording is not None:
                self._work.spawn(self._finish_recording(page))
        return had_it

    def _start_again(self) -> Outcome:
        if self.drive.state != 'ended':
            return False, 'the drive process runs'
        self.drive.start()
        return True, 'started'

    def _record(self, page: Page, is_on: bool) -> Outcome:
        if is_on:
            self._recording = Recording()
        elif self._recording is None:
            return False, 'nothing is recorded'
        else:
            self._work.spawn(self._finish_recording(page))
        self._show()
        return True, 'recording' if is_on else 'recorded'

    async def _finish_recording(self, page: Page) -> None:
        recording = self._recording
        # The last velocity is reported when the next one is sent.
        await asyncio.sleep(LAST_SEGMENTS)
        if recording is None or self._recording is not recording:
            return
        self._recording = None
        self._show()
        now = datetime.now().astimezone()
        text = await in_thread(partial(
            recording.text, f'hand {now:%Y-%m-%d %H.%M.%S}',
            f'Driven by hand on {now:%Y-%m-%d} at {now:%H:%M:%S}.'))
        page.send(Recorded(text))

    async def _run(self, page: Page, message: RunMotion) -> None:
        text, name = message.text, message.name or 'motion.yaml'
        if text is None and message.name is None:
            self._answer(page, message, (False, 'a name or a text is needed'))
            return
        if text is None:
            try:
                text = await self._work.read(name)
            except FolderError as error:
                self._answer(page, message, (False, str(error)))
                return
        # The page may have lost the lease while its file was read.
        if self.lease.holder is not page:
            self._answer(page, message, (False, NO_LEASE))
            return
        answer = self._relay(page, message, Run(0, text, name))
        if (await answer).is_done:
            await self._show_plan(text)

    async def _show_plan(self, text: str) -> None:
        """Send each page the plan of the motion that has begun."""
        if (plan := await self._work.plan(text)) is not None:
            self._driven = Driven(plan)
            self._pages.send(self._driven)

    # From the drive process

    def _take_report(self, report: Report) -> None:
        match report:
            case Stamp():
                if self.lease.holder is not None:
                    self.lease.holder.send(Stamp(report.stamp))
            case State():
                self._state = report
                self._show()
            case Log():
                self._log(report.level, report.text)
            case Sent():
                self._take_segments(report)
            case MotionText():
                self._work.spawn(self._show_plan(report.text))
            case Robot():
                self._robot = report
                self._pages.send(report)

    def _take_segments(self, report: Sent) -> None:
        if self._recording is None:
            return
        try:
            self._recording.add(report.segments)
        except InvalidMotionError as error:
            self._log('error', f'a segment cannot be recorded: {error}')
        if self._recording.is_full and self.lease.holder is not None:
            self._log('warning', 'the recording has ended: a motion has no room for more')
            self._work.spawn(self._finish_recording(self.lease.holder))

    def _process_changed(self) -> None:
        if self.drive.state == 'starting':
            self._state, self._is_releasing = State('standing by'), False
        elif self.drive.state == 'ended':
            self._last_stamp = None
            self.reports.note_end()
            self._state = replace(
                self._state, state='ended', velocity=(0.0, 0.0), reason=self.drive.reason)
            if self.drive.reason:
                self._log('warning', self.drive.reason)
        self._show()

    def _log(self, level: Literal['debug', 'info', 'warning', 'error'], text: str) -> None:
        line = Log(level, text)
        self._logs.append(line)
        self._pages.send(line)

    def _show(self) -> None:
        """Send each page what has changed since its last state."""
        self._pages.show(PageState(
            **asdict(self._state), process=self.drive.state, watchers=len(self._pages),
            is_recording=self._recording is not None, report=self.reports.newest),
            self.lease.holder)

    async def _tick_forever(self) -> None:
        while True:
            await asyncio.sleep(ALIVE_PERIOD)
            self.tick()

    def tick(self) -> None:
        """Do what is due from time to time; the hub calls this every ``ALIVE_PERIOD``."""
        now = self._clock()
        if self._pages:
            self.drive.keep_alive()
        holder = self.lease.holder
        if (holder is not None and self.lease.is_idle(now)
                and self._state.state not in BUSY_STATES):
            self._lose_lease(holder)
            self._was_given_up = True
            self._log('info', f'the lease has ended: no input for {IDLE_TIME:g} s')
        is_ours = self._robot is not None and self._robot.is_driven_here
        # A motion that is paused ends with the release: another page may still go on with it.
        is_alone = is_ours and self.lease.holder is None and (
            (now - self.lease.free_since >= IDLE_TIME and self._state.state in IDLE_STATES)
            or (self._was_given_up and self._state.state in HELD_STATES))
        if is_alone and not self._is_releasing:
            self._is_releasing = True
            self.drive.released()
        self._show()
