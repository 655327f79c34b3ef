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
Find when, where and before what an obstacle watch held the robot in a drive.

Tested by test/analysis/test_obstacle_holds.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from kachaka_simple_control.analysis.drive_log import DriveLog, MotionLog, WatchLog
from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive
from kachaka_simple_control.control.events import WatchState
from kachaka_simple_control.control.hold_text import describe_obstacle
from kachaka_simple_control.motion.geometry import Point, Pose, transform_point
from kachaka_simple_control.motion.plan import PlannedStep

#: The states of a watch in which it holds the robot.
HOLDING = frozenset({WatchState.OBSTACLE, WatchState.NO_SCAN})


@dataclass(frozen=True)
class Hold:
    """
    A time in which an obstacle watch held the robot in a motion, for one reason.

    :param begin: [s after t = 0 of the drive], as ``end``
    :param plan_time: how far the plan had come when the hold began [s]; the robot then brakes
    :param step: in which it came to rest
    :param distance: the smallest way that was left before an obstacle [m]; None without one
    :param angle: the smallest turn that was left on this way [rad]; None without one
    :param pose: where the robot was at the end of the hold, relative to its pose at t = 0, by
        odometry; None without odometry
    :param points: what the newest scan had seen when the hold began, in the same frame [m]
    """

    motion: MotionLog
    state: WatchState
    begin: float
    end: float
    plan_time: float
    step: PlannedStep
    distance: float | None
    angle: float | None
    pose: Pose | None
    points: tuple[Point, ...]

    @property
    def duration(self) -> float:
        """Return how long the robot was held, with its braking [s]."""
        return self.end - self.begin

    @property
    def reason(self) -> str:
        """Return a text such as ``obstacle 0.06 m ahead``."""
        if self.state is WatchState.NO_SCAN:
            return 'no scan of the laser'
        return describe_obstacle(self.distance, self.angle)


def obstacle_holds(log: DriveLog, aligned: AlignedDrive) -> list[Hold]:
    """Return all holds of a drive by its obstacle watch, in order; empty without a watch."""
    return [hold for motion in log.motions if motion.own_messages and motion.plan.steps
            for hold in _holds(motion, aligned)]


def _holds(motion: MotionLog, aligned: AlignedDrive) -> Iterator[Hold]:
    last, timeline = motion.own_messages[-1].time, motion.timeline
    groups = [(state, [*logs]) for state, logs in groupby(
        motion.watched, lambda log: log.change.state)]
    ends = [*(logs[0].change.time for _, logs in groups[1:]), last]
    for (state, logs), following in zip(groups, ends):
        begin, end = max(motion.began, logs[0].change.time), min(last, following)
        if state in HOLDING and begin < end:
            plan_time, plan_end = (min(max(0.0, timeline.plan_time(time)), motion.plan.duration)
                                   for time in (begin, end))
            yield Hold(
                motion, state, begin - aligned.start_time, end - aligned.start_time, plan_time,
                motion.plan.steps[motion.plan.step_index(plan_end)],
                _least([log.change.distance for log in logs]),
                _least([log.change.angle for log in logs]),
                aligned.odometry_at(end), _points(logs[0], aligned))


def _least(values: Sequence[float | None]) -> float | None:
    return min((value for value in values if value is not None), default=None)


def _points(log: WatchLog, aligned: AlignedDrive) -> tuple[Point, ...]:
    if log.scan is None:
        return ()
    pose = aligned.odometry_at(log.scan.time) or aligned.dead_reckoning.at(log.scan.time)
    return tuple(transform_point(point, pose) for point in log.scan.points)
