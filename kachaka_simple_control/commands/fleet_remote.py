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
Drive a fleet as another program commands on standard input; reports go to standard output.

The lines are those of ``files/protocol.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
from dataclasses import replace
import math
import threading
import time

from kachaka_simple_control.commands.fleet_reports import fleet_report, rounded
from kachaka_simple_control.commands.remote_pipe import RemotePipe
from kachaka_simple_control.commands.remote_reports import floor_map, ReportWriter, watch_report
from kachaka_simple_control.control.events import (
    DriveState,
    Event,
    RobotEvent,
    RobotsApart,
    StateChanged,
)
from kachaka_simple_control.control.hold_text import describe_hold, HELD
from kachaka_simple_control.control.robot_drive import DriveProgress, UNDER_WAY
from kachaka_simple_control.control.speed_factor import is_hold, OBSTACLE, PAUSE, product
from kachaka_simple_control.control.timing import REMOTE_REST_TIMEOUT, REMOTE_SILENCE_TIMEOUT
from kachaka_simple_control.errors import ControlError, MotionStoppedError
from kachaka_simple_control.files import protocol
from kachaka_simple_control.fleet.fleet import Fleet
from kachaka_simple_control.motion.geometry import compose, Pose, relative_to
from kachaka_simple_control.process.waiting import wait_until
from kachaka_simple_control.ros.robot import Robot
from kachaka_simple_control.text import escaped

#: The longest text about what is wrong with a robot [characters].
MAX_TROUBLE = 120
_STATES: dict[DriveState, protocol.FloorRobotState] = {
    DriveState.READY: 'standing by', DriveState.WAITING: 'taking', DriveState.CONNECTING: 'taking',
    DriveState.DRIVING: 'driving', DriveState.PAUSED: 'paused', DriveState.STOPPING: 'stopping',
    DriveState.STOPPED: 'done', DriveState.CUT_SHORT: 'stopped'}
#: The state of the whole is the first of these that a robot has.
_WHOLE: tuple[protocol.FleetStateName, ...] = (
    'driving', 'paused', 'taking', 'stopping', 'stopped')


class FleetRemote(RemotePipe):
    """
    Drives a fleet as lines on standard input command.

    Nothing is sent before the command ``run``.  After REMOTE_SILENCE_TIMEOUT (1 s) without any
    command nobody could stop the robots, and they are paused until ``resume``.
    """

    COMMANDS = protocol.FLEET_COMMANDS

    def __init__(self, fleet: Fleet, source: int, writer: ReportWriter) -> None:
        super().__init__(fleet.node, source, writer)
        self._fleet = fleet
        self._starts = [robot.fleet_robot.start for robot in fleet.plan.robots]
        #: where each robot was by odometry at t = 0 of the first round, by its name
        self._origins: dict[str, Pose] = {}
        #: when a command came last [s]; infinite once the robots were paused for its silence
        self._heard = math.inf
        self._apart: float | None = None
        self._ended = threading.Event()

    def serve(self) -> None:
        """
        Drive until the command ``release`` comes, or until standard input is closed.

        :raises ControlError: if a signal or the guardian has stopped a robot permanently
        """
        self._fleet.node.event_bus.subscribe_to_all(
            self._on_events, kinds=(RobotsApart, StateChanged))
        self._writer.write(fleet_report(self._fleet.plan, floor_map(self._writer.floor)))
        self._start_threads()
        try:
            self._ended.wait()
            for robot in self._robots:
                robot.require_not_stopped()
        except ControlError as error:
            self._reason = str(error)
            raise

    def _execute(self, command: protocol.Command) -> None:
        match command:
            case protocol.RunFleet():
                # Here, and not in another thread: a stop that comes later must end it.
                self._answer(command.id, self._run)
            case protocol.Release():
                self._release = command.id
                self._start_thread(self._end)
            case _:
                super()._execute(command)

    def _run(self) -> str:
        text = self._fleet.start()
        self._apart = None
        return text

    def _end(self) -> None:
        """Stop the robots, and end the main thread."""
        try:
            self._commander.stop('the end of remote control')
        except ControlError as error:
            self._reason = str(error)
        self._ended.set()

    def _pause(self) -> None:
        with contextlib.suppress(ControlError):  # it was stopped for good: nothing to pause
            self._commander.pause()

    def _on_sign_of_life(self) -> None:
        self._heard = time.monotonic()

    def _on_closed(self) -> None:
        """Bring the robots to rest before they are stopped."""
        if self._is_under_way():
            self._pause()
            wait_until(lambda: all(
                robot.drive.is_at_rest or robot.drive.progress.state not in UNDER_WAY
                for robot in self._robots), REMOTE_REST_TIMEOUT)
        self._end()

    def _is_under_way(self) -> bool:
        return self._commander.is_driving()

    def _on_events(self, events: Sequence[Event | RobotEvent]) -> None:
        for event in events:
            if isinstance(event, RobotsApart):
                self._apart = event.apart
        self._has_changed.set()

    def _write_more(self) -> None:
        """Pause the robots if nobody could stop them, and end if nothing may move any more."""
        if self._commander.is_stopped_permanently:
            self._ended.set()
        elif time.monotonic() - self._heard > REMOTE_SILENCE_TIMEOUT and self._is_under_way():
            self._heard = math.inf
            self._pause()

    def _state(self) -> protocol.FleetState:
        now, drives = time.monotonic(), self._commander.states()
        states = [_robot_state(robot, drive) for robot, drive in zip(self._robots, drives)]
        are_still = [robot.odometry.is_still(now) for robot in self._robots]
        troubles = {
            robot.name: escaped(text, MAX_TROUBLE) for robot, drive in zip(self._robots, drives)
            if (text := _trouble(robot, drive, now))}
        plan_times = [drive.plan_time for drive in drives
                      if drive.plan_time is not None and not drive.is_over]
        holder, held_by = next((
            (drive, f'{robot.name}: {text}') for robot, drive in zip(self._robots, drives)
            if is_hold(drive.factors.get(OBSTACLE, 1.0))
            and (text := describe_hold(drive.state, drive.factors, drive.watch))), (None, None))
        reasons = [drive.ended_by for drive in drives if drive.ended_by is not None]
        return protocol.FleetState(
            self._whole_state(states), round=self._fleet.round or None,
            plan_time=round(max(plan_times), 2) if plan_times else None,
            speed=self._speed(drives), apart=self._apart,
            reason=reasons[0] if reasons else None,
            is_still=None if None in are_still else all(are_still), states=tuple(states),
            poses=tuple(map(self._pose, self._robots, drives, self._starts)), troubles=troubles,
            watch=None if holder is None else watch_report(holder.watch), held_by=held_by)

    def _last_state(self, reason: str | None) -> protocol.FleetState:
        return replace(self._state(), state='ended', reason=reason)

    def _whole_state(self, states: Sequence[protocol.FloorRobotState]) -> protocol.FleetStateName:
        for name in _WHOLE:
            if name in states:
                return name
        is_between = 0 < self._fleet.round < self._fleet.plan.file.repeat
        return 'taking' if is_between and {*states} == {'done'} else 'standing by'

    def _speed(self, drives: Sequence[DriveProgress]) -> float:
        slowest = min(product(drive.factors) for drive in drives)
        return round(self._fleet.plan.speed * slowest, 3)

    def _pose(self, robot: Robot, drive: DriveProgress, start: Pose) -> protocol.Pose | None:
        """Return where a robot is on the floor, from where it began the first round."""
        if drive.start is not None and not drive.is_over and self._fleet.round <= 1:
            self._origins[robot.name] = drive.start
        origin, pose = self._origins.get(robot.name), robot.pose
        if origin is None or pose is None:
            return None
        return rounded(compose(start, relative_to(origin, pose)))


def _robot_state(robot: Robot, drive: DriveProgress) -> protocol.FloorRobotState:
    permit = robot.gate.permit
    if drive.state is DriveState.STOPPING and permit is not None and permit.ended_by is None:
        return 'done'  # it has come to its end, and waits for the end of the others
    return _STATES[drive.state]


def _trouble(robot: Robot, drive: DriveProgress, now: float) -> str:
    """Return what is wrong with a robot; empty if nothing is."""
    if robot.request is not None and isinstance(
            robot.request.cancelled_by, MotionStoppedError):
        return ''  # somebody has stopped it
    if drive.ended_by is not None:
        # An error of one robot ends the drives of all, and names it.
        name, colon, text = drive.ended_by.partition(': ')
        return text if colon and name == robot.name else ''
    if drive.state not in UNDER_WAY:
        return ''
    if held_by := describe_hold(drive.state, drive.factors, drive.watch):
        # The others wait for that robot, and nothing is wrong with them.
        return f'{HELD} {held_by}' if is_hold(drive.factors.get(OBSTACLE, 1.0)) else ''
    holders = [name for name, factor in drive.factors.items() if is_hold(factor) and name != PAUSE]
    if holders:
        return f'held by: {", ".join(holders)}'
    is_silent = robot.odometry.age(now) is not None and robot.odometry.is_still(now) is None
    return 'no odometry at present' if is_silent else ''
