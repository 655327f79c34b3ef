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

from collections import deque
import fcntl
import math
import os
import select
import struct
import termios
import threading
import time
from typing import Any, Literal

from kachaka_simple_control.control.events import (
    DriveState,
    Event,
    OdometryReceived,
    ScanReceived,
    VelocityKind,
    VelocitySent,
    WatchChanged,
)
from kachaka_simple_control.control.hold_text import describe_hold
from kachaka_simple_control.control.robot_drive import DriveProgress, UNDER_WAY
from kachaka_simple_control.control.speed_factor import product
from kachaka_simple_control.control.timing import REMOTE_WRITE_TIMEOUT
from kachaka_simple_control.files import protocol
from kachaka_simple_control.kachaka_simple_control import KachakaSimpleControl
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import Pose, Velocity, ZERO
from kachaka_simple_control.ros.robot import Robot

#: How often a scan is written, and how many of its points at most.
SCAN_PERIOD, MAX_SCAN_POINTS = 0.2, 180
#: No scan is written while the reader has left so much unread [bytes]: some states.
MAX_UNREAD = 4096
#: How many poses are kept, to find that of a scan, which arrives later than it was taken.
KEPT_POSES = 50


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
        #: what stands on the floor of simulated robots; None if unknown
        self.floor: Floor | None = None
        #: the velocity that is sent by hand now, and since when [s on the steady clock]
        self._segment: tuple[Velocity, float] | None = None
        #: the newest poses by odometry, with their times [s on the steady clock]
        self._poses: deque[tuple[float, Pose]] = deque(maxlen=KEPT_POSES)
        #: the newest scan that was not written yet, and when the last one was [s likewise]
        self._scan: protocol.Scan | None = None
        self._scan_written = -math.inf

    def write(self, report: protocol.Report) -> None:
        """Write a report; drop it without a reader, or with a NaN, which JSON does not have."""
        try:
            line = data = protocol.write_line(report)
        except protocol.MessageError:
            return
        end = time.monotonic() + REMOTE_WRITE_TIMEOUT
        with self._lock:
            self._write_rest(line, data, end)

    def _write_rest(self, line: bytes, data: bytes, end: float) -> None:
        """Write what is left of a line, until a time [s on the steady clock]."""
        while data and not self._is_broken and self._wait_until_writable(end):
            data = data[self._write_part(data):]
        # Nothing may follow a part of a line.
        self._is_broken = self._is_broken or 0 < len(data) < len(line)

    def write_scan(self, now: float) -> None:
        """
        Write the newest scan, at most one in SCAN_PERIOD (0.2 s).

        It is dropped while another line is being written, or the reader does not keep up: no state
        and no answer waits for it.
        """
        if self._scan is None or now - self._scan_written < SCAN_PERIOD:
            return
        scan, self._scan, self._scan_written = self._scan, None, now
        try:
            line = protocol.write_line(scan)
        except protocol.MessageError:
            return
        if not self._lock.acquire(blocking=False):
            return
        try:
            # A pipe takes so short a line as a whole, or nothing of it.
            if not self._is_broken and len(line) <= select.PIPE_BUF and self._has_reader_read():
                rest = line[self._write_part(line):]
                if len(rest) < len(line):
                    self._write_rest(line, rest, time.monotonic() + REMOTE_WRITE_TIMEOUT)
        finally:
            self._lock.release()

    def _has_reader_read(self) -> bool:
        """Return whether little is unread in the pipe."""
        try:
            data = fcntl.ioctl(self._file, termios.FIONREAD, bytes(4))
        except OSError:  # it is no pipe
            return True
        return int(struct.unpack('i', data)[0]) <= MAX_UNREAD

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
        """Record a velocity, a pose or a scan; report each segment that was driven by hand."""
        match event:
            case VelocitySent():
                self._on_velocity(event)
            case OdometryReceived():
                self._poses.append((event.time, event.pose))
            case ScanReceived():
                pose = next(
                    (pose for at, pose in reversed(self._poses) if at <= event.time), None)
                points = event.points[::math.ceil(len(event.points) / MAX_SCAN_POINTS) or 1]
                self._scan = protocol.Scan(
                    _pose(pose), tuple((round(x, 2), round(y, 2)) for x, y in points))

    def _on_velocity(self, event: VelocitySent) -> None:
        self.velocity = event.velocity
        velocity = event.velocity if event.kind is VelocityKind.HAND else None
        if self._segment is not None and velocity != self._segment[0]:
            before, since = self._segment
            self.write(protocol.Sent(
                ((before.linear_x, before.angular_z, event.time - since),)))
            self._segment = None
        if velocity is not None and self._segment is None:
            self._segment = velocity, event.time

    def describe(self, robot_control: KachakaSimpleControl) -> dict[str, Any]:
        """Return the fields of the report ``robot``."""
        profile = robot_control.profile
        limits, footprint = profile.planning_limits, profile.footprint
        return {
            'robot': profile.name, 'topic': robot_control.publisher.topic_name,
            'has_odometry': robot_control.robot.settings.names.odometry is not None,
            'max_linear_velocity': limits.max_linear_velocity,
            'max_backward_velocity': limits.backward_velocity,
            'max_angular_velocity': limits.max_angular_velocity,
            'footprint': None if footprint is None else tuple(footprint.corners()),
            'floor': floor_map(self.floor)}


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
        is_still=robot.odometry.is_still(now), watch=watch_report(progress.watch),
        held_by=describe_hold(progress.state, factors, progress.watch) or None)


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


def floor_map(floor: Floor | None) -> protocol.FloorMap | None:
    """Return what stands on a floor, for a report; None if it is unknown."""
    if floor is None:
        return None
    places = [(place, person.radius) for person in floor.people
              for place in (person.at, person.to) if place is not None]
    return protocol.FloorMap(
        floor.walls, tuple((*post.at, post.radius) for post in floor.posts),
        tuple((*place, radius) for place, radius in places))


def watch_report(watch: WatchChanged | None) -> protocol.Watch | None:
    """Return what an obstacle watch says, for a report; None without one."""
    return None if watch is None else protocol.Watch(
        watch.state.value, _rounded(watch.distance, 3), _rounded(watch.angle, 3))


def _pose(pose: Pose | None) -> tuple[float, float, float] | None:
    return None if pose is None else (
        round(pose.x, 4), round(pose.y, 4), round(pose.theta, 4))


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
