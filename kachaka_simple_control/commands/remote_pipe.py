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
Execute the commands of another program, and report the state to it, over two pipes.

The lines are those of ``files/protocol.py``.

Tested by test/commands/test_remote_control.py and test/commands/test_fleet_remote.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import contextlib
import math
import os
import signal
import threading
import time

from kachaka_simple_control.commands.remote_reports import ReportWriter
from kachaka_simple_control.control.robot_drive import UNDER_WAY
from kachaka_simple_control.control.timing import REMOTE_REPORT_PERIOD, REMOTE_STATE_PERIOD
from kachaka_simple_control.errors import ControlError, InvalidMotionError, UsageError
from kachaka_simple_control.files import protocol
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.ros.drive_node import DriveNode

#: How many bytes of commands are read at once.
READ_SIZE = 65536


class RemotePipe:
    """
    Executes ``stop``, ``pause`` and ``resume`` for all robots of a node, and reports the state.

    One thread executes commands, and waits for no other command: a stop is executed at once.  One
    writes the state after each change and, for its figures, often during a drive.

    :param source: the file that commands are read from
    """

    #: the classes of the commands that are known, by type
    COMMANDS: Mapping[str, type[protocol.Command]] = protocol.COMMANDS

    def __init__(self, node: DriveNode, source: int, writer: ReportWriter) -> None:
        self._commander, self._robots = node.commander, [*node.robots.values()]
        self._source, self._writer = source, writer
        #: why the last drive ended early
        self._reason: str | None = None
        #: the number of the command ``release``; None before it
        self._release: int | None = None
        #: ensures that the state ``ended`` is the last one that is written
        self._state_lock = threading.Lock()
        self._is_over = False
        #: set when there may be something to report
        self._has_changed = threading.Event()

    def _start_threads(self) -> None:
        for target in (self._read_commands, self._write_reports):
            self._start_thread(target)

    def finish(self) -> None:
        """Report that the program ends, and answer ``release``, after the robots were released."""
        signum = signal_dispatcher.signum
        reason = self._reason if signum is None else f'stopped by {signal.Signals(signum).name}'
        with self._state_lock:
            self._is_over = True
            self._writer.write(self._last_state(reason))
        self._has_changed.set()
        if self._release is not None:
            self._writer.write(protocol.Answer(self._release, True, 'released'))

    def _state(self) -> protocol.Report:
        """Return the state as it is now."""
        raise NotImplementedError

    def _last_state(self, reason: str | None) -> protocol.Report:
        """Return the state of a program that ends."""
        raise NotImplementedError

    def _write_more(self) -> None:
        """Write what is due besides the state."""

    def _on_sign_of_life(self) -> None:
        """React to any line of the other program."""

    def _on_closed(self) -> None:
        """React to the end of the commands."""

    def _read_commands(self) -> None:
        rest = b''
        try:
            while (data := os.read(self._source, READ_SIZE)) and len(rest) <= protocol.MAX_SIZE:
                self._on_sign_of_life()
                *lines, rest = (rest + data).split(b'\n')
                for line in lines:
                    self._execute_line(line)
        finally:
            # Also after an error: nobody else would hear a stop.
            self._on_closed()

    def _execute_line(self, line: bytes) -> None:
        try:
            self._execute(protocol.read_command(line, self.COMMANDS))
        except protocol.MessageError as error:
            self._writer.log('error', f'a command was not executed: {error}')

    def _execute(self, command: protocol.Command) -> None:
        """Execute a command; all that may take time is done in another thread."""
        match command:
            case protocol.Stop():
                changes = self._commander.changes
                self._start_thread(lambda: self._stop(command.id, changes))
            case protocol.Pause():
                self._answer(command.id, self._commander.pause)
            case protocol.Resume():
                self._start_thread(lambda: self._answer(
                    command.id, self._commander.resume_when_confirmed))

    def _stop(self, number: int, changes: int) -> None:
        is_done, text = True, ''
        try:
            text = self._commander.stop('a remote stop')
        except ControlError as error:
            is_done, text = False, str(error)
        # Whoever drives next begins as after the start, and not paused or slowed down by others.
        with contextlib.suppress(ControlError):  # it was stopped for good
            self._commander.begin_anew(changes, min(
                robot.settings.parameters.speed_factor for robot in self._robots))
        self._writer.write(protocol.Answer(number, is_done, text, self._is_stop_confirmed()))

    def _is_stop_confirmed(self) -> bool | None:
        """Return whether odometry shows all robots at rest; None if none has odometry."""
        now = time.monotonic()
        seen = [robot.odometry.still_since(now) is not None for robot in self._robots
                if robot.odometry.age(now) is not None]
        return all(seen) if seen else None

    def _write_reports(self) -> None:
        newest, written = None, -math.inf
        self._has_changed.set()
        while not self._is_over:
            if not self._is_under_way():
                self._has_changed.wait(REMOTE_STATE_PERIOD - REMOTE_REPORT_PERIOD)
            time.sleep(REMOTE_REPORT_PERIOD)
            self._has_changed.clear()
            self._write_more()
            state, now = self._state(), time.monotonic()
            if state != newest or now - written >= REMOTE_STATE_PERIOD:
                newest, written = state, now
                with self._state_lock:
                    if not self._is_over:
                        self._writer.write(state)
            self._writer.write_scan(now)

    def _is_under_way(self) -> bool:
        return any(progress.state in UNDER_WAY for progress in self._commander.states())

    def _answer(self, number: int, execute: Callable[[], str]) -> None:
        """Execute a command, and answer it."""
        try:
            answer = protocol.Answer(number, True, execute())
        except (ControlError, InvalidMotionError, UsageError) as error:
            answer = protocol.Answer(number, False, str(error))
        self._writer.write(answer)

    @staticmethod
    def _start_thread(function: Callable[[], None]) -> None:
        try:
            threading.Thread(target=function, name='remote', daemon=True).start()
        except RuntimeError:  # the system has no thread left, and a stop must be sent all the same
            function()
