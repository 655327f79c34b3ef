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
"""The drive model: exact where possible, independent of the number of queries."""

from __future__ import annotations

from dataclasses import astuple, replace
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.kachaka.simulator.drive_model import (
    DriveModel,
    IDEAL,
    SimulationParameters,
)
from kachaka_simple_control.motion.geometry import integrate, ORIGIN, Velocity, ZERO
import pytest

REAL = SimulationParameters(
    lag=0.15, linear_acceleration=0.4, angular_acceleration=3.0, linear_gain=0.97,
    angular_gain=1.04, velocity_noise=0.1)
LATE = replace(REAL, dead_time=0.2, veer=0.05, right_gain=0.95)
WORN = replace(LATE, odometry_scale=0.97, wheel_ratio=1.01, track_ratio=1.02)
velocities = st.builds(Velocity, st.floats(-0.3, 0.3), st.floats(-1.57, 1.57))
commands = st.lists(st.tuples(st.floats(0.0, 0.4), velocities | st.just(ZERO)), max_size=5)
questions = st.lists(st.floats(0.0, 2.5), max_size=20)


def drive_and_ask(parameters, commands, questions, start=0.0):
    """Send the commands after their pauses, query in between; return the state after 2.5 s."""
    drive, time = DriveModel(parameters, start, seed=7), start
    asked = sorted(start + question for question in questions)
    for pause, velocity in commands:
        time += pause
        while asked and asked[0] <= time:
            drive.state_at(asked.pop(0))
        drive.set_target(velocity, time)
    for question in asked:
        drive.state_at(question)
    return drive.state_at(start + 2.5)


@pytest.mark.parametrize(
    'parameters', [IDEAL, REAL, LATE, WORN], ids=['ideal', 'real', 'late', 'worn'])
@given(commands=commands, questions=questions)
def test_pose_does_not_depend_on_the_number_of_queries(parameters, commands, questions):
    """To the last bit: a report must not depend on other clients."""
    silent = drive_and_ask(parameters, commands, [])
    assert silent == drive_and_ask(parameters, commands, questions)


@given(commands=commands)
def test_ideal_drive_is_exact(commands):
    """Each velocity from its command to the next, as a unicycle."""
    pose = ORIGIN
    times = [sum(pause for pause, _ in commands[:index + 1]) for index in range(len(commands))]
    for (_, velocity), time, following in zip(commands, times, [*times[1:], 2.5]):
        pose = integrate(pose, velocity, following - time)
    driven, _ = drive_and_ask(IDEAL, commands, [])
    for name in ('x', 'y', 'theta'):
        assert getattr(pose, name) == pytest.approx(getattr(driven, name), abs=1e-12)


@pytest.mark.slow
@given(commands=commands)
def test_odometry_of_worn_wheels_is_that_of_good_ones_and_the_floor_is_another(commands):
    """What odometry reports does not depend on its errors; the floor follows from it exactly."""
    good, worn = DriveModel(LATE, 0.0, 7), DriveModel(WORN, 0.0, 7)
    time, pose, before = 0.0, ORIGIN, ORIGIN
    for pause, velocity in [*commands, (1.0, ZERO)]:
        # Nearly as often as the velocity changes, so that an increment is nearly an arc.
        for index in range(1, 201):
            reported = worn.reported_at(time + pause * index / 200)[0]
            pose = WORN.floor.advance_on_floor(pose, before, reported)
            before = reported
        time += pause
        for drive in (good, worn):
            drive.set_target(velocity, time)
    assert worn.reported_at(time) == good.reported_at(time) == good.state_at(time)
    true, _ = worn.state_at(time)
    assert (pose.x, pose.y, pose.theta) == pytest.approx((true.x, true.y, true.theta), abs=1e-5)


def test_same_seed_same_drive_at_any_start_time():
    """Noise depends on the time since the start."""
    commands = [(0.25, Velocity(0.25, 0.5)), (0.25, Velocity(0.125, -1.0))]
    early, late = (drive_and_ask(REAL, commands, [], start)[0] for start in (0.0, 65536.0))
    assert early.x == pytest.approx(late.x, abs=1e-9)
    assert early.theta == pytest.approx(late.theta, abs=1e-9)


def test_velocity_noise_has_the_deviation_it_was_given():
    """The distance in 1 s is the sum of 1000 velocities: noise * velocity * sqrt(1 s * 1 ms)."""
    ways = []
    for seed in range(200):
        drive = DriveModel(SimulationParameters(velocity_noise=0.5), 0.0, seed)
        drive.set_target(Velocity(0.1), 0.0)
        ways.append(drive.state_at(1.0)[0].x)
    mean = sum(ways) / len(ways)
    deviation = math.sqrt(sum((way - mean) ** 2 for way in ways) / (len(ways) - 1))
    # 200 seeds: the deviation of a deviation is 5 %, of the mean 7 % of a deviation.
    assert deviation == pytest.approx(0.5 * 0.1 * math.sqrt(0.001), rel=0.2)
    assert mean == pytest.approx(0.1, abs=0.3 * deviation)


def test_lag_delays_and_catches_up():
    """First order: behind by velocity * lag while it drives, and none of it is lost at the end."""
    drive = DriveModel(SimulationParameters(lag=0.1), 0.0, 0)
    drive.set_target(Velocity(0.2), 0.0)
    assert drive.state_at(0.1)[1].linear_x == pytest.approx(0.2 * (1.0 - math.exp(-1.0)))
    assert drive.state_at(2.0)[0].x == pytest.approx(0.2 * (2.0 - 0.1))
    drive.set_target(ZERO, 2.0)
    # Below 1e-6 m/s with a target of zero the robot stands still.
    assert drive.state_at(10.0)[0].x == pytest.approx(0.2 * 2.0, abs=1.1e-7)
    assert drive.state_at(10.0)[1] == ZERO


def test_dead_time_shifts_the_drive_and_changes_nothing_else():
    commands = [(0.0, Velocity(0.2, 0.0)), (0.4, Velocity(0.1, 0.5)), (1.1, ZERO)]
    prompt = SimulationParameters(lag=0.1, linear_gain=0.95)
    late = replace(prompt, dead_time=0.25)
    for time in (0.1, 0.25, 0.3, 0.7, 1.2, 2.0, 3.0):
        drives = [DriveModel(parameters, 0.0, 0) for parameters in (prompt, late)]
        for drive, shift in zip(drives, (0.25, 0.0)):
            for at, target in commands:
                if at + shift <= time:
                    drive.set_target(target, at + shift)
        (pose, velocity), (late_pose, late_velocity) = (
            drive.state_at(time) for drive in drives)
        assert astuple(late_pose) == pytest.approx(astuple(pose), abs=1e-6)
        assert astuple(late_velocity) == pytest.approx(astuple(velocity), abs=1e-6)


def test_gains_may_differ_with_the_direction():
    drive = DriveModel(SimulationParameters(
        linear_gain=0.9, backward_gain=0.8, angular_gain=1.1, right_gain=0.5), 0.0, 0)
    seen = []
    for number, target in enumerate([
            Velocity(0.1, 0.0), Velocity(-0.1, 0.0), Velocity(0.0, 0.2), Velocity(0.0, -0.2)]):
        drive.set_target(target, float(number))
        seen.append(drive.state_at(number + 0.5)[1])
    assert [*map(astuple, seen)] == [
        pytest.approx(pair) for pair in [(0.09, 0.0), (-0.072, 0.0), (0.0, 0.22), (0.0, -0.11)]]


def test_veer_bends_a_straight_line():
    drive = DriveModel(SimulationParameters(linear_gain=0.95, veer=0.035), 0.0, 0)
    drive.set_target(Velocity(0.2, 0.0), 0.0)
    pose, velocity = drive.state_at(5.0)
    assert pose.theta == pytest.approx(0.035 * 0.95)
    assert velocity.angular_z == pytest.approx(0.035 * 0.19)
    drive.set_target(Velocity(-0.2, 0.0), 5.0)
    assert drive.state_at(10.0)[0].theta == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(('name', 'value'), [
    ('lag', -0.1), ('lag', math.nan), ('lag', math.inf), ('linear_acceleration', 0.0),
    ('angular_acceleration', math.nan), ('linear_gain', math.inf), ('velocity_noise', -1.0),
    ('odometry_noise', math.nan), ('undock_velocity', 0.0), ('undock_distance', -1.0)])
def test_invalid_parameters_are_refused(name, value):
    """With the name and the value."""
    with pytest.raises(ValueError, match=rf'^{name} is {value}( \S+)?; it must be'):
        SimulationParameters(**{name: value})
