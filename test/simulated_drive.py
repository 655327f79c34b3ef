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
"""Logs of drives in simulated time: the real plan, the simulated robot, and no clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import math
import random

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.control.events import (
    Event,
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    OdometryReceived,
    SessionEnded,
    SessionStarted,
    SpeedFactorChanged,
    VelocityKind,
    VelocitySent,
)
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion

#: A robot with constant errors.
IMPERFECT = SimulationParameters(lag=0.05, linear_gain=0.985, angular_gain=1.012)
#: On 2026-11-21.
EPOCH = 1_795_219_200.0
#: Times of the zeros of a stop [s].
STOP = [0.0] * 10 + [0.04 * number for number in range(1, 11)]


class SimulatedDrive:
    """
    A program that drives in simulated time, and the log of its events.

    :param rate: how often a velocity is sent [Hz]
    :param lateness: how late a message is, given its number [s]; by default a fraction of a ms
    :param odometry_period: between two poses [s]; None if none arrives
    """

    def __init__(
            self, rate: float = 10.0, lateness: Callable[[int], float] | None = None,
            parameters: SimulationParameters = IMPERFECT, odometry_period: float | None = 0.02,
            title: str = 'simulated', seed: int = 0) -> None:
        """Open the record; the robot stands somewhere and looks somewhere."""
        self.drive_log, self.events, self.now = DriveLog(), [], 5000.0
        self._rate, self._late = rate, lateness or jitter()
        self._robot = SimulatedKachaka(self.now, parameters, seed=seed)
        self._robot.set_manual_control(True, self.now)
        self._odometry = math.inf if odometry_period is None else self.now
        self._period = odometry_period
        self._count = 0
        self._is_stopped = True
        self.limits = KACHAKA.limits
        self.publish(SessionStarted(
            title, KACHAKA.name, self.limits, KACHAKA.command_timeout, EPOCH,
            '/kachaka/manual_control/cmd_vel', '/kachaka/odometry/odometry',
            footprint=KACHAKA.footprint,
            settings={'robot': 'kachaka', 'rate': rate, 'guardian': True},
            versions={'kachaka_simple_control': '0.1.0', 'ROS': 'jazzy'}))

    def publish(self, event: Event) -> None:
        """Add an event to the log."""
        self.events.append(event)
        self.drive_log.on_event(event)

    def drive(self, motion: Motion, until: float = math.inf, reason: str | None = None,
              is_fault: bool = True, lost: tuple[float, float] | None = None,
              factors: Sequence[tuple[float, Mapping[str, float]]] = ()) -> None:
        """
        Drive a motion.

        :param until: when it is interrupted [s after t = 0]
        :param reason: why; None for no event of its end
        :param lost: from when to when nothing is sent [s after t = 0]
        :param factors: when the speed factor is set [s after t = 0], and its parts by name
        """
        planned = plan(motion, self.limits, self._rate)
        session = self.drive_log.session_started
        assert session is not None
        self.publish(MotionPlanned(
            motion, self.limits, self._rate, motion_file=session.motion_file))
        for _ in range(0 if self._count else 10):
            self._send(self.now + 0.05, ZERO, VelocityKind.PRIME)
        start = self.now + 0.0005
        began = False
        scheduler, due, factor = TickScheduler(planned), 0.0, 1.0
        changes = list(factors)
        while due < until:
            while changes and changes[0][0] <= due:
                change = SpeedFactorChanged(start + changes[0][0], changes.pop(0)[1])
                self._pass(change.time)
                self.publish(change)
                factor = change.product
            tick = scheduler.due(due, factor)
            if tick is None:
                break
            if lost is None or not lost[0] <= due < lost[1]:
                late = 0.0 if not began else self._late(self._count)
                if not began:
                    self._pass(start)
                    self.publish(MotionStarted(start))
                    began = True
                self._send(start + due + late, tick.velocity, VelocityKind.PLAN, tick.start,
                           tick.plan_time)
            due = tick.deadline
        is_cut = due >= until
        if is_cut and reason is None:
            return
        if is_cut:
            self.stop(start + until)
        else:
            self._send(start + due + self._late(self._count), ZERO, VelocityKind.PLAN, due,
                       planned.duration)
            self._is_stopped = False
        self.publish(MotionEnded(self.now, reason, is_fault))

    def stop(self, time: float) -> None:
        """Send all zeros of a stop."""
        self._is_stopped = True
        for after in STOP:
            self._send(max(self.now, time + after + 0.0002), ZERO, VelocityKind.STOP)

    def close(self, stop_confirmed_after: float | None = 0.12, signal: int | None = None,
              error: str | None = None, rest: float = 0.4) -> DriveLog:
        """Stop if necessary, let the robot come to rest, and end the session; return the log."""
        if not self._is_stopped:
            self.stop(self.now + 1.0 / self._rate)
        self._pass(self.now + rest)
        self.publish(SessionEnded(self.now, stop_confirmed_after, signal, error))
        return self.drive_log

    def _send(self, time: float, velocity: Velocity, kind: VelocityKind,
              due: float | None = None, plan_time: float | None = None) -> None:
        self._pass(time)
        self._count += 1
        limits = KACHAKA.limits
        self._robot.set_manual_control(True, self.now)
        self._robot.set_robot_velocity(
            velocity.linear_x / limits.max_linear_velocity,
            velocity.angular_z / limits.max_angular_velocity, self.now)
        self.publish(VelocitySent(self.now, velocity, kind, due, plan_time))

    def _pass(self, time: float) -> None:
        while self._odometry <= time:
            pose, velocity = self._robot.odometry(self._odometry)
            wrapped = type(pose)(pose.x, pose.y, math.remainder(pose.theta, math.tau))
            self.publish(OdometryReceived(self._odometry + 0.003, wrapped, velocity))
            self._odometry += self._period
        self.now = max(self.now, time)


def jitter(scale: float = 0.0002, seed: int = 7) -> Callable[[int], float]:
    """Return the lateness of messages by number [s]: mostly small, and reproducible."""
    generator = random.Random(seed)
    return lambda number: min(0.009, generator.expovariate(1.0 / scale))
