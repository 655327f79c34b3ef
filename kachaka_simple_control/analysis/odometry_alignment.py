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
Compute three paths in one frame: as planned, from the sent velocities, and from odometry.

Tested by test/analysis/test_summary.py.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import math
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.analysis.drive_log import DriveLog, MotionLog
from kachaka_simple_control.control.events import OdometryReceived, VelocitySent
from kachaka_simple_control.motion.geometry import (
    compose,
    distance_between,
    integrate,
    ORIGIN,
    Pose,
    relative_to,
    Velocity,
)


class DeadReckoning:
    """
    The path of a robot that starts at the origin and follows the sent velocities exactly.

    It keeps each velocity until the next message, but not longer than the command timeout.
    """

    def __init__(self, messages: Sequence[VelocitySent], command_timeout: float) -> None:
        #: the times at which the velocity may change [s]; ``poses`` has the poses at these times
        self.times: list[float] = []
        self.poses: list[Pose] = []
        self._velocities: list[Velocity] = []
        self._command_timeout = command_timeout
        for message in messages:
            if self.times and (message.time < self.times[-1] or (
                    message.velocity.is_zero and self._velocities[-1].is_zero)):
                continue  # out of order, or still at rest
            self.poses.append(self.at(message.time))
            self.times.append(message.time)
            self._velocities.append(message.velocity)

    def at(self, time: float) -> Pose:
        """Return the pose at a time [s]; before the first message, the origin."""
        index = bisect_right(self.times, time) - 1
        if index < 0:
            return ORIGIN
        velocity = self._velocities[index]
        if velocity.is_zero:
            return self.poses[index]
        return integrate(
            self.poses[index], velocity, min(time - self.times[index], self._command_timeout))

    @property
    def end(self) -> Pose:
        """Return the pose at the command timeout, or at the last message if that is infinite."""
        if not self.times:
            return ORIGIN
        timeout = self._command_timeout
        return self.at(self.times[-1] + (timeout if math.isfinite(timeout) else 0.0))


#: Odometry up to this time after the last message belongs to the drive [s].
MAX_TIME_AFTER_LAST_MESSAGE = 1.0
#: An odometry sample with a larger value is invalid and left out [m, rad, m/s, rad/s].
MAX_VALUE = 1e6


@dataclass(frozen=True)
class MotionStart:
    """
    The start pose and the start time of a motion.

    :param pose: relative to that at t = 0 of the drive: the planned end pose of the motion before,
        or where the sent velocities lead if that one ended early
    :param time: [s after t = 0 of the drive]; None if the motion never started
    """

    motion: MotionLog
    pose: Pose
    time: float | None


class OdometrySample(NamedTuple):
    """
    An odometry sample whose pose is relative to that at t = 0 of the drive.

    :param time: [s after t = 0 of the drive]
    :param received: the sample as it was received, in the frame of odometry
    :param distance: the distance from where the sent velocities lead [m]
    :param angle: the heading minus that to which they lead [rad], positive to the left
    """

    time: float
    pose: Pose
    received: OdometryReceived
    distance: float
    angle: float


class AlignedDrive:
    """
    The plans, messages and odometry of a drive, all relative to the robot's pose at t = 0.

    t = 0 is the start of the first motion.  The poses from odometry are transformed so that the
    last sample before it, or else the first one after it, is where the sent velocities lead.
    """

    def __init__(self, log: DriveLog) -> None:
        began = [motion.began for motion in log.motions if motion.has_begun]
        #: t = 0, the start of the first motion [s on the steady clock]; nan if no motion started
        self.start_time = began[0] if began else math.nan
        #: all messages from t = 0 on
        self.sent = [message for message in log.sent if message.time >= self.start_time - 1e-6]
        self.dead_reckoning = DeadReckoning(self.sent, log.command_timeout)
        #: the starts of all motions, in order
        self.motion_starts = self._motion_starts(log.motions)
        #: odometry from t = 0 on
        self.odometry = self._aligned([*filter(is_plausible, log.odometry)])

    @property
    def planned_end(self) -> Pose:
        """
        Return the planned end pose of the last motion.

        The pose is relative to the robot's pose at the start of the first motion.
        """
        return _end_of(self.motion_starts)

    @property
    def time_span(self) -> float:
        """Return the length of a time axis that shows the whole drive [s], above 0."""
        planned = [
            time for start in self.motion_starts if start.time is not None or not self.sent
            for time in self.planned_times(start, [start.motion.plan.duration])]
        last = self.sent[-1].time - self.start_time if self.sent else 0.0
        seen = self.odometry[-1].time if self.odometry else 0.0
        return max([last, seen, *planned]) or 1.0

    def planned_times(self, start: MotionStart, plan_times: Iterable[float]) -> list[float]:
        """Return when a motion reaches plan times [s after t = 0 of the drive]."""
        timeline = start.motion.timeline
        if start.time is None or not timeline.is_delayed:
            return [(start.time or 0.0) + time for time in plan_times]
        return [timeline.time(time) - self.start_time for time in plan_times]

    def odometry_at(self, time: float) -> Pose | None:
        """
        Return the pose by odometry at a time [s on the steady clock]; None without odometry.

        It is relative to that at t = 0, and interpolated; that of the first or the last sample
        before and after all.
        """
        samples, time = self.odometry, time - self.start_time
        if not samples:
            return None
        index = bisect_left(samples, time, key=attrgetter('time'))
        if index in (0, len(samples)):
            return samples[max(0, index - 1)].pose
        before, after = samples[index - 1], samples[index]
        part = (time - before.time) / (after.time - before.time)
        one, two = before.pose, after.pose
        return Pose(one.x + part * (two.x - one.x), one.y + part * (two.y - one.y),
                    one.theta + part * (two.theta - one.theta))

    def _motion_starts(self, motions: Sequence[MotionLog]) -> list[MotionStart]:
        starts: list[MotionStart] = []
        for motion in motions:
            pose = _end_of(starts)
            if starts and motion.has_begun and not starts[-1].motion.is_complete:
                pose = self.dead_reckoning.at(motion.began)
            starts.append(MotionStart(
                motion, pose, motion.began - self.start_time if motion.has_begun else None))
        return starts

    def _aligned(self, odometry: Sequence[OdometryReceived]) -> list[OdometrySample]:
        if not self.sent:
            return []
        end = self.sent[-1].time + MAX_TIME_AFTER_LAST_MESSAGE
        first = bisect_left(odometry, self.start_time, key=attrgetter('time'))
        last = bisect_right(odometry, end, key=attrgetter('time'))
        if first >= last:
            return []
        # The last sample before t = 0, or else the first sample, defines the frame.
        odometry = odometry[max(0, first - 1):last]
        frame = compose(self.dead_reckoning.at(odometry[0].time),
                        relative_to(odometry[0].pose, ORIGIN))
        samples = []
        for received in odometry:
            expected = self.dead_reckoning.at(received.time)
            pose = compose(frame, received.pose)
            distance, angle = distance_between(expected, pose)
            # Odometry headings are within one turn, but the robot may have made several turns.
            pose = Pose(pose.x, pose.y, expected.theta + angle)
            samples.append(OdometrySample(
                received.time - self.start_time, pose, received, distance, angle))
        return samples


def _end_of(starts: Sequence[MotionStart]) -> Pose:
    return compose(starts[-1].pose, starts[-1].motion.plan.pose) if starts else ORIGIN


def is_plausible(sample: OdometryReceived) -> bool:
    """Return whether a sample has a finite time, and a pose and velocity below 1e6 (SI units)."""
    pose, velocity = sample.pose, sample.velocity
    return math.isfinite(sample.time) and all(abs(value) < MAX_VALUE for value in (
        pose.x, pose.y, pose.theta, velocity.linear_x, velocity.angular_z))
