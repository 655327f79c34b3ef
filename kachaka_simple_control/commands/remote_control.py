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
Drive a robot as another program commands on standard input; reports go to standard output.

The lines are those of ``files/protocol.py``.  The console uses this, and so may any program.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from dataclasses import replace
from queue import SimpleQueue
import threading

from kachaka_simple_control.commands.remote_commands import RemoteCommands
from kachaka_simple_control.commands.remote_reports import ReportWriter, state_of
from kachaka_simple_control.commands.settings import Settings
from kachaka_simple_control.control.drive_requests import DriveRequest
from kachaka_simple_control.control.events import DriveState
from kachaka_simple_control.control.hand_source import HandSource
from kachaka_simple_control.control.robot_drive import DriveProgress
from kachaka_simple_control.control.timing import (
    HAND_PERIOD,
    REMOTE_REST_TIMEOUT,
    REMOTE_SILENCE_TIMEOUT,
)
from kachaka_simple_control.errors import (
    ControlError,
    InvalidMotionError,
    MotionRefusedError,
    MotionRunningError,
)
from kachaka_simple_control.files import protocol
from kachaka_simple_control.files.included_texts import find_among
from kachaka_simple_control.files.motion_file import MotionFile
from kachaka_simple_control.files.motion_reader import find_included, loads
from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.process.waiting import wait_until
from kachaka_simple_control.text import quoted

#: The name of the speed factor that the commands keep valid while a motion runs.
REMOTE = 'remote control'


class RemoteControl(RemoteCommands):
    """
    Drives a robot as lines on standard input command.

    Nothing is sent before the command ``take``.  Then the robot is driven by hand, and by ``run``
    in a motion, until a stop or a fault: it is no longer taken.  While a motion runs, the commands
    keep a speed factor valid: after REMOTE_SILENCE_TIMEOUT (1 s) without any, nobody could stop
    it, and the robot is held until ``resume``.

    The main thread drives.  One executes the commands, and waits for no other command: a stop is
    executed at once.  One writes reports.

    :param choose: chooses rate, limits and kind of control for a motion file; raises an error if
        the robot cannot drive it so
    """

    IS_DRIVER = True

    def __init__(
            self, robot_control: KachakaSimpleControl, source: int, writer: ReportWriter,
            choose: Callable[[MotionFile], Settings]) -> None:
        super().__init__(robot_control, source, writer)
        self._choose = choose
        #: what the main thread does next; None ends it
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        #: protects what follows: a stop cancels all that was commanded before it
        self._lock = threading.Lock()
        self._stop_count = 0
        self._is_taken = False
        self._is_running_motion = False
        self._hand: HandSource | None = None
        #: the number of the command that takes the robot, while this is not answered yet
        self._take: int | None = None
        self._refusal = ''

    def serve(self) -> None:
        """
        Drive until the command ``release`` comes, or until standard input is closed.

        :raises ControlError: if a signal or the guardian has stopped the robot permanently
        """
        self.start()
        try:
            while (job := self._jobs.get()) is not None:
                job()
        except Exception as error:
            self._reason = str(error)
            raise

    def _on_sign_of_life(self) -> None:
        """Keep the speed factor of a motion valid; pause a motion whose factor has expired."""
        with self._lock:
            if not self._is_running_motion:
                return
            if self._robot.speed_factor.factors.get(REMOTE) == 0.0:
                # Who is there again may not know that the motion was held.
                self._pause()
            self._robot.speed_factor.set(REMOTE, 1.0, REMOTE_SILENCE_TIMEOUT)

    def _execute(self, command: protocol.Command) -> None:
        """Execute a command; all that may take time is done in another thread."""
        match command:
            case protocol.Hand():
                self._command_hand(command)
            case protocol.Stop():
                self._cancel()
                super()._execute(command)
            case protocol.Take():
                self._answer_failure(command.id, lambda: self._begin_to_take(command.id))
            case protocol.Run():
                stop_count = self._stop_count
                self._start_thread(lambda: self._answer(
                    command.id, lambda: self._accept_motion(command, stop_count)))
            case protocol.Release():
                self._release = command.id
                self._cancel()
                self._start_thread(self._end)
            case _:
                super()._execute(command)

    def _command_hand(self, command: protocol.Hand) -> None:
        hand = self._hand
        if hand is None:
            return
        try:
            hand.command(
                Velocity(command.linear_x, command.angular_z), command.sequence, command.stamp)
            self._refusal = ''
        except (MotionRefusedError, InvalidMotionError) as error:
            if str(error) != self._refusal:  # once, not 20 times a second
                self._refusal = str(error)
                self._writer.log('warning', f'a command by hand was refused: {error}')

    def _begin_to_take(self, number: int) -> None:
        with self._lock:
            if self._take is not None:
                raise MotionRefusedError('the robot is being taken already')
            if self._is_taken:
                # Somebody else sends the commands now, as when a page is opened again.
                self._writer.write(protocol.Answer(number, True, 'ready'))
                return
            # From now on a stop ends this drive, even before the robot is found.
            request = self._commander.request(elsewhere=True)
            self._is_taken, self._take, self._reason = True, number, None
            self._jobs.put(lambda: self._drive_by_hand(request))

    def _accept_motion(self, command: protocol.Run, stop_count: int) -> str:
        """
        Check a motion, and let the main thread drive it; return a text for the user.

        :raises ControlError: if the motion may not be driven now
        :raises InvalidMotionError: if the robot cannot drive the motion
        """
        robot = self._robot_control
        motion_file = loads(
            command.text, command.name, command.values,
            find_included if command.included is None else find_among(command.included))
        if motion_file.robot not in (None, robot.node_parameters.robot):
            raise motion_file.error_at('robot', (
                f'{quoted(motion_file.robot, 60)}, and this is {robot.profile.name}: leave it '
                'out, or start with --robot'))
        settings, used = self._choose(motion_file), robot.node_parameters
        for name in ('closed_loop', 'watch'):
            wanted = getattr(settings, name)
            if getattr(motion_file, name) is not None and wanted != getattr(used, name):
                text = str(wanted).lower()
                raise motion_file.error_at(name, (
                    f'{text}, and this drive was started otherwise: leave it out, or start with '
                    f'-p {name}:={text} after --ros-args'))
        corners = used.corners or motion_file.motion.corners
        order = replace(motion_file, motion=replace(motion_file.motion, corners=corners)).order(
            robot.profile, settings.rate, used.closed_loop, watch=used.watch)
        with self._lock:
            if self._stop_count != stop_count:
                raise MotionRefusedError('a stop came after the command')
            if not self._is_taken:
                raise MotionRefusedError('the robot is not taken: take it first')
            if self._is_running_motion:
                raise MotionRunningError(
                    'a motion is running already; wait for its end, or stop it')
            self._is_running_motion = True
            self._robot.speed_factor.set(REMOTE, 1.0, REMOTE_SILENCE_TIMEOUT)
            self._jobs.put(lambda: self._drive_motion(order))
            self._jobs.put(lambda: self._drive_by_hand(None))
            if self._hand is not None:
                self._hand.end()
        return 'started'

    def _drive_by_hand(self, request: DriveRequest | None) -> None:
        """
        Drive by hand until the hand's drive ends, in the main thread.

        :param request: accepted, perhaps cancelled by a stop; None to request it, unless a stop
            came
        """
        hand = HandSource(
            self._robot_control.profile.planning_limits,
            self._robot.drive.on_source_changed, cut=self._robot.cut)
        with self._lock:
            if request is None:
                if not self._is_taken:
                    return
                request = self._commander.request()
            self._hand = hand
            if not self._jobs.empty():  # a motion was commanded meanwhile
                hand.end()
        try:
            self._commander.drive_source(
                self._robot, 'by hand', hand, HAND_PERIOD, request)
        except ControlError as error:
            self._on_failure(error)
        finally:
            self._hand = None

    def _drive_motion(self, order: DriveOrder) -> None:
        """Drive a motion in the main thread, unless a stop has come since it was accepted."""
        try:
            with self._lock:
                if not self._is_taken:
                    return
                request = self._commander.request()
            self._robot_control.drive(order, request)
        except ControlError as error:
            self._on_failure(error)
        finally:
            with self._lock:
                self._is_running_motion = False
                self._robot.speed_factor.set(REMOTE, 1.0)

    def _on_failure(self, error: ControlError) -> None:
        """
        Record that a drive has ended early; the robot was stopped and is no longer taken.

        :raises ControlError: if the robot was stopped permanently
        """
        self._cancel()
        self._reason = str(error) if self._release is None else None
        self._has_changed.set()
        if (number := self._take) is not None:
            self._take = None
            self._writer.write(protocol.Answer(number, False, str(error)))
        if self._commander.is_stopped_permanently:
            raise error

    def _cancel(self) -> None:
        """Cancel all that was commanded so far and has not begun."""
        with self._lock:
            self._stop_count += 1
            self._is_taken = False

    def _end(self) -> None:
        """Stop the robot if it is taken, and end the main thread."""
        try:
            self._commander.stop('the end of remote control')
        except ControlError as error:
            self._reason = str(error)
        self._jobs.put(None)

    def _pause(self) -> None:
        with contextlib.suppress(ControlError):  # it was stopped for good: nothing to pause
            self._commander.pause()

    def _on_closed(self) -> None:
        """Stop the hand at once, and bring a motion to rest before it is stopped."""
        if (hand := self._hand) is not None:
            hand.stop()
        elif self._is_running_motion:
            self._pause()
            wait_until(lambda: self._robot.drive.is_at_rest, REMOTE_REST_TIMEOUT)
        self._cancel()
        self._end()

    def _is_under_way(self) -> bool:
        return self._hand is not None or super()._is_under_way()

    def _write_more(self) -> None:
        """Write a stamp for the hand, and the answer to ``take`` when the robot is ready."""
        if (hand := self._hand) is not None:
            self._writer.write(protocol.Stamp(hand.stamp()))
        if self._take is not None and self._progress.state in (
                DriveState.DRIVING, DriveState.PAUSED):
            number, self._take = self._take, None
            self._writer.write(protocol.Answer(number, True, 'ready'))

    def _drive_state(self, progress: DriveProgress) -> protocol.State:
        return state_of(
            self._robot, progress, self._writer.velocity, self._is_taken,
            is_by_hand=self._hand is not None, reason=self._reason)

    def _answer_failure(self, number: int, execute: Callable[[], None]) -> None:
        """Execute a command that is answered later; answer now only if it is refused."""
        try:
            execute()
        except ControlError as error:
            self._writer.write(protocol.Answer(number, False, str(error)))
