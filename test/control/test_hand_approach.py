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
"""A person drives a simulated robot by hand towards walls, with the obstacle watch."""

import math
import random

from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.hand_source import HandSource
from kachaka_simple_control.control.obstacle_watch import ObstacleWatch
from kachaka_simple_control.control.scans import points_of
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.simulator.drive_model import DriveModel, SimulationParameters
from kachaka_simple_control.kachaka.simulator.laser import SimulatedLaser
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import Velocity
from obstacle_drive import HULL, LASER, USUAL_LASER
import pytest

SEEDS = st.integers(0, 10 ** 9)
#: How often the stick is read, and the state of the robot computed [s].
STICK_PERIOD, STEP = 0.05, 0.01


class HandDrive:
    """A drive by hand, in simulated time."""

    def __init__(self, floor, delay=0.15, knows=None, seed=0):
        lag = 0.3 * delay
        self.now, self.floor = 0.0, floor
        self.robot = DriveModel(SimulationParameters(dead_time=delay - lag, lag=lag), 0.0, seed)
        self.laser = SimulatedLaser(USUAL_LASER, LASER.pose, floor, 0.0, seed)
        self.watch = ObstacleWatch(KACHAKA.footprint, LASER.margin, knows)
        self.hand = HandSource(
            KACHAKA.limits, clock=lambda: self.now,
            cut=lambda wanted: self.watch.cut(wanted, KACHAKA.limits, self.now))
        self.number, self.next_scan, self.has_touched = 0, 0.0, False
        self.scan()
        self.watch.begin(None, None)
        self.command(Velocity())

    def scan(self):
        """Let a scan come, if it is time."""
        if self.now >= self.next_scan - 1e-9:
            self.next_scan += 0.1
            points = points_of(
                self.laser.scan(self.robot.state_at(self.now)[0], self.now), LASER.pose)
            if points is not None:
                self.watch.decide(self.watch.look(self.now, points))
                if self.number:
                    self.hand.on_scan()

    def command(self, wanted):
        """Move the stick."""
        self.number += 1
        self.hand.command(wanted, self.number, self.hand.stamp())

    def drive(self, wanted, seconds):
        """Keep the stick somewhere for a time; return the newest velocity."""
        velocity = Velocity()
        for index in range(round(seconds / STEP)):
            if index % round(STICK_PERIOD / STEP) == 0:
                self.command(wanted)
                velocity = self.hand.due(self.now).velocity
                self.robot.set_target(velocity, self.now)
            self.now += STEP
            self.scan()
            self.has_touched |= self.gap <= 0.0
        return velocity

    @property
    def gap(self):
        """Return how far the robot is from what is nearest [m]."""
        return self.floor.nearest(HULL, self.robot.state_at(self.now)[0], self.now).distance


@pytest.mark.slow
@settings(max_examples=examples(6))
@given(SEEDS)
def test_no_wall_is_touched(seed):
    numbers = random.Random(seed)
    angle, distance = numbers.uniform(-1.0, 1.0), numbers.uniform(0.5, 1.5)
    at = distance * math.cos(angle), distance * math.sin(angle)
    along, half = angle + math.pi / 2.0 + numbers.uniform(-0.7, 0.7), 1.5
    floor = Floor(walls=((
        (at[0] - half * math.cos(along), at[1] - half * math.sin(along)),
        (at[0] + half * math.cos(along), at[1] + half * math.sin(along))),))
    delay = numbers.uniform(0.05, 0.3)
    drive = HandDrive(floor, delay, numbers.choice((None, delay)), seed)
    if drive.gap < 0.1:
        return
    drive.drive(Velocity(0.0, angle), 1.0)
    for _ in range(6):
        drive.drive(Velocity(
            numbers.uniform(0.1, 0.3), numbers.choice((0.0, numbers.uniform(-0.5, 0.5)))), 1.5)
        drive.drive(Velocity(0.0, numbers.uniform(-1.0, 1.0)), 0.5)
    assert not drive.has_touched


def test_a_robot_drives_up_to_a_wall_and_away_from_it():
    drive = HandDrive(Floor(walls=(((1.0, -1.0), (1.0, 1.0)),)), knows=0.15)
    assert drive.drive(Velocity(0.3), 1.0).linear_x == pytest.approx(0.3)
    assert drive.drive(Velocity(0.3), 4.0) == Velocity()
    assert 0.03 < drive.gap < 0.2
    assert drive.drive(Velocity(-0.2), 1.0) == Velocity(-0.2)


def test_without_scans_nothing_moves():
    drive = HandDrive(Floor())
    assert drive.drive(Velocity(0.3), 1.0).linear_x == pytest.approx(0.3)
    drive.next_scan = math.inf
    assert drive.drive(Velocity(0.3), 0.6) == Velocity()
