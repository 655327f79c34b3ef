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
"""Drives in a closed loop in simulated time: the real plan and correction, no clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
import math
import random

from kachaka_simple_control.control.pose_feedback import PoseFeedback
from kachaka_simple_control.control.tick import Tick
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.simulator.drive_model import (
    DriveModel,
    ODOMETRY_PERIOD,
    SimulationParameters,
)
from kachaka_simple_control.motion.geometry import Pose, relative_to, Velocity, ZERO
from kachaka_simple_control.motion.limits import CLOSED_LOOP_SHARE
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import Forward, Motion, Repeat, Turn

SQUARE = Motion('square', (Repeat(4, (Forward(0.5), Turn(math.pi / 2))),))
#: When a drive begins [s]: the robot has stood for a while.
START = 1.0


def identity(pose: Pose) -> Pose:
    """Apply no calibration."""
    return pose


def full_speed(elapsed: float) -> float:
    """Drive at full speed."""
    return 1.0


@dataclass
class ClosedLoopDrive:
    """
    A drive of a simulated robot, with feedback or without.

    :param delay: what feedback takes for its delay [s]; None for an open loop
    :param rate: how often a velocity is sent [Hz]
    :param factor: the speed factor at a time [s after t = 0]
    """

    parameters: SimulationParameters
    delay: float | None
    motion: Motion = SQUARE
    rate: float = 20.0
    seed: int = 0
    read: Callable[[Pose], Pose] = identity
    factor: Callable[[float], float] = full_speed
    knows_odometry: bool = True
    sent: list[tuple[Tick, Velocity]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the plan and the robot."""
        is_closed = self.delay is not None
        self.plan: Plan = plan(
            self.motion.settled() if is_closed else self.motion,
            KACHAKA.limits.scaled(CLOSED_LOOP_SHARE) if is_closed else KACHAKA.limits, self.rate)
        self._feedback = PoseFeedback(
            self.delay or 0.0, self.parameters.floor if self.knows_odometry else None)
        self._robot = DriveModel(self.parameters, 0.0, self.seed)
        self._samples = 0

    def run(self) -> Pose:
        """Drive; return where the robot comes to rest, seen from where it should."""
        lateness = random.Random(self.seed)
        self._pass(START)
        self._feedback.begin(self.plan, KACHAKA.limits)
        scheduler, due = TickScheduler(self.plan), 0.0
        while (tick := scheduler.due(due, self.factor(due))) is not None:
            now = START + due + min(0.009, lateness.expovariate(5000.0))
            self._pass(now)
            velocity = tick.velocity
            if self.delay is not None:
                velocity = self._feedback.correct(tick, now)
            self.sent.append((tick, velocity))
            self._robot.set_target(velocity, now)
            due = tick.deadline
        self._pass(START + due)
        self._robot.set_target(ZERO, START + due)
        return relative_to(self.plan.pose, self._robot.state_at(START + due + 3.0)[0])

    def _pass(self, until: float) -> None:
        """Deliver the odometry that arrives until a time [s]."""
        while (time := self._samples * ODOMETRY_PERIOD) <= until:
            pose, velocity = self._robot.odometry_at(time)
            seen = self.read(pose)
            self._feedback.on_odometry(
                time, Pose(seen.x, seen.y, math.remainder(seen.theta, math.tau)),
                is_moving=abs(velocity.linear_x) > 0.01 or abs(velocity.angular_z) > 0.02)
            self._samples += 1


def random_robots(count: int, seed: int) -> Iterator[tuple[SimulationParameters, float]]:
    """Yield robots that are not calibrated, and their delays, each wrong by up to 20 ms [s]."""
    numbers = random.Random(seed)
    for _ in range(count):
        parameters = SimulationParameters(
            linear_gain=numbers.uniform(0.95, 1.05), angular_gain=numbers.uniform(0.95, 1.05),
            veer=math.radians(numbers.uniform(-3.0, 3.0)),
            dead_time=numbers.uniform(0.05, 0.3), lag=numbers.uniform(0.05, 0.2),
            odometry_noise=0.002, heading_noise=math.radians(0.1))
        yield parameters, parameters.dead_time + parameters.lag + numbers.uniform(-0.02, 0.02)
