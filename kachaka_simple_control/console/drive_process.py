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
Start, watch and end the drive process, and exchange lines with it.

The drive process is the only one that has ROS and that drives.  Nothing is queued for it: a line
that its pipe cannot take at once is refused, and a stop then becomes a signal.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
import contextlib
from dataclasses import replace
import os
import re
import signal
import subprocess
import sys
from typing import Any, Literal

from kachaka_simple_control.console.command_pipe import CommandPipe
from kachaka_simple_control.files.protocol import (
    Alive,
    Answer,
    Fleet,
    FleetState,
    Hand,
    Log,
    MAX_SIZE,
    MessageError,
    read_report,
    Release,
    Report,
    Request,
    Robot,
    State,
    Stop,
    write_line,
)
from kachaka_simple_control.process.output import has_room, STDERR
from kachaka_simple_control.process.processes import child_environment, python_command
from kachaka_simple_control.process.waiting import POLL_PERIOD
from kachaka_simple_control.text import escaped

#: The module of the drive process.
MODULE = 'kachaka_simple_control.__main__'
#: That of a fleet.
FLEET_MODULE = 'kachaka_simple_control.commands.fleet'
#: A stop that comes so soon after another, with nothing in between, shares its answer [s].
SAME_STOP = 0.1
#: No velocity of the hand is written while so much is unread [bytes]: about four lines.
MAX_UNREAD = 512
#: The largest line that is read [bytes]; a longer one is dropped.
STREAM_LIMIT = 2 * MAX_SIZE
#: A process that has not answered a stop for this long is stopped by a signal [s].
STOP_PATIENCE = 5.0
#: How long the process has to end by itself after its pipe was closed [s], and then after SIGINT.
END_PATIENCE = 8.0
MAX_TEXT = 2000
ProcessState = Literal['starting', 'running', 'ended']
Level = Literal['debug', 'info', 'warning', 'error']
_LEVEL = re.compile(r'\[(DEBUG|INFO|WARN|ERROR|FATAL)\]')
_LEVELS: dict[str, Level] = {
    'DEBUG': 'debug', 'INFO': 'info', 'WARN': 'warning', 'ERROR': 'error', 'FATAL': 'error'}


class DriveProcess:
    """
    The drive process of a console; one at a time, started again after a release.

    All methods must be called in the thread of the event loop.

    :param on_report: is called with each report
    :param on_change: is called when ``state`` has changed
    :ivar state: ``starting`` until the process has found its robot, then ``running``; ``ended`` if
        there is no process, and only a person's press starts a new one
    :ivar reason: why the last process ended; None before that
    """

    def __init__(
            self, command: Callable[[], Sequence[str]], on_report: Callable[[Report], None],
            on_change: Callable[[], None]) -> None:
        self.state: ProcessState = 'ended'
        self.reason: str | None = None
        self._command = command
        self._on_report, self._on_change = on_report, on_change
        self._process: asyncio.subprocess.Process | None = None
        self._pipe = CommandPipe()
        self._next_id = 0
        self._sequence = 0
        self._waiting: dict[int, asyncio.Future[Answer]] = {}
        self._stop: asyncio.Future[Answer] | None = None
        self._stop_time = 0.0
        self._errors: deque[str] = deque(maxlen=5)
        self._stated_reason: str | None = None
        self._is_released = self._is_closing = False
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def pid(self) -> int | None:
        """Return the process ID; None if there is no process."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start a process, if there is none."""
        if self.state != 'ended' or self._is_closing:
            return
        # The pipe comes first: a stop while the process starts waits for it there.
        reading, writing = os.pipe2(os.O_CLOEXEC)
        self._pipe.open(writing)
        self._is_released, self._stated_reason = False, None
        self._errors.clear()
        self._change('starting')
        self._spawn(self._run(reading))

    def request(self, command: Request) -> asyncio.Future[Answer]:
        """
        Send a command at once, and return the future of its answer.

        The future never fails: if the command cannot be sent, or the process ends, its answer is
        not done and says why.

        :param command: the command; it is sent with a new ``id``
        """
        self._stop = None  # what is sent now comes after that stop
        self._next_id += 1
        future: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        command = replace(command, id=self._next_id)
        try:
            line = write_line(command)
        except MessageError as error:
            future.set_result(Answer(command.id, False, str(error)))
            return future
        if self.state == 'ended':
            future.set_result(Answer(command.id, False, 'the drive process does not run'))
        elif self._pipe.write(line):
            self._waiting[command.id] = future
            if isinstance(command, Stop):
                asyncio.get_running_loop().call_later(STOP_PATIENCE, self._insist, command.id)
        elif isinstance(command, Stop):
            self._waiting[command.id] = future
            self._interrupt('it does not read its commands')
        else:
            future.set_result(
                Answer(command.id, False, 'the drive process does not read its commands'))
        return future

    def stop(self, now: float) -> asyncio.Future[Answer]:
        """
        Return the answer of a stop; it is sent, unless the same stop has just been sent.

        Who floods with stops must not fill the pipe, where the next command waits behind them.
        """
        if self._stop is None or self._stop.done() or now - self._stop_time >= SAME_STOP:
            self._stop, self._stop_time = self.request(Stop(0)), now
        return self._stop

    def hand(self, hand: Hand) -> bool:
        """Send a velocity with a new ``sequence``, or drop it; return whether it was sent."""
        self._stop = None
        self._sequence += 1
        hand = replace(hand, sequence=self._sequence)
        is_zero = hand.linear_x == hand.angular_z == 0.0
        # What waits in the pipe would be obeyed late.  A zero never does harm.
        return (is_zero or self._pipe.unread < MAX_UNREAD) and self._pipe.write(write_line(hand))

    def keep_alive(self) -> None:
        """Tell the process that a page is open."""
        if self._pipe.unread < MAX_UNREAD:
            self._pipe.write(write_line(Alive()))

    async def close(self) -> None:
        """End the process: close its pipe, and send it signals only if it does not end by that."""
        self._is_closing = True
        self._pipe.close()
        while self._process is None and self._tasks:  # it is being started
            await asyncio.sleep(POLL_PERIOD)
        process = self._process
        for signum in (signal.SIGINT, signal.SIGTERM, None):
            if process is None or await self._has_ended(process, END_PATIENCE):
                break
            if signum is not None:
                with contextlib.suppress(ProcessLookupError):
                    process.send_signal(signum)
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=1.0)

    async def _has_ended(self, process: asyncio.subprocess.Process, patience: float) -> bool:
        try:
            await asyncio.wait_for(process.wait(), patience)
        except asyncio.TimeoutError:
            return False
        return True

    def _spawn(self, work: Any) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _change(self, state: ProcessState) -> None:
        self.state = state
        self._on_change()

    async def _run(self, reading: int) -> None:
        try:
            self._process = process = await asyncio.create_subprocess_exec(
                *self._command(), stdin=reading, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                limit=STREAM_LIMIT, env=child_environment())
        except OSError as error:
            self._pipe.close()
            self._end(f'the drive process cannot be started: {error.strerror}')
            return
        finally:
            os.close(reading)
        assert process.stdout is not None
        assert process.stderr is not None
        await asyncio.gather(
            self._read(process.stdout, self._take_report),
            self._read(process.stderr, self._take_log))
        code = await process.wait()
        self._pipe.close()
        self._process = None
        is_again = self._is_released and code == 0 and not self._is_closing
        self._end(None if is_again else self._reason_of(code))
        if is_again:
            self.start()

    def _reason_of(self, code: int) -> str:
        if self._stated_reason:
            return self._stated_reason
        how = f'by signal {-code}' if code < 0 else f'with exit code {code}'
        last = f': {self._errors[-1]}' if self._errors and code else ''
        return f'the drive process has ended {how}{last}'

    def _end(self, reason: str | None) -> None:
        self.reason = reason
        self._change('ended')
        waiting, self._waiting = self._waiting, {}
        for request_id, future in waiting.items():
            if not future.done():
                future.set_result(Answer(request_id, False, reason or 'the robot was released'))

    async def _read(self, stream: asyncio.StreamReader, take: Callable[[bytes], None]) -> None:
        while True:
            try:
                line = await stream.readline()
            except ValueError:  # longer than the limit; the stream has dropped it
                self._on_report(Log('error', 'the drive process has written too long a line'))
                continue
            if not line:
                return
            take(line)

    def _take_report(self, line: bytes) -> None:
        try:
            report = read_report(line)
        except MessageError as error:
            self._on_report(Log('error', f'a line of the drive process is invalid: {error}'))
            return
        if isinstance(report, Answer):
            future = self._waiting.pop(report.id, None)
            if future is not None and not future.done():
                future.set_result(report)
            return
        if isinstance(report, (State, FleetState)):
            self._stated_reason = report.reason if report.state == 'ended' else None
        self._on_report(report)
        if isinstance(report, (Robot, Fleet)):
            self._change('running')

    def _take_log(self, line: bytes) -> None:
        text = line.decode('utf-8', 'replace').rstrip()
        if not text:
            return
        found = _LEVEL.search(text)
        level = _LEVELS[found[1]] if found else 'info'
        text = escaped(text, MAX_TEXT)
        # A line without a level is of Python or the system: an error, too.
        if found is None or level in ('warning', 'error'):
            self._errors.append(text)
        self._on_report(Log(level, text))
        # A terminal shows the same, unless it is held (Ctrl+S): that must not hold the console.
        if has_room(STDERR):
            print(text, file=sys.stderr, flush=True)

    def released(self) -> asyncio.Future[Answer]:
        """Release the robot; the process ends, and a new one is started."""
        future = self.request(Release(0))
        future.add_done_callback(self._note_release)
        return future

    def _note_release(self, future: asyncio.Future[Answer]) -> None:
        if not future.cancelled() and future.result().is_done:
            self._is_released = True

    def _insist(self, request_id: int) -> None:
        if request_id in self._waiting:
            self._interrupt(f'it has not answered a stop for {STOP_PATIENCE:g} s')

    def _interrupt(self, why: str) -> None:
        """Stop the drive process by SIGINT, which its own stop and its guardian know."""
        if self._process is None:
            return
        self._on_report(Log('error', f'the drive process gets SIGINT, because {why}'))
        with contextlib.suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGINT)


def drive_command(options: Sequence[str], more: Callable[[], list[str]]) -> list[str]:
    """Return the command line of the drive process."""
    # The page has asked about the floor before it sends a command.
    return [*python_command(MODULE), '--pipe', '--yes', *more(), *options]


def fleet_command(
        fleet: str, options: Sequence[str], more: Callable[[], list[str]]) -> list[str]:
    """Return the command line of the drive process of a fleet, by the name or path of its file."""
    return [*python_command(FLEET_MODULE), fleet, '--pipe', *more(), *options]
