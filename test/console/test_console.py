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
"""The lease and the release of the robot in time, with a clock that the test sets."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
import os
import signal
import time
from typing import Any

from kachaka_simple_control.console.console import Console
from kachaka_simple_control.console.drive_process import DriveProcess
from kachaka_simple_control.console.folder import Folder
from kachaka_simple_control.console.lease import IDLE_TIME
from kachaka_simple_control.console.page_protocol import (
    Hello,
    Lease,
    ListMotions,
    PageAnswer,
    RunMotion,
    StateChanges,
)
from kachaka_simple_control.console.preview import PreviewWorker
from kachaka_simple_control.console.reports import Reports
from kachaka_simple_control.files.messages import Message, to_json
from kachaka_simple_control.files.protocol import Pause, Scan, Speed, State, Take, Watch
import pytest
from scripted_console import drive_command as scripted

pytestmark = pytest.mark.real_time


class FakePage:
    """A page that keeps what it is sent."""

    may_drive = True
    is_behind = False

    def __init__(self, console: Console) -> None:
        self.console, self.messages, self.state = console, [], {}
        console.open_page(self)
        self.tell(Hello())

    def send(self, message: Message) -> None:
        """Keep a message."""
        self.messages.append(message)
        if isinstance(message, StateChanges):
            self.state.update(message.changes)

    def tell(self, message: Message) -> None:
        """Send a message to the console."""
        self.console.receive(self, to_json(message))

    async def until(self, condition: Callable[[], Any]) -> None:
        """Return when a condition is true; fail if it is not in time."""
        end = time.monotonic() + 10.0
        while not condition():
            assert time.monotonic() < end, (self.state, self.messages[-3:])
            await asyncio.sleep(0.005)

    async def ask(self, message: Any) -> bool:
        """Send a request, and return whether it is done."""
        self.tell(message)
        found: list[PageAnswer] = []

        def is_answered() -> bool:
            found[:] = [sent for sent in self.messages if isinstance(sent, PageAnswer)
                        and sent.id == message.id]
            return bool(found)

        await self.until(is_answered)
        return found[0].is_done


def run(scenario: Callable[[Console, list[float]], Any], *words: str) -> None:
    """Run a scenario with a console and the time on its clock, which the scenario may change."""
    async def body() -> None:
        now, folder = [1000.0], Folder(None)
        console = Console(
            partial(DriveProcess, partial(scripted, *words)), folder,
            PreviewWorker(None, folder), Reports(None), lambda: now[0])
        console.start()
        try:
            await scenario(console, now)
        finally:
            await console.close()

    asyncio.run(asyncio.wait_for(body(), 30.0))


async def taken(console: Console) -> FakePage:
    """Return a page that has taken the robot."""
    page = FakePage(console)
    await page.until(lambda: page.state.get('process') == 'running')
    assert await page.ask(Lease(1, True))
    assert await page.ask(Take(2))
    await page.until(lambda: page.state['state'] == 'ready')
    return page


async def paused(console: Console) -> FakePage:
    """Return a page that has begun a motion and paused it."""
    page = await taken(console)
    assert await page.ask(RunMotion(3, text='steps: []'))
    await page.until(lambda: page.state['state'] == 'driving')
    assert await page.ask(Pause(4))
    await page.until(lambda: page.state['state'] == 'paused')
    return page


def test_a_page_that_is_behind_gets_no_scans_and_a_hold_ends_with_its_process():
    async def scenario(console: Console, now: list[float]) -> None:
        page, slow = FakePage(console), FakePage(console)
        await page.until(lambda: page.state.get('process') == 'running')
        await page.until(lambda: slow.state)
        slow.is_behind = True
        console._take_report(State('paused', watch=Watch('obstacle', 0.3), held_by='a wall'))
        console._take_report(Scan((0.0, 0.0, 0.0), ((1.0, 0.0),)))
        assert [message for message in page.messages if isinstance(message, Scan)]
        assert not [message for message in slow.messages if isinstance(message, Scan)]
        assert page.state['held_by'] == 'a wall'
        os.kill(console.drive.pid, signal.SIGKILL)
        await page.until(lambda: page.state['process'] == 'ended')
        assert (page.state['watch'], page.state['held_by']) == (None, None)

    run(scenario)


def test_the_lease_ends_without_input_and_the_robot_is_released():
    async def scenario(console: Console, now: list[float]) -> None:
        page = await taken(console)
        now[0] += IDLE_TIME - 1.0
        console.tick()
        assert 'you' == page.state['driver']
        assert await page.ask(Speed(3, 0.5))  # this is input
        now[0] += IDLE_TIME - 1.0
        console.tick()
        assert 'you' == page.state['driver']
        page.tell(ListMotions(4))  # this is not: a page asks for it by itself
        now[0] += 1.0
        console.tick()
        assert 'nobody' == page.state['driver']
        await page.until(lambda: page.state['state'] == 'standing by')
        await page.until(lambda: page.state['process'] == 'running')

    run(scenario)


def test_the_lease_does_not_end_while_a_motion_is_driven_or_paused():
    async def scenario(console: Console, now: list[float]) -> None:
        page = await taken(console)
        assert await page.ask(RunMotion(3, text='steps: []'))
        await page.until(lambda: page.state['state'] == 'driving')
        now[0] += 2.0 * IDLE_TIME
        console.tick()
        assert 'you' == page.state['driver']
        assert await page.ask(Pause(4))
        await page.until(lambda: page.state['state'] == 'paused')
        now[0] += 2.0 * IDLE_TIME
        console.tick()
        assert 'you' == page.state['driver']

    run(scenario)


async def released_after_a_minute(
        console: Console, now: list[float], page: FakePage, state: str) -> None:
    """Fail unless the robot stays in its state for a minute, and is released then."""
    now[0] += IDLE_TIME - 1.0
    console.tick()
    await asyncio.sleep(0.2)
    assert state == page.state['state']
    now[0] += 1.0
    console.tick()
    await page.until(lambda: page.state['state'] == 'standing by')


@pytest.mark.parametrize('is_closed', [True, False])
def test_a_paused_robot_that_nobody_drives_is_released_after_a_minute(is_closed):
    async def scenario(console: Console, now: list[float]) -> None:
        page, other = await paused(console), FakePage(console)
        if is_closed:
            console.close_page(page)
        else:
            assert await page.ask(Lease(5, False))
        await other.until(lambda: other.state.get('driver') == 'nobody')
        await released_after_a_minute(console, now, other, 'paused')

    run(scenario)


def test_the_robot_is_released_only_after_a_motion_that_is_driven():
    async def scenario(console: Console, now: list[float]) -> None:
        page = await taken(console)
        assert await page.ask(RunMotion(3, text='steps: []'))
        await page.until(lambda: page.state['state'] == 'driving')
        assert await page.ask(Lease(4, False))
        now[0] += 2.0 * IDLE_TIME
        console.tick()
        await asyncio.sleep(0.2)
        assert 'driving' == page.state['state']
        await page.until(lambda: page.state['state'] == 'standing by')
        assert page.state['reason'] is None

    run(scenario, '--duration=1.5')
