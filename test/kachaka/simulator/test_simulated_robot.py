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
"""The simulated robot does what the maker documents of the real one."""

from __future__ import annotations

import math

from kachaka_simple_control.kachaka.robot_status import (
    ERROR_NO_MANUAL_CONTROL,
    ERROR_NOT_A_VELOCITY,
    SUCCESS,
)
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import ORIGIN, Velocity, ZERO
import pytest

#: 0.1 m/s, as a part of the largest velocity.
SLOW = 0.1 / 0.3


@pytest.fixture
def robot():
    """Return a robot that takes velocities from 0 s on."""
    robot = SimulatedKachaka()
    robot.set_manual_control(True, 0.0)
    return robot


def test_velocity_lasts_for_the_command_timeout(robot):
    """The stop is at the command's time + 0.3 s, not at the next query."""
    robot.set_robot_velocity(SLOW, 0.0, 1.0)
    assert robot.state(1.29)[1] == Velocity(0.1)
    assert robot.state(1.3)[1] == ZERO
    assert robot.state(50.0)[0].x == pytest.approx(0.03, abs=1e-12)


def test_each_command_restarts_the_command_timeout(robot):
    """Ten commands at 10 Hz: 0.9 s between them and one command timeout."""
    for tick in range(10):
        robot.set_robot_velocity(SLOW, 0.0, 1.0 + 0.1 * tick)
    assert robot.state(9.0)[0].x == pytest.approx(0.1 * 1.2, abs=1e-12)


def test_command_after_the_timeout_does_not_fill_the_gap(robot):
    """0.3 s of motion, a gap of 0.2 s, 0.3 s of motion."""
    robot.set_robot_velocity(SLOW, 0.0, 1.0)
    robot.set_robot_velocity(SLOW, 0.0, 1.5)
    assert robot.state(9.0)[0].x == pytest.approx(0.06, abs=1e-12)


def test_manual_control_goes_off_after_60_s_and_stops_the_robot(robot):
    """Before the command timeout."""
    assert robot.set_robot_velocity(SLOW, 0.0, 59.9) == SUCCESS
    assert robot.manual_control(59.99) is True
    assert robot.manual_control(60.0) is False
    assert robot.state(61.0)[0].x == pytest.approx(0.01, abs=1e-12)
    assert robot.set_robot_velocity(SLOW, 0.0, 61.0) == ERROR_NO_MANUAL_CONTROL


def test_velocities_do_not_renew_manual_control(robot):
    """Only enabling does."""
    for tick in range(600):
        assert robot.set_robot_velocity(SLOW, 0.0, 0.1 * tick) == SUCCESS
    assert robot.set_robot_velocity(SLOW, 0.0, 60.0) == ERROR_NO_MANUAL_CONTROL


def test_enabling_again_renews_manual_control(robot):
    """For 60 s from then on, without a stop in between."""
    robot.set_robot_velocity(SLOW, 0.0, 29.9)
    robot.set_manual_control(True, 30.0)
    assert robot.state(30.1)[1] == Velocity(0.1)
    assert robot.manual_control(89.9) is True
    assert robot.manual_control(90.0) is False


def test_disabling_stops_at_once(robot):
    """The velocity does not come back."""
    robot.set_robot_velocity(SLOW, 0.0, 1.0)
    assert robot.set_manual_control(False, 1.1) == SUCCESS
    assert robot.state(2.0)[0].x == pytest.approx(0.01, abs=1e-12)
    assert robot.set_robot_velocity(SLOW, 0.0, 2.0) == ERROR_NO_MANUAL_CONTROL
    robot.set_manual_control(True, 2.1)
    assert robot.state(2.2)[1] == ZERO


@pytest.mark.parametrize(('linear', 'angular', 'velocity'), [
    (1.0, 1.0, Velocity(0.3, 1.57)), (-1.0, -1.0, Velocity(-0.3, -1.57)),
    (1.0667, -3.0, Velocity(0.3, -1.57)), (0.5, 0.0, Velocity(0.15, 0.0))])
def test_velocities_are_relative_to_the_limits(robot, linear, angular, velocity):
    """0.3 m/s and 1.57 rad/s; larger values are clipped."""
    assert robot.set_robot_velocity(linear, angular, 1.0) == SUCCESS
    assert robot.state(1.1)[1] == velocity


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_velocity_that_is_not_finite_is_refused(robot, value):
    """It changes nothing: the velocity before it stays."""
    robot.set_robot_velocity(SLOW, 0.0, 1.0)
    assert robot.set_robot_velocity(value, 0.0, 1.1) == ERROR_NOT_A_VELOCITY
    assert robot.set_robot_velocity(0.0, value, 1.1) == ERROR_NOT_A_VELOCITY
    assert robot.state(1.2)[1] == Velocity(0.1)
    assert robot.state(9.0)[0].x == pytest.approx(0.03, abs=1e-12)


def test_robot_stays_on_its_dock_until_manual_control_is_on():
    """A refused velocity alone does not move it."""
    robot = SimulatedKachaka(docked=True)
    robot.set_robot_velocity(1.0, 0.0, 0.0)
    assert robot.is_docked(1.0) is True
    assert robot.state(1.0) == (ORIGIN, ZERO)


def test_enabling_on_the_dock_undocks():
    """Straight, by a given distance at a given velocity, whatever velocities come."""
    parameters = SimulationParameters(undock_distance=0.3, undock_velocity=0.15)
    robot = SimulatedKachaka(docked=True, parameters=parameters)
    robot.set_manual_control(True, 1.0)
    assert robot.is_docked(1.0) is False
    for tick in range(19):
        assert robot.set_robot_velocity(-1.0, 1.0, 1.05 + 0.1 * tick) == SUCCESS
        assert robot.state(1.05 + 0.1 * tick)[1] == Velocity(0.15)
    assert robot.state(3.0)[1] == ZERO
    pose, _ = robot.state(5.0)
    assert (pose.x, pose.y, pose.theta) == (pytest.approx(0.3, abs=1e-12), 0.0, 0.0)
    robot.set_robot_velocity(0.0, 1.0, 5.0)
    assert robot.state(5.1)[1] == Velocity(0.0, 1.57)


def test_odometry_of_an_ideal_robot_is_true(robot):
    """There is no noise by default."""
    robot.set_robot_velocity(1.0, 1.0, 1.0)
    assert robot.odometry(1.2) == robot.state(1.2)


def test_odometry_noise_is_seeded_and_leaves_the_truth_alone():
    """The same times give the same readings, in any run and however often."""
    parameters = SimulationParameters(odometry_noise=0.01, heading_noise=0.02)
    readings = []
    for questions in (1, 5):
        robot = SimulatedKachaka(parameters=parameters, seed=3)
        for tick in range(200):
            for _ in range(questions):
                pose, velocity = robot.odometry(0.01 + 0.02 * tick)
            readings.append(pose)
        assert (robot.state(4.0), velocity) == ((ORIGIN, ZERO), ZERO)
    assert readings[:200] == readings[200:]
    # 200 readings: the deviation of a deviation is 5 %.
    for name, deviation in (('x', 0.01), ('y', 0.01), ('theta', 0.02)):
        squares = [getattr(reading, name) ** 2 for reading in readings[:200]]
        assert math.sqrt(sum(squares) / 200) == pytest.approx(deviation, rel=0.2)


def test_the_lesson_ends_where_it_should(robot):
    """Forward 0.1 m, left and right by 1 rad, sent at 10 Hz: back to heading 0."""
    moves = [(0.0, 0.0, 10), (0.1, 0.0, 10), (0.0, 0.0, 10), (0.0, 0.5, 20), (0.0, 0.0, 10),
             (0.0, -0.5, 20), (0.0, 0.0, 10)]
    tick = 0
    for linear_x, angular_z, ticks in moves:
        for _ in range(ticks):
            robot.set_robot_velocity(linear_x / 0.3, angular_z / 1.57, 1.0 + tick / 10.0)
            tick += 1
    pose, velocity = robot.state(20.0)
    assert (pose.x, pose.y, pose.theta) == pytest.approx((0.1, 0.0, 0.0), abs=1e-12)
    assert velocity == ZERO
