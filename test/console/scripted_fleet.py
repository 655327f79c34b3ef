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
A drive process of a fleet for tests: it speaks the lines of the console, and imagines the robots.

Each robot follows its plan, and drifts a little to one side.  The first line is made by the real
code from the file of the fleet.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace
import math
import sys

from kachaka_simple_control.commands.fleet_reports import fleet_report, rounded
from kachaka_simple_control.files.fleet_file import find_fleet
from kachaka_simple_control.files.protocol import (
    Answer,
    Command,
    FLEET_COMMANDS,
    FleetState,
    Pause,
    Release,
    Report,
    Request,
    Resume,
    RunFleet,
    Stop,
)
from kachaka_simple_control.fleet.fleet_plan import plan_fleet, PlannedRobot
from kachaka_simple_control.motion.geometry import compose, integrate, Pose
from scripted_drive import parser_of_all, PERIOD, ScriptedDrive, serve

#: How long the robots get ready [s].
TAKING = 0.3
#: How much a robot turns too much, by its place in the fleet [rad].
DRIFTS = (0.02, -0.03, 0.045, -0.015)


class ImaginedRobot:
    """A robot that follows its plan from its start on the floor."""

    def __init__(self, robot: PlannedRobot, drift: float) -> None:
        self.name, self.start, self.plan = robot.name, robot.fleet_robot.start, robot.plan
        self._drift = drift
        self._poses = robot.plan.path()
        self._times = [segment.start for segment in robot.plan.segments]

    def pose_at(self, time: float) -> Pose:
        """Return where it is at a time of its plan."""
        place = max(0, bisect_right(self._times, time) - 1)
        segment = self.plan.segments[place]
        held = min(time, segment.end) - segment.start
        pose = integrate(self._poses[place], segment.velocity, held)
        share = min(1.0, time / self.plan.duration)
        return compose(
            Pose(self.start.x, self.start.y, self.start.theta + self._drift * share), pose)


class ScriptedFleet(ScriptedDrive):
    """The drive process of a fleet."""

    COMMANDS = FLEET_COMMANDS

    def __init__(self, options) -> None:
        super().__init__(options)
        self.plan = plan_fleet(find_fleet(options.fleet))
        self.robots = [
            ImaginedRobot(robot, DRIFTS[number % len(DRIFTS)])
            for number, robot in enumerate(self.plan.robots)]
        self.fleet_state = FleetState('standing by')
        self.round, self.time, self.taking = 0, math.nan, 0.0
        self.words = ['standing by'] * len(self.robots)
        self.poses: list[Pose | None] = [None] * len(self.robots)
        self.written: FleetState | None = None

    def _hello(self) -> None:
        self._write(fleet_report(self.plan))

    def end_state(self, reason: str) -> Report:
        """Return the state of a process that ends."""
        return replace(self.fleet_state, state='ended', reason=reason)

    def _handle(self, command: Command) -> None:
        if isinstance(command, Stop):
            self.stop_ids.append(command.id)
            self._set_whole('stopping', reason='the movement was ended by a remote stop')
        elif isinstance(command, Request):
            refusal = self._refusal(command)
            self._write(Answer(command.id, not refusal, refusal or 'done'))
            if not refusal:
                self._obey(command)

    def _refusal(self, command: Request) -> str:
        state = self.fleet_state.state
        if isinstance(command, RunFleet):
            if self.options.refuse:
                return 'r2: no robot listens'
            is_driven = state in ('taking', 'driving', 'paused')
            return 'a motion is running already' if is_driven else ''
        if isinstance(command, Pause):
            return '' if state == 'driving' else 'nothing is driven'
        return '' if not isinstance(command, Resume) or state == 'paused' else 'nothing is paused'

    def _obey(self, command: Request) -> None:
        if isinstance(command, RunFleet):
            self.round, self.time, self.taking = 1, math.nan, TAKING
            self._set_whole('taking', reason=None, troubles={}, apart=None)
        elif isinstance(command, Pause):
            self._set_whole('paused', speed=0.0)
        elif isinstance(command, Resume):
            self._set_whole('driving', speed=1.0, apart=0.007)
        elif isinstance(command, Release):
            self.end_code = 0

    def _set_whole(self, state, **changes: object) -> None:
        self.words = [state] * len(self.robots)
        self.fleet_state = replace(self.fleet_state, state=state, **changes)

    def _tick(self) -> None:
        state = self.fleet_state.state
        if state == 'taking':
            self.taking -= PERIOD
            if self.taking <= 0.0:
                self.time = 0.0
                self._set_whole('driving')
        elif state == 'driving':
            self._advance()
        elif state == 'stopping':
            for number in self.stop_ids:
                is_confirmed = None if self.options.no_odometry else True
                self._write(Answer(number, True, 'the robots stand still', is_confirmed))
            self.stop_ids.clear()
            self._set_whole('stopped', speed=1.0)
        is_still = None if self.options.no_odometry else self.fleet_state.state != 'driving'
        poses = () if self.options.no_odometry else [
            None if pose is None else rounded(pose) for pose in self.poses]
        self.fleet_state = replace(
            self.fleet_state, round=self.round or None, is_still=is_still,
            plan_time=None if math.isnan(self.time) else round(self.time, 2),
            states=tuple(self.words), poses=tuple(poses))
        if self.fleet_state != self.written:
            self.written = self.fleet_state
            self._write(self.fleet_state)

    def _advance(self) -> None:
        self.time += PERIOD * self.options.pace
        for number, robot in enumerate(self.robots):
            self.poses[number] = robot.pose_at(self.time)
            if self.time >= robot.plan.duration:
                self.words[number] = 'done'
        if self.options.fault and self.time >= self.options.fault_at:
            self._set_whole(
                'stopped', reason=f'{self.options.fault}: the robot has left', troubles={
                    self.options.fault: 'the robot has left: nobody subscribes to its velocities'})
        elif self.time >= self.plan.duration:
            is_last = self.round == self.plan.file.repeat
            self.time, self.taking = math.nan, TAKING
            self._set_whole('standing by' if is_last else 'taking')
            self.words = ['done' if is_last else 'taking'] * len(self.robots)
            self.round += not is_last


def main() -> int:
    """Imagine the robots of a fleet."""
    parser = parser_of_all()
    parser.add_argument('fleet')
    parser.add_argument('--pace', type=float, default=1.0, help='relative to the plan')
    parser.add_argument('--fault', help='the robot that fails')
    parser.add_argument('--fault-at', type=float, default=1.0, help='when it fails [s]')
    options, _ = parser.parse_known_args()
    return serve(ScriptedFleet(options))


if __name__ == '__main__':
    sys.exit(main())
