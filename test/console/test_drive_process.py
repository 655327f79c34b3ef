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
"""The drive process: started, watched, started again after a release only, and ended."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import os
from pathlib import Path
import signal
import sys
import time
from typing import Any

from kachaka_simple_control.console import drive_process
from kachaka_simple_control.console.drive_process import DriveProcess
from kachaka_simple_control.files.protocol import (
    Hand,
    Log,
    Pause,
    Report,
    Robot,
    Run,
    Stop,
    Take,
)
from program import children_of
import pytest
from scripted_console import drive_command as scripted

PATIENCE = 10.0


class Watched:
    """A drive process with what it has told."""

    def __init__(self, command: list[str]) -> None:
        self.reports: list[Report] = []
        self.states: list[str] = []
        self.drive = DriveProcess(lambda: command, self.reports.append, self._note)

    def _note(self) -> None:
        self.states.append(self.drive.state)

    async def until(self, condition: Callable[[], Any]) -> None:
        """Return when a condition is true; fail if it is not in time."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, (self.states, self.reports[-5:], self.drive.reason)
            await asyncio.sleep(0.005)

    async def start(self) -> None:
        """Start the process, and return when it has found its robot."""
        self.drive.start()
        await self.until(lambda: self.drive.state == 'running')

    def logs(self) -> str:
        """Return the log."""
        return '\n'.join(report.text for report in self.reports if isinstance(report, Log))


def run(scenario: Callable[[Watched], Any], *words: str, command: list[str] | None = None) -> None:
    async def body() -> None:
        watched = Watched(command or scripted(*words))
        try:
            await scenario(watched)
        finally:
            await watched.drive.close()

    asyncio.run(asyncio.wait_for(body(), 60.0))


def test_it_runs_when_it_has_found_its_robot_and_answers():
    async def scenario(watched: Watched) -> None:
        await watched.start()
        assert ['starting', 'running'] == watched.states
        assert isinstance(next(report for report in watched.reports
                               if not isinstance(report, Log)), Robot)
        answer = await watched.drive.request(Pause(0))
        assert not answer.is_done
        assert 'no motion' in answer.text
        answer = await watched.drive.request(Stop(0))
        assert answer.is_done
        assert answer.is_confirmed
        await watched.until(lambda: 'started' in watched.logs())

    run(scenario)


def test_a_stop_at_the_press_of_start_is_sent():
    async def scenario(watched: Watched) -> None:
        watched.drive.start()
        answer = await watched.drive.request(Stop(0))
        assert answer.is_done

    run(scenario)


def test_after_a_release_a_new_process_is_started():
    async def scenario(watched: Watched) -> None:
        await watched.start()
        first = watched.drive.pid
        assert (await watched.drive.request(Take(0))).is_done
        assert (await watched.drive.released()).is_done
        await watched.until(lambda: watched.states == [
            'starting', 'running', 'ended', 'starting', 'running'])
        assert watched.drive.pid not in (None, first)
        assert watched.drive.reason is None

    run(scenario)


@pytest.mark.parametrize('signum, reason', [
    (signal.SIGINT, 'stopped by a signal'), (signal.SIGKILL, 'by signal 9')])
def test_after_a_permanent_stop_only_a_press_starts_a_new_one(signum: int, reason: str):
    async def scenario(watched: Watched) -> None:
        await watched.start()
        assert watched.drive.pid
        pause = watched.drive.request(Take(0))
        os.kill(watched.drive.pid, signum)
        await watched.until(lambda: watched.drive.state == 'ended')
        assert (watched.drive.reason or '').endswith(reason)
        await pause
        await asyncio.sleep(0.5)
        assert watched.drive.state == 'ended'
        answer = await watched.drive.request(Stop(0))
        assert not answer.is_done
        watched.drive.start()
        await watched.until(lambda: watched.drive.state == 'running')

    run(scenario)


def test_an_exit_without_a_release_is_permanent():
    async def scenario(watched: Watched) -> None:
        watched.drive.start()
        await watched.until(lambda: watched.drive.state == 'ended')
        assert 'with exit code 0' in (watched.drive.reason or '')
        assert ['starting', 'ended'] == watched.states

    run(scenario, command=[sys.executable, '-c', ''])


def test_a_program_that_cannot_be_started_is_named():
    async def scenario(watched: Watched) -> None:
        watched.drive.start()
        await watched.until(lambda: watched.drive.state == 'ended')
        assert 'cannot be started' in (watched.drive.reason or '')

    run(scenario, command=['/nowhere/python'])


def test_nothing_of_the_hand_waits_for_a_process_that_does_not_read(tmp_path: Path):
    record = tmp_path / 'lines'

    async def scenario(watched: Watched) -> None:
        await watched.start()
        assert watched.drive.pid
        os.kill(watched.drive.pid, signal.SIGSTOP)
        sent = [watched.drive.hand(Hand(number, 1.0, 0.2, 0.0)) for number in range(1000)]
        assert sum(sent) < 10
        assert watched.drive.hand(Hand(2000, 1.0, 0.0, 0.0))  # a zero is never wrong
        os.kill(watched.drive.pid, signal.SIGCONT)
        await watched.drive.request(Stop(0))
        assert record.read_text().count('"hand"') == sum(sent) + 1

    run(scenario, f'--record={record}')


def test_a_stop_that_finds_the_pipe_full_is_a_signal():
    async def scenario(watched: Watched) -> None:
        await watched.start()
        begun = time.monotonic()
        refused = []
        for _ in range(10):
            future = watched.drive.request(Run(0, 'x' * 60_000, 'long'))
            refused += [future] if future.done() else []
        assert refused
        assert 'does not read' in refused[0].result().text
        answer = await watched.drive.request(Stop(0))
        assert 'stopped by a signal' in answer.text
        assert time.monotonic() - begun < 2.0

    run(scenario, '--deaf')


def test_at_the_end_the_pipe_is_closed_and_the_process_ends_by_itself():
    async def scenario(watched: Watched) -> None:
        await watched.start()
        pid = watched.drive.pid
        begun = time.monotonic()
        await watched.drive.close()
        assert time.monotonic() - begun < 2.0
        assert not Path(f'/proc/{pid}').exists()
        assert 'signal' not in (watched.drive.reason or '')
        watched.drive.start()
        assert watched.drive.state == 'ended'

    run(scenario)


def test_a_process_that_is_being_started_is_ended(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(drive_process, 'END_PATIENCE', 0.3)
    before = children_of(os.getpid())

    async def scenario(watched: Watched) -> None:
        watched.drive.start()
        await asyncio.sleep(0.0)

    run(scenario, command=[sys.executable, '-c', 'import time; time.sleep(20.0)'])
    assert children_of(os.getpid()) == before


def test_a_process_that_does_not_end_gets_signals(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(drive_process, 'END_PATIENCE', 0.3)

    async def scenario(watched: Watched) -> None:
        await watched.start()
        pid = watched.drive.pid
        await watched.drive.close()
        assert not Path(f'/proc/{pid}').exists()

    run(scenario, '--deaf')
