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
"""Read the state of the connection with a robot, and judge it for diagnostics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kachaka_simple_control.control.diagnosis import Diagnosis, Level
from kachaka_simple_control.control.events import DriveState, WatchState
from kachaka_simple_control.control.guardian import Guardian, NullGuardian
from kachaka_simple_control.control.hold_text import describe_hold, describe_watch, HELD
from kachaka_simple_control.control.robot_drive import DriveProgress, RobotDrive
from kachaka_simple_control.control.standstill import StandstillDetector
from kachaka_simple_control.control.velocity_gate import GateState
from kachaka_simple_control.errors import ControlError
from kachaka_simple_control.ros.manual_control_client import ManualControlClient
from kachaka_simple_control.ros.robot_discovery import RobotDiscovery

#: Odometry older than this causes a warning [s]: it usually arrives 10 times per second or more.
ODOMETRY_WARN_AGE = 1.0
#: How the states are called that do not have the word of the live display.
STATES = {
    DriveState.READY: 'nothing started yet', DriveState.WAITING: 'connecting to the robot',
    DriveState.CONNECTING: 'connecting to the robot', DriveState.STOPPED: 'at rest',
    DriveState.CUT_SHORT: 'stopped early'}


@dataclass(frozen=True)
class RobotStatus:
    """
    The state of the connection with a robot at one time, for diagnostics.

    :param odometry_age: the age of the newest odometry [s]; None if none was received
    :param stopped_by: why no motion can start again; None if motions can start
    """

    subscriber_count: int
    other_publishers: tuple[str, ...]
    guardian: str
    odometry_age: float | None
    manual_control: str
    speed: str
    stopped_by: str | None


class StatusReader:
    """
    Reads the state of the connection with a robot, in any thread, for diagnostics.

    :param stopped_by: returns why no motion can start again; None if motions can start
    """

    def __init__(
            self, drive: RobotDrive, discovery: RobotDiscovery, guardian: Guardian | NullGuardian,
            odometry: StandstillDetector, manual_control: ManualControlClient,
            stopped_by: Callable[[], ControlError | None]) -> None:
        self._drive = drive
        self._discovery = discovery
        self._guardian = guardian
        self._odometry = odometry
        self._manual_control = manual_control
        self._stopped_by = stopped_by

    @property
    def is_closed(self) -> bool:
        """Whether the connection with the robot is closed; if so, nothing may be published."""
        return self._drive.gate.state is GateState.CLOSED

    @property
    def progress(self) -> DriveProgress:
        """Return the progress of the newest motion: how far it has come and whether it is over."""
        return self._drive.progress

    def read(self, now: float) -> RobotStatus:
        """Return the current state of the connection with the robot, for diagnostics."""
        stopped_by = self._stopped_by()
        return RobotStatus(
            subscriber_count=self._discovery.subscriber_count,
            other_publishers=tuple(self._discovery.other_publishers()),
            guardian=_guardian(self._guardian),
            odometry_age=self._odometry.age(now),
            manual_control=self._manual_control.state(now),
            speed=self._drive.speed_factor.describe(),
            stopped_by=str(stopped_by) if stopped_by else None)


def _guardian(guardian: Guardian | NullGuardian) -> str:
    if isinstance(guardian, NullGuardian):
        return 'off'
    if guardian.stopped_because is not None:
        return f'stopped the robot because {guardian.stopped_because}'
    return 'matched' if guardian.is_matched else 'not matched yet'


def diagnose(progress: DriveProgress, status: RobotStatus) -> Diagnosis:
    """Return a diagnosis of the drive: OK, a warning or an error, with named values."""
    state = ('stopped permanently' if status.stopped_by is not None else
             STATES.get(progress.state) or _state_under_way(progress))
    level, message = _worst(progress, status, state)
    age = status.odometry_age
    return Diagnosis(level, message, {
        'state': state,
        'motion': progress.title or 'none',
        'step': '{} of {}'.format(*progress.step),
        'late ticks': str(progress.late),
        'skipped ticks': str(progress.skipped),
        'subscribers': str(status.subscriber_count),
        'other publishers': ', '.join(status.other_publishers) or 'none',
        'guardian': status.guardian,
        'odometry age': 'none received' if age is None else f'{age:.2f} s',
        'manual control': status.manual_control,
        'speed': status.speed,
        'obstacle watch': _watch(progress),
    })


def _state_under_way(progress: DriveProgress) -> str:
    held_by = describe_hold(progress.state, progress.factors, progress.watch)
    return f'{HELD} {held_by}' if held_by else progress.state.value


def _watch(progress: DriveProgress) -> str:
    if progress.watch is None:
        return 'off'
    return describe_watch(progress.watch, progress.factors) or progress.watch.state.value


def _worst(progress: DriveProgress, status: RobotStatus, state: str) -> tuple[Level, str]:
    if status.stopped_by is not None:
        return Level.ERROR, f'stopped permanently: {status.stopped_by}'
    if status.guardian.startswith('stopped'):
        return Level.ERROR, f'the guardian {status.guardian}'
    if progress.state is DriveState.CUT_SHORT:
        return Level.WARN, f'the last motion was over before its end: {progress.ended_by}'
    warnings = [
        ('no subscriber for the velocities', not status.subscriber_count),
        (f'others have publishers of velocities: {", ".join(status.other_publishers)}',
         status.other_publishers),
        ('odometry is silent', (status.odometry_age or 0.0) > ODOMETRY_WARN_AGE),
        ('velocities were skipped', progress.skipped),
        # Not because of an obstacle: for that the watch is there.
        (_watch(progress), progress.state in (DriveState.DRIVING, DriveState.PAUSED)
         and progress.watch is not None
         and progress.watch.state in (WatchState.NO_SCAN, WatchState.BLIND)),
    ]
    for warning, applies in warnings:
        if applies:
            return Level.WARN, warning
    return Level.OK, state
