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
The console of one robot without its network: it passes messages between pages and drive process.

Slow work (files, plans, the end of a recording) is done in tasks of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import time

from kachaka_simple_control.console.base_console import (
    BaseConsole,
    DriveFactory,
    ONLY_LOOK,
    Outcome,
)
from kachaka_simple_control.console.folder import file_name, Folder, FolderError
from kachaka_simple_control.console.lease import HandLease, IDLE_TIME
from kachaka_simple_control.console.open_pages import OpenPage, Page
from kachaka_simple_control.console.page_protocol import (
    AskPreview,
    Driven,
    Hello,
    Lease,
    ListMotions,
    OpenFile,
    PageState,
    read_page_message,
    Record,
    RunMotion,
    Start,
    Welcome,
)
from kachaka_simple_control.console.page_work import PageWork
from kachaka_simple_control.console.preview import PreviewWorker
from kachaka_simple_control.console.recording import Recorder
from kachaka_simple_control.console.reports import Reports
from kachaka_simple_control.files.messages import Message
from kachaka_simple_control.files.protocol import (
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
    Scan,
    Sent,
    Speed,
    Stamp,
    State,
    Take,
)
from kachaka_simple_control.process.version import installed_version

#: A page asks for these by itself, also that of a viewer.
UNASKED = (AskPreview, OpenFile, ListMotions)
NEEDS_LEASE = (Take, Release, RunMotion, Resume, Speed, Record)
NO_LEASE = 'this page does not drive: ask for the lease first'
BESIDE = (
    'the drive was begun in a terminal; here it can be stopped, paused, resumed and slowed down')


class Console(BaseConsole):
    """Open pages on the one side, the drive process of a robot on the other."""

    _read = staticmethod(read_page_message)

    def __init__(
            self, make_drive: DriveFactory, folder: Folder, previews: PreviewWorker,
            reports: Reports, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(make_drive, reports, clock)
        self.lease: HandLease[Page] = HandLease()
        self._work = PageWork(folder, previews, self.pages)
        self._recorder = Recorder(self.pages, self._work.spawn, self._show)
        self._robot: Robot | None = None
        self._state = State('standing by')
        #: the motion that was started last
        self._driven: Driven | None = None
        #: the last velocity of the page that has the lease
        self._last_hand: Hand | None = None
        self._is_releasing = False

    async def close(self) -> None:
        """End the drive process and all other work."""
        await super().close()
        await self._work.close()

    def close_page(self, page: Page) -> None:
        """Forget a page; if it has driven, a zero is sent at once."""
        if self.pages.remove(page):
            self._lose_lease(page)
            self._show()

    # From the pages

    def _take(self, page: Page, entry: OpenPage, message: Message, now: float) -> None:
        if not isinstance(message, Hand):
            super()._take(page, entry, message, now)
        elif entry.hand_rate.allows(now):
            self._take_hand(page, entry, message, now)

    def _take_hand(self, page: Page, entry: OpenPage, hand: Hand, now: float) -> None:
        """
        Pass a velocity on at once, or drop it; it is never kept or sent again.

        The stamp passes unchanged, because only the drive process can tell its age.
        """
        if self.lease.holder is not page or hand.sequence <= entry.sequence:
            return
        entry.sequence = hand.sequence
        self.lease.note_input(page, now)
        self._last_hand = hand
        self.drive.hand(hand)

    def _handle(self, page: Page, entry: OpenPage, message: Message) -> None:
        if isinstance(message, Hello):
            self._welcome(page, entry)
            return
        assert isinstance(message, Request)
        reason = _refusal(page, message, self.lease.holder, self._robot)
        if reason:
            self._answer(page, message, (False, reason))
            return
        now = self._clock()
        if not isinstance(message, UNASKED):
            self.lease.note_input(page, now)
        match message:
            case Take() | Pause() | Resume() | Speed():
                self._answer_later(page, message, self.drive.request(message))
            case Release():
                self._answer_later(page, message, self.drive.released())
            case Lease():
                self._answer(page, message, self._change_lease(page, message.want, now))
            case Start():
                self._answer(page, message, self._start_again())
            case Record():
                self._answer(page, message, self._recorder.switch(page, message.on))
            case RunMotion():
                self._work.spawn(self._run(page, message))
            case _:
                self._work.handle(page, message)

    def _welcome(self, page: Page, entry: OpenPage) -> None:
        async def welcome() -> None:
            motions = await self._work.motions()
            page.send(Welcome(page.may_drive, installed_version(), self._work.folder_name,
                              self._robot, motions))
            for line in self.pages.log_lines:
                page.send(line)
            if self._driven is not None:
                page.send(self._driven)
            entry.shown = {}
            self._show()
        self._work.spawn(welcome())

    def _change_lease(self, page: Page, want: bool, now: float) -> Outcome:
        if not want:
            has_changed = self._lose_lease(page, has_finished=True)
            outcome = has_changed, 'released' if has_changed else 'this page does not drive'
        elif self.lease.ask(page, now):
            self._is_releasing = False
            outcome = True, 'this page drives'
        else:
            outcome = False, 'another page drives'
        self._show()
        return outcome

    def _lose_lease(self, page: Page, has_finished: bool = False) -> bool:
        had_it = self.lease.give_up(page, self._clock(), has_finished)
        if had_it:
            if self._last_hand is not None:
                # Sooner than the lapse of the last velocity.  A zero is never wrong.
                self.drive.hand(replace(self._last_hand, linear_x=0.0, angular_z=0.0))
                self._last_hand = None
            self._recorder.finish(page)
        return had_it

    async def _run(self, page: Page, message: RunMotion) -> None:
        text, name = message.text, file_name(message.name)
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
        # With the texts that it includes, the drive process reads no file.
        run = Run(0, text, name, message.values, message.included)
        answer = self.drive.request(run)
        self._answer_later(page, message, answer)
        if (await answer).is_done:
            await self._show_plan(run)

    async def _show_plan(self, motion: Run | MotionText) -> None:
        """Send each page the plan of the motion that has begun."""
        ask = AskPreview(0, motion.text, motion.name, motion.values, motion.included)
        if (plan := await self._work.plan(ask)) is not None:
            self._driven = Driven(plan)
            self.pages.send(self._driven)

    # From the drive process

    def _take_report(self, report: Report) -> None:
        match report:
            case Stamp():
                if self.lease.holder is not None:
                    self.lease.holder.send(Stamp(report.stamp))
            case State():
                self._state = report
                self._show()
            case Scan():
                self.pages.send_if_free(report)
            case Log():
                self.pages.log(report)
            case Sent():
                self._recorder.take(report.segments, self.lease.holder)
            case MotionText():
                self._work.spawn(self._show_plan(report))
            case Robot():
                self._robot = report
                self.pages.send(report)

    def _process_changed(self) -> None:
        if self.drive.state == 'starting':
            self._state, self._is_releasing = State('standing by'), False
        elif self.drive.state == 'ended':
            self._last_hand = None
            self.reports.note_end()
            self._state = replace(
                self._state, state='ended', velocity=(0.0, 0.0), reason=self.drive.reason,
                watch=None, held_by=None)
            if self.drive.reason:
                self.pages.log(Log('warning', self.drive.reason))
        self._show()

    def _show(self) -> None:
        holder = self.lease.holder
        self.pages.show(
            vars(PageState(
                **vars(self._state), process=self.drive.state, watchers=len(self.pages),
                is_recording=self._recorder.is_on, report=self.reports.newest)),
            lambda page: {'driver': 'nobody' if holder is None else
                          'you' if holder is page else 'another'})

    def tick(self) -> None:
        """Tell the drive process that a page is open; end a lease, and release the robot."""
        now = self._clock()
        holder, state = self.lease.holder, self._state.state
        if holder is not None and self.lease.is_idle(now, state):
            self._lose_lease(holder, has_finished=True)
            self.pages.log(Log('info', f'the lease has ended: no input for {IDLE_TIME:g} s'))
        is_ours = self._robot is not None and self._robot.is_driven_here
        if is_ours and not self._is_releasing and self.lease.is_robot_free(now, state):
            self._is_releasing = True
            self.drive.released()
        super().tick()


def _refusal(page: Page, message: Request, holder: Page | None, robot: Robot | None) -> str:
    """
    Return why a page may not ask for something; empty if it may.

    :param holder: the page that has the lease; None if no page has it
    :param robot: None until it is known
    """
    if not (page.may_drive or isinstance(message, (Pause, *UNASKED))):
        return ONLY_LOOK
    if robot is not None and not robot.is_driven_here:
        return BESIDE if isinstance(message, (Lease, Start, Record, RunMotion)) else ''
    return NO_LEASE if isinstance(message, NEEDS_LEASE) and holder is not page else ''
