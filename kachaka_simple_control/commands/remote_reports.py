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
Write the reports of a remotely controlled drive, one JSON object a line.

Tested by test/commands/test_remote_control.py.
"""

from __future__ import annotations

import os
import select
import threading
import time
from typing import Any, Literal

from kachaka_simple_control.control.events import DriveState, Event, VelocityKind, VelocitySent
from kachaka_simple_control.control.robot_drive import DriveProgress, UNDER_WAY
from kachaka_simple_control.control.speed_factor import product
from kachaka_simple_control.control.timing import REMOTE_WRITE_TIMEOUT
from kachaka_simple_control.files import protocol
from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.motion.geometry import Pose, Velocity, ZERO
from kachaka_simple_control.ros.robot import Robot


class ReportWriter:
    """
    Writes reports to a pipe, from any thread.

    With a full pipe reports are dropped: no thread waits for longer than REMOTE_WRITE_TIMEOUT.
    """

    def __init__(self, file: int) -> None:
        self._file = file
        os.set_blocking(file, False)
        self._lock = threading.Lock()
        self._is_broken = False
        self.velocity = ZERO
        #: the velocity that is sent by hand now, and since when [s on the steady clock]
        self._segment: tuple[Velocity, float] | None = None

    def write(self, report: protocol.Report) -> None:
        """Write a report; drop it without a reader, or with a NaN, which JSON does not have."""
        try:
            line = data = protocol.write_line(report)
        except protocol.MessageError:
            return
        end = time.monotonic() + REMOTE_WRITE_TIMEOUT
        with self._lock:
            while data and not self._is_broken and self._wait_until_writable(end):
                data = data[self._write_part(data):]
            # Nothing may follow a part of a line.
            self._is_broken = self._is_broken or 0 < len(data) < len(line)

    def _wait_until_writable(self, end: float) -> bool:
        left = max(0.0, end - time.monotonic())
        return bool(select.select((), [self._file], (), left)[1])

    def _write_part(self, data: bytes) -> int:
        """Write as much as the pipe takes now, and return how many bytes that was."""
        try:
            return os.write(self._file, data)
        except BlockingIOError:
            return 0
        except OSError:
            self._is_broken = True
            return 0

    def close(self) -> None:
        """Close the pipe; reports that are written later are dropped."""
        with self._lock:
            self._is_broken = True
            os.close(self._file)

    def log(self, level: Literal['debug', 'info', 'warning', 'error'], text: str) -> None:
        """Write a message for the log of the reader."""
        self.write(protocol.Log(level, text))

    def on_event(self, event: Event) -> None:
        """Record a sent velocity, and report each segment that was driven by hand."""
        if not isinstance(event, VelocitySent):
            return
        self.velocity = event.velocity
        velocity = event.velocity if event.kind is VelocityKind.HAND else None
        if self._segment is not None and velocity != self._segment[0]:
            before, since = self._segment
            self.write(protocol.Sent(
                ((before.linear_x, before.angular_z, event.time - since),)))
            self._segment = None
        if velocity is not None and self._segment is None:
            self._segment = velocity, event.time

    @staticmethod
    def describe(robot_control: KachakaSimpleControl) -> dict[str, Any]:
        """Return the fields of the report ``robot``."""
        profile = robot_control.profile
        limits, footprint = profile.planning_limits, profile.footprint
        return {
            'robot': profile.name, 'topic': robot_control.publisher.topic_name,
            'has_odometry': robot_control.robot.settings.names.odometry is not None,
            'max_linear_velocity': limits.max_linear_velocity,
            'max_backward_velocity': limits.backward_velocity,
            'max_angular_velocity': limits.max_angular_velocity,
            'footprint': None if footprint is None else tuple(footprint.corners())}


def state_of(
        robot: Robot, progress: DriveProgress, velocity: Velocity, is_taken: bool,
        is_by_hand: bool, reason: str | None) -> protocol.State:
    """
    Return the state of the drive for a report.

    :param is_by_hand: whether the robot is driven by hand, if it is taken
    :param reason: why the last drive ended early; None if it did not
    """
    plan, factors = progress.plan, dict(progress.factors)
    done = remaining = None
    number, count = progress.step
    if plan is not None and progress.plan_time is not None and not progress.is_over:
        done = min(1.0, progress.plan_time / plan.duration) if plan.duration else 1.0
        speed = product(factors)
        remaining = (plan.duration - progress.plan_time) / speed if speed else None
    now = time.monotonic()
    age = robot.odometry.age(now)
    return protocol.State(
        state=_state_name(progress.state, velocity, is_taken, is_by_hand, reason),
        motion=progress.title if plan is not None else None,
        step=number or None, steps=count or None, progress=_rounded(done, 3),
        remaining=_rounded(remaining, 1), factors=factors,
        start=None if plan is None else _pose(progress.start),
        planned=_pose(progress.planned_pose),
        driven=_pose(robot.pose), velocity=(velocity.linear_x, velocity.angular_z),
        odometry_age=_rounded(age, 1), reason=reason,
        is_still=robot.odometry.is_still(now))


def _state_name(
        state: DriveState, velocity: Velocity, is_taken: bool, is_by_hand: bool,
        reason: str | None) -> protocol.StateName:
    """Return how the protocol calls a state."""
    if state is DriveState.STOPPING or (state in UNDER_WAY and not is_taken):
        return 'stopping'
    if not is_taken:
        return 'standing by' if reason is None else 'stopped'
    if state is DriveState.PAUSED:
        return 'paused'
    if state is not DriveState.DRIVING:
        return 'taking'
    if is_by_hand:
        return 'ready' if velocity.is_zero else 'driving by hand'
    return 'driving'


def _pose(pose: Pose | None) -> tuple[float, float, float] | None:
    return None if pose is None else (
        round(pose.x, 4), round(pose.y, 4), round(pose.theta, 4))


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
