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
Let another program stop, pause, resume and slow down a drive, and report its state.

Over two pipes, in the lines of ``files/protocol.py``.

Tested by test/commands/test_remote_control.py.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from dataclasses import replace
import math
import os
import signal
import threading
import time

from kachaka_simple_control.commands.remote_reports import ReportWriter, state_of
from kachaka_simple_control.control.events import Event, OdometryReceived
from kachaka_simple_control.control.robot_drive import DriveProgress, UNDER_WAY
from kachaka_simple_control.control.timing import REMOTE_REPORT_PERIOD, REMOTE_STATE_PERIOD
from kachaka_simple_control.errors import (
    ControlError,
    InvalidMotionError,
    MotionRefusedError,
    UsageError,
)
from kachaka_simple_control.files import protocol
from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.process.signals import signal_dispatcher
from kachaka_simple_control.ros.robot_info import RobotInfo

#: How many bytes of commands are read at once.
READ_SIZE = 65536


class RemoteCommands:
    """
    Executes ``stop``, ``pause``, ``resume`` and ``speed`` beside a drive, and writes reports.

    One thread executes them, and waits for no other command: a stop is executed at once.
    """

    #: whether the robot is driven by these commands
    IS_DRIVER = False

    def __init__(
            self, robot_control: KachakaSimpleControl, source: int, writer: ReportWriter) -> None:
        self._robot_control = robot_control
        self._robot = robot_control.robot
        self._commander = robot_control.commander
        # Only a Kachaka tells something about itself.
        self._info = RobotInfo(
            robot_control, robot_control.node_parameters.robot_namespace
        ) if robot_control.profile.is_kachaka else None
        self._source = source
        self._writer = writer
        #: why the last drive ended early
        self._reason: str | None = None
        #: ensures that the state ``ended`` is the last one that is written
        self._state_lock = threading.Lock()
        self._is_over = False
        #: set when there may be something to report
        self._has_changed = threading.Event()
        self._was_still = False

    def start(self) -> None:
        """Write the report ``robot``, and start the threads."""
        self._robot_control.event_bus.subscribe(self._on_event)
        self._writer.write(protocol.Robot(
            **self._writer.describe(self._robot_control), is_driven_here=self.IS_DRIVER))
        for target in (self._read_commands, self._write_reports):
            self._start_thread(target)

    def finish(self) -> None:
        """Report that the program ends, after the robot was released."""
        signum = signal_dispatcher.signum
        reason = self._reason if signum is None else f'stopped by {signal.Signals(signum).name}'
        with self._state_lock:
            self._is_over = True
            self._writer.write(protocol.State('ended', reason=reason))
        self._has_changed.set()

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

    def _on_sign_of_life(self) -> None:
        """React to any line of the other program."""

    def _on_closed(self) -> None:
        """React to the end of the commands."""

    def _execute_line(self, line: bytes) -> None:
        try:
            self._execute(protocol.read_command(line))
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
            case protocol.Speed():
                self._start_thread(lambda: self._answer(
                    command.id, lambda: self._set_speed(command.factor)))
            case protocol.Request():
                self._answer(command.id, self._refuse)

    @staticmethod
    def _refuse() -> str:
        raise MotionRefusedError(
            'another program drives the robot; from here it can be stopped, paused, resumed and '
            'slowed down')

    def _stop(self, number: int, changes: int) -> None:
        is_done, odometry = True, self._robot.odometry
        try:
            text = self._commander.stop('a remote stop')
        except ControlError as error:
            is_done, text = False, str(error)
        # Whoever drives next begins as after the start, and not paused or slowed down by others.
        with contextlib.suppress(ControlError):  # it was stopped for good
            self._commander.begin_anew(changes, self._robot_control.node_parameters.speed_factor)
        now = time.monotonic()
        is_confirmed = None if odometry.age(now) is None else (
            odometry.still_since(now) is not None)
        self._writer.write(protocol.Answer(number, is_done, text, is_confirmed))

    def _set_speed(self, factor: float) -> str:
        self._commander.set_speed(factor)
        return f'{factor:.0%}'

    def _on_event(self, event: Event) -> None:
        self._writer.on_event(event)
        if isinstance(event, OdometryReceived):
            was_still, self._was_still = self._was_still, event.is_still
            if was_still and event.is_still:
                return
        self._has_changed.set()

    def _write_reports(self) -> None:
        """Write the state: after each event and, for its figures, often during a drive."""
        newest, written = None, -math.inf
        self._has_changed.set()
        while not self._is_over:
            if not self._is_under_way():
                self._has_changed.wait(REMOTE_STATE_PERIOD - REMOTE_REPORT_PERIOD)
            time.sleep(REMOTE_REPORT_PERIOD)
            self._has_changed.clear()
            [progress] = self._commander.states()
            self._write_more(progress)
            state = self._state(progress)
            if (info := self._info) is not None:
                state = replace(state, battery=info.battery, robot_errors=info.errors or None)
            now = time.monotonic()
            if state != newest or now - written >= REMOTE_STATE_PERIOD:
                newest, written = state, now
                with self._state_lock:
                    if not self._is_over:
                        self._writer.write(state)

    def _is_under_way(self) -> bool:
        return any(progress.state in UNDER_WAY for progress in self._commander.states())

    def _write_more(self, progress: DriveProgress) -> None:
        """Write what is due besides the state."""

    def _state(self, progress: DriveProgress) -> protocol.State:
        return state_of(
            self._robot, progress, self._writer.velocity,
            is_taken=progress.state in UNDER_WAY, is_by_hand=False, reason=progress.ended_by)

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
