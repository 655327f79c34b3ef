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
"""The planned, the sent and the seen path in one frame."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import (
    compose,
    distance_between,
    integrate,
    ORIGIN,
    Pose,
    relative_to,
    Velocity,
)
from kachaka_simple_control.report.drive_log import DriveLog, MotionLog
from kachaka_simple_control.telemetry.events import OdometryReceived, VelocitySent


class DeadReckoning:
    """
    The way of a robot that keeps each velocity until the next, but not longer than its hold.

    It stands at the origin when the first message comes.
    """

    def __init__(self, messages: Sequence[VelocitySent], hold: float) -> None:
        """
        Work it out.

        :param messages: what the robot is told, in order
        :param hold: how long it keeps a velocity without a new one [s]
        """
        #: when its velocity may have changed [s], and where it was
        self.times: list[float] = []
        self.poses: list[Pose] = []
        self._velocities: list[Velocity] = []
        self._hold = hold
        for sent in messages:
            if not self.times or sent.time >= self.times[-1]:
                self._hear(sent)

    def _hear(self, sent: VelocitySent) -> None:
        if not self.times:
            pose = ORIGIN
        elif self._velocities[-1].is_zero:
            if sent.velocity.is_zero:
                return
            pose = self.poses[-1]
        else:
            pose = self._after(len(self.times) - 1, sent.time)
        self.times.append(sent.time)
        self.poses.append(pose)
        self._velocities.append(sent.velocity)

    def at(self, time: float) -> Pose:
        """
        Return where the robot is.

        :param time: when [s]; before the first message it is at the origin
        :returns: its pose
        """
        last = len(self.times) - 1
        index = last if last >= 0 and time >= self.times[last] else (
            bisect_right(self.times, time) - 1)
        if index < 0:
            return ORIGIN
        return self._after(index, time)

    def _after(self, index: int, time: float) -> Pose:
        velocity = self._velocities[index]
        if velocity.is_zero:
            return self.poses[index]
        return integrate(
            self.poses[index], velocity, min(time - self.times[index], self._hold))

    @property
    def end(self) -> Pose:
        """
        Return where it stands in the end: at the latest a hold after the last message.

        Without a hold nobody knows; then it is where the last message reached it.
        """
        if not self.times:
            return ORIGIN
        return self.at(self.times[-1] + (self._hold if math.isfinite(self._hold) else 0.0))


#: So long after the last message odometry still belongs to the drive [s].
AFTER = 1.0
#: Odometry with figures beyond this is broken, and left away [m, rad, m/s, rad/s].
FAR = 1e6


@dataclass(frozen=True)
class MotionStart:
    """
    Where and when a motion was to begin.

    :param motion: the motion
    :param pose: where, in the frame of the drive
    :param time: when [s after t = 0 of the drive]; None if it never began
    """

    motion: MotionLog
    pose: Pose
    time: float | None


class OdometrySample(NamedTuple):
    """
    What odometry saw, in the frame of the drive.

    :param time: when [s after t = 0 of the drive]
    :param pose: where
    :param received: what it told
    :param distance: how far the robot was from where the messages should have brought it [m]
    :param angle: how far it looked to the left of how it should have [rad]
    """

    time: float
    pose: Pose
    received: OdometryReceived
    distance: float
    angle: float


class AlignedDrive:
    """
    All of a drive in one frame: its origin is where the robot stood at t = 0, looking along x.

    Odometry has a frame of its own; it is laid so that its pose at t = 0, or its first one after
    that, is where the messages sent by then should have brought the robot.
    """

    def __init__(self, record: DriveLog) -> None:
        """
        Work it out.

        :param record: what happened
        """
        session = record.session_started
        hold = math.inf if session is None else session.command_timeout
        began = [motion.began for motion in record.motions if motion.has_begun]
        #: t = 0 [s on the steady clock]; nan if nothing began
        self.start_time = began[0] if began else math.nan
        #: every message from t = 0 on
        self.sent = _from(record.sent, self.start_time)
        self.dead_reckoning = DeadReckoning(self.sent, hold)
        #: all motions, one after the other
        self.motion_starts = self._starts(record.motions)
        #: odometry from t = 0 on
        self.odometry = self._seen([answer for answer in record.odometry if _is_plausible(answer)])

    @property
    def planned_end(self) -> Pose:
        """Return where the last motion was to end."""
        return _end_of(self.motion_starts)

    @property
    def duration(self) -> float:
        """Return how long there is something to see [s after t = 0]."""
        planned = [(start.time or 0.0) + start.motion.plan.duration for start in self.motion_starts
                   if start.time is not None or not self.sent]
        last = self.sent[-1].time - self.start_time if self.sent else 0.0
        return max([last, *planned])

    def _starts(self, motions: Sequence[MotionLog]) -> list[MotionStart]:
        starts: list[MotionStart] = []
        for motion in motions:
            pose = _end_of(starts)
            if starts and motion.has_begun and not starts[-1].motion.is_complete:
                pose = self.dead_reckoning.at(motion.began)
            starts.append(MotionStart(
                motion, pose, motion.began - self.start_time if motion.has_begun else None))
        return starts

    def _seen(self, answers: Sequence[OdometryReceived]) -> list[OdometrySample]:
        if not self.sent:
            return []
        first = bisect_left(answers, self.start_time, key=_time)
        last = bisect_right(answers, self.sent[-1].time + AFTER, key=_time)
        if first >= last:
            return []
        answers = answers[max(0, first - 1):last]
        frame = self._frame(answers)
        seen = []
        for answer in answers:
            should = self.dead_reckoning.at(answer.time)
            pose = compose(frame, answer.pose)
            distance, angle = distance_between(should, pose)
            # Odometry tells headings within a turn; the robot may have made more of them.
            pose = Pose(pose.x, pose.y, should.theta + angle)
            seen.append(
                OdometrySample(answer.time - self.start_time, pose, answer, distance, angle))
        return seen

    def _frame(self, answers: Sequence[OdometryReceived]) -> Pose:
        # The last one that came before t = 0, or the first of all.
        return compose(
            self.dead_reckoning.at(answers[0].time), relative_to(answers[0].pose, ORIGIN))


def _end_of(starts: Sequence[MotionStart]) -> Pose:
    return compose(starts[-1].pose, starts[-1].motion.plan.pose) if starts else ORIGIN


def _from(messages: Sequence[VelocitySent], began: float) -> list[VelocitySent]:
    return [sent for sent in messages if sent.time >= began - 1e-6]


def _is_plausible(answer: OdometryReceived) -> bool:
    pose, velocity = answer.pose, answer.velocity
    return math.isfinite(answer.time) and all(abs(value) < FAR for value in (
        pose.x, pose.y, pose.theta, velocity.linear_x, velocity.angular_z))


def _time(answer: OdometryReceived) -> float:
    return answer.time
