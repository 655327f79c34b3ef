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
"""A drive of simulated robots with known errors is fitted, or refused with the reason."""

from dataclasses import replace
import math
import random

from kachaka_simple_control.analysis.calibration_fit import (
    CalibrationError,
    fit_calibration,
    MOTION,
)
from kachaka_simple_control.control.events import OdometryReceived
from kachaka_simple_control.files.library import find
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.geometry import Pose
import pytest
from simulated_drive import SimulatedDrive

pytestmark = pytest.mark.needs('yaml', 'jsonschema')


def drive(parameters, seed=0, change=None, **options):
    """Return the log of a simulated robot that drove the motion."""
    simulated = SimulatedDrive(20.0, parameters=parameters, seed=seed, **options)
    simulated.drive(find(MOTION).motion)
    log = simulated.close()
    if change is not None:
        log.odometry[:] = [*filter(None, map(change, log.odometry))]
    return log


def robot(seed):
    """Return a robot drawn at random, from the ranges that a calibration must manage."""
    draw = random.Random(seed)
    return SimulationParameters(
        dead_time=draw.uniform(0.05, 0.3), lag=draw.uniform(0.03, 0.2),
        linear_gain=draw.uniform(0.93, 1.07), backward_gain=draw.uniform(0.97, 1.03),
        angular_gain=draw.uniform(0.93, 1.07), right_gain=draw.uniform(0.97, 1.03),
        veer=math.radians(draw.uniform(-3.0, 3.0)), odometry_noise=0.003,
        heading_noise=math.radians(0.5))


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(20))
def test_the_errors_of_a_robot_are_found(seed):
    true = robot(seed)
    fit = fit_calibration(drive(true, seed))
    gains = {'forward': true.linear_gain, 'backward': true.linear_gain * true.backward_gain,
             'left': true.angular_gain, 'right': true.angular_gain * true.right_gain}
    for name, gain in gains.items():
        assert fit.gains[name].value == pytest.approx(gain, rel=0.005), true
        assert abs(fit.gains[name].value - gain) < 6.0 * fit.gains[name].error + 2e-4, true
    assert fit.delay.value == pytest.approx(true.dead_time + true.lag, abs=0.02), true
    assert math.degrees(abs(fit.veer.value - true.veer)) < 0.3, true
    assert fit.position_noise == pytest.approx(0.003, rel=0.2)
    assert math.degrees(fit.heading_noise) == pytest.approx(0.5, rel=0.2)


class Late:
    """Odometry of a drive of second order, that arrives by another time late each time."""

    def __init__(self, lag, jitter, seed):
        """Set the second time constant, and the largest delay [s]."""
        self._lag, self._jitter, self._random = lag, jitter, random.Random(seed)
        self._seen = None

    def __call__(self, sample):
        """Return the sample as it arrives."""
        pose = sample.pose
        if self._seen is not None:
            part = 1.0 - math.exp(-0.02 / self._lag)
            seen = self._seen
            pose = Pose(
                seen.x + part * (pose.x - seen.x), seen.y + part * (pose.y - seen.y),
                seen.theta + part * math.remainder(pose.theta - seen.theta, math.tau))
        self._seen = pose
        return replace(
            sample, pose=pose, time=sample.time + self._random.uniform(0.0, self._jitter))


def with_deadband(simulated, bound):
    """Let a simulated robot ignore velocities below a part of the largest."""
    send = simulated._robot.set_robot_velocity
    simulated._robot.set_robot_velocity = lambda linear, angular, now: send(
        linear if abs(linear) > bound else 0.0, angular if abs(angular) > bound else 0.0, now)


def unknown(seed):
    """Return the drive of a robot that the fit knows nothing of, and what is true of it."""
    draw = random.Random(seed)
    true = replace(robot(seed), velocity_noise=draw.uniform(0.0, 0.1))
    lag, jitter = draw.uniform(0.03, 0.1), draw.uniform(0.0, 0.06)
    simulated = SimulatedDrive(20.0, parameters=true, seed=seed)
    with_deadband(simulated, draw.uniform(0.0, 0.03))
    simulated.drive(find(MOTION).motion)
    log = simulated.close()
    log.odometry[:] = map(Late(lag, jitter, seed), log.odometry)
    return log, true, true.dead_time + true.lag + lag + jitter / 2.0


@pytest.mark.slow
def test_robots_that_the_fit_knows_nothing_of_are_found_or_refused():
    """Of second order, with a deadband, slip and a jitter of the delay."""
    refused = []
    for seed in range(100, 110):
        log, true, delay = unknown(seed)
        try:
            fit = fit_calibration(log)
        except CalibrationError:
            refused.append(seed)
            continue
        assert fit.gains['forward'].value == pytest.approx(true.linear_gain, rel=0.01), seed
        assert fit.gains['left'].value == pytest.approx(true.angular_gain, rel=0.01), seed
        assert fit.delay.value == pytest.approx(delay, abs=0.04), seed
    assert len(refused) <= 2, refused


IDEAL = SimulationParameters(dead_time=0.1, lag=0.05)


def slipping(sample):
    """Return odometry of a robot that goes less far from a time on."""
    seen = sample.pose
    return sample if sample.time < 5022.0 else replace(
        sample, pose=Pose(0.96 * seen.x, seen.y, seen.theta))


def drifting(sample):
    """Return odometry of a robot that rolls away slowly."""
    return replace(sample, pose=Pose(
        sample.pose.x + 0.02 * (sample.time - 5000.0), sample.pose.y, sample.pose.theta))


def rarely(sample):
    """Return one sample in twenty."""
    return sample if round(50.0 * sample.time) % 20 == 0 else None


def held(sample):
    """Return odometry of a robot that stands still."""
    return OdometryReceived(sample.time, Pose(0.0, 0.0, 0.0))


def mirrored(sample):
    """Return odometry of a robot that drives backwards where it should drive forwards."""
    seen = sample.pose
    return replace(sample, pose=Pose(-seen.x, -seen.y, seen.theta))


def hostile(sample):
    """Return one sample in ten with values that no robot has."""
    odd = {0: math.nan, 1: math.inf, 2: 1e300}.get(round(50.0 * sample.time) % 30)
    return sample if odd is None else replace(sample, pose=Pose(odd, 0.0, odd))


def test_hostile_odometry_is_left_out():
    fit = fit_calibration(drive(IDEAL, change=hostile))
    assert fit.gains['forward'].value == pytest.approx(1.0, abs=1e-3)
    assert fit.delay.value == pytest.approx(0.15, abs=0.01)


@pytest.mark.parametrize(('change', 'reason'), [
    (mirrored, r'forward 0.7 m: odometry reported -0.700 m: is the robot held, or is its '),
    (slipping, r'two drives (forward|backward) differ by \d\.\d %: do the wheels slip'),
    (drifting, 'the robot still moved, by'),
    (rarely, r'odometry reported where the robot stood \d times in 1 s; at least 10 are needed'),
    (held, r'forward 0.7 m: odometry reported 0.000 m: is the robot held'),
])
def test_what_the_drive_cannot_tell_is_refused_with_the_reason(change, reason):
    with pytest.raises(CalibrationError, match=reason):
        fit_calibration(drive(IDEAL, change=change))


def test_a_drive_that_was_stopped_or_paused_is_refused():
    simulated = SimulatedDrive(20.0)
    simulated.drive(find(MOTION).motion, 9.0, 'stopped by a test')
    with pytest.raises(CalibrationError, match='not completed'):
        fit_calibration(simulated.close())
    simulated = SimulatedDrive(20.0)
    simulated.drive(find(MOTION).motion, factors=[(3.0, {'pause': 0.0}), (5.0, {})])
    with pytest.raises(CalibrationError, match='paused or slowed down'):
        fit_calibration(simulated.close())
