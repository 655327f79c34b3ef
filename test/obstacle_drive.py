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
"""Drive a simulated robot on a floor with the obstacle watch, in simulated time."""

from __future__ import annotations

from dataclasses import dataclass, field
import math
import random

from kachaka_simple_control.control.events import WatchChanged, WatchState
from kachaka_simple_control.control.obstacle_watch import ObstacleWatch
from kachaka_simple_control.control.scan_watch import ScanWatch
from kachaka_simple_control.control.scans import points_of
from kachaka_simple_control.control.speed_factor import SpeedFactor
from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.files.floor_file import LaserParameters
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.simulator.drive_model import (
    DriveModel,
    ODOMETRY_PERIOD,
    SimulationParameters,
)
from kachaka_simple_control.kachaka.simulator.laser import SimulatedLaser
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import Pose, ZERO
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.separation import Hull
from kachaka_simple_control.motion.steps import Motion

#: When a drive begins [s]: the robot has stood for a while.
START = 1.0
LASER = KACHAKA.laser
USUAL_LASER = LaserParameters()
HULL = Hull.of(KACHAKA.footprint)


@dataclass
class ObstacleDrive:
    """
    A drive with the obstacle watch.

    :param knows: what the watch takes for the delay of the robot [s]; None if unknown
    :param longest: when the drive is given up, unless it has come to its end [s]
    """

    motion: Motion
    floor: Floor
    dead_time: float = 0.1
    lag: float = 0.05
    knows: float | None = 0.15
    rate: float = 20.0
    seed: int = 0
    longest: float = 60.0
    speed: float = 1.0
    laser: LaserParameters = USUAL_LASER
    silent_from: float = math.inf
    sent: list[Tick] = field(default_factory=list)
    told: list[WatchChanged] = field(default_factory=list)
    #: of each held rest: how far the robot is from what is nearest [m]
    gaps: list[float] = field(default_factory=list)
    has_touched: bool = False
    is_complete: bool = False

    def run(self) -> Pose:
        """Drive; return where the robot is at the end, by the plan 0, 0, 0 from its start."""
        made = self.plan = plan(self.motion, KACHAKA.limits, self.rate)
        self._now = 0.0
        self._robot = DriveModel(
            SimulationParameters(dead_time=self.dead_time, lag=self.lag), 0.0, self.seed)
        self._laser = SimulatedLaser(self.laser, LASER.pose, self.floor, START, self.seed)
        self._factor = SpeedFactor(clock=lambda: self._now)
        self._watch = ScanWatch(
            ObstacleWatch(KACHAKA.footprint, LASER.margin, self.knows), self._factor, '',
            self.told.append, lambda _: None)
        self._events = random.Random(self.seed)
        self._next_scan = self._events.uniform(0.0, 0.1)
        self._samples = 0
        self._pass(START)
        scheduler, due = TickScheduler(made), 0.0
        for _ in self._watch.prepare(_At(START), 'scan', made, Pose, scheduler):
            raise AssertionError('there is a scan')
        self._factor.set('override', self.speed)
        while due < self.longest:
            self._pass(START + due)
            tick = scheduler.due(due, self._factor.value)
            if tick is None:
                break
            self._robot.set_target(tick.velocity, self._now)
            self._watch.on_sent(self._now, tick.plan_time)
            self.sent.append(tick)
            due = tick.deadline
        self.is_complete = due < self.longest
        self._pass(START + due)
        self._robot.set_target(ZERO, START + due)
        self._pass(START + due + 2.0)
        return self._robot.state_at(START + due + 2.0)[0]

    def _pass(self, until: float) -> None:
        """Let odometry and scans arrive until a time [s], and look for contacts."""
        while (time := self._samples * ODOMETRY_PERIOD) <= until:
            self._now = time
            pose, velocity = self._robot.odometry_at(time)
            if time >= START:
                nearest = self.floor.nearest(HULL, pose, time - START).distance
                self.has_touched |= nearest <= 0.0
                if self._was_moving and velocity.is_zero and self._factor.value == 0.0:
                    self.gaps.append(nearest)
            self._was_moving = not velocity.is_zero
            self._watch.on_odometry(time, pose)
            if time >= self._next_scan and time < START + self.silent_from:
                points = points_of(self._laser.scan(pose, time), LASER.pose)
                if points is not None:
                    self._watch.on_scan(time, time, points)
                self._next_scan += 1.0 / self.laser.rate
            self._watch.poll(time, is_at_rest=False)
            self._samples += 1
        self._now = until

    @property
    def holds(self) -> int:
        """Return how often the watch has held the robot before an obstacle."""
        return sum(event.state is WatchState.OBSTACLE for event, before in zip(
            self.told, [None, *self.told])
            if before is None or before.state is not event.state)

    _was_moving = False


class _At:
    """A moment of a preparation."""

    def __init__(self, now: float) -> None:
        self.now = now
