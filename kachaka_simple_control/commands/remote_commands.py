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

Tested by test/commands/test_remote_control.py.
"""

from __future__ import annotations

from dataclasses import replace

from kachaka_simple_control.commands.remote_pipe import RemotePipe
from kachaka_simple_control.commands.remote_reports import ReportWriter, state_of
from kachaka_simple_control.control.events import Event, OdometryReceived
from kachaka_simple_control.control.robot_drive import DriveProgress, UNDER_WAY
from kachaka_simple_control.errors import MotionRefusedError
from kachaka_simple_control.files import protocol
from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.ros.robot_info import RobotInfo


class RemoteCommands(RemotePipe):
    """Executes ``stop``, ``pause``, ``resume`` and ``speed`` beside a drive of one robot."""

    #: whether the robot is driven by these commands
    IS_DRIVER = False

    def __init__(
            self, robot_control: KachakaSimpleControl, source: int, writer: ReportWriter) -> None:
        super().__init__(robot_control, source, writer)
        self._robot_control = robot_control
        self._robot = robot_control.robot
        # Only a Kachaka tells something about itself.
        self._info = RobotInfo(
            robot_control, robot_control.node_parameters.robot_namespace
        ) if robot_control.profile.is_kachaka else None
        self._was_still = False

    def start(self) -> None:
        """Write the report ``robot``, and start the threads."""
        self._robot_control.event_bus.subscribe(self._on_event)
        self._writer.write(protocol.Robot(
            **self._writer.describe(self._robot_control), is_driven_here=self.IS_DRIVER))
        self._start_threads()

    def _execute(self, command: protocol.Command) -> None:
        match command:
            case protocol.Stop() | protocol.Pause() | protocol.Resume():
                super()._execute(command)
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

    @property
    def _progress(self) -> DriveProgress:
        [progress] = self._commander.states()
        return progress

    def _state(self) -> protocol.State:
        state = self._drive_state(self._progress)
        info = self._info
        return state if info is None else replace(
            state, battery=info.battery, robot_errors=info.errors or None)

    def _drive_state(self, progress: DriveProgress) -> protocol.State:
        return state_of(
            self._robot, progress, self._writer.velocity,
            is_taken=progress.state in UNDER_WAY, is_by_hand=False, reason=progress.ended_by)

    def _last_state(self, reason: str | None) -> protocol.State:
        return protocol.State('ended', reason=reason)
