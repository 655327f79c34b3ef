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
"""Squares in both directions tell how wrong odometry is, or are refused with the reason."""

import contextlib
from dataclasses import replace
from itertools import pairwise
import math
import random

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.analysis.calibration_fit import CalibrationError
from kachaka_simple_control.analysis.odometry_fit import (
    closed_form,
    fit_umbmark,
    reported_path,
    Square,
    worst_systematic_error,
)
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import KACHAKA_TRACK as TRACK
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.motion.calibration import OdometryCalibration
from kachaka_simple_control.motion.geometry import advance, ORIGIN, Pose
import pytest
from simulated_drive import SimulatedDrive

SIDE = 4.0


def corners(side, sign):
    """Return the poses of a square by odometry, each an arc after the one before."""
    poses = [ORIGIN]
    for _ in range(4):
        poses.append(advance(poses[-1], side, 0.0))
        poses.append(advance(poses[-1], 0.0, sign * math.pi / 2.0))
    return poses


def on_floor(calibration, path):
    """Return where a path by odometry ends on the floor."""
    pose = ORIGIN
    for before, after in pairwise(path):
        pose = calibration.advance_on_floor(pose, before, after)
    return pose


def squares(calibration, count=1, draw=None, side=SIDE):
    """Return squares to the right and to the left, measured exactly, or as people do."""
    driven = []
    for sign in (-1.0, 1.0):
        path = corners(side, sign)
        end = on_floor(calibration, path)
        for _ in range(count):
            noise = (0.0, 0.0, 0.0) if draw is None else (
                draw.gauss(0.0, 0.02), draw.gauss(0.0, 0.02),
                draw.gauss(0.0, math.radians(0.6)))
            driven.append(Square(path, Pose(
                end.x + noise[0], end.y + noise[1], end.theta + noise[2])))
    return driven


#: One square each way, as if nobody had time, and five as Borenstein and Feng drive.
@pytest.mark.slow
@pytest.mark.parametrize('count, largest', [(1, 0.06), (5, 0.03)])
def test_what_is_measured_with_20_mm_and_0_6_deg_is_enough(count, largest):
    """
    Seeds 0 to 199; errors of 1 % of the wheels and 3 % of the track, drawn evenly.

    20 mm, of x and of y, and 0.6 deg are standard deviations of Gaussian errors.
    """
    worst = {'wheel ratio': 0.0, 'track ratio': 0.0, 'after': 0.0, 'after / before': 0.0}
    for seed in range(200):
        draw = random.Random(seed)
        true = OdometryCalibration(
            1.0, draw.uniform(0.99, 1.01), draw.uniform(0.97, 1.03), TRACK)
        fit = fit_umbmark(squares(true, count, draw), TRACK)
        found = replace(true, wheel_ratio=fit.wheel_ratio.value, track_ratio=fit.track_ratio.value)
        exact = squares(true)
        before = worst_systematic_error(exact, OdometryCalibration())
        after = worst_systematic_error(exact, found)
        worst = {name: max(worst[name], value) for name, value in (
            ('wheel ratio', abs(found.wheel_ratio / true.wheel_ratio - 1.0)),
            ('track ratio', abs(found.track_ratio / true.track_ratio - 1.0)),
            ('after', after),
            # A robot that is nearly right to begin with cannot be measured to be ten times better.
            ('after / before', after / before if before > 0.3 else 0.0))}
        assert abs(found.wheel_ratio - true.wheel_ratio) < 5.0 * fit.wheel_ratio.error, seed
        assert abs(found.track_ratio - true.track_ratio) < 5.0 * fit.track_ratio.error, seed
    print(f'seeds 0 to 199, {count} each way:', worst)
    assert worst['wheel ratio'] < 0.0005
    assert worst['track ratio'] < 0.005
    assert worst['after / before'] < 0.1
    assert worst['after'] < largest


def test_the_closed_forms_are_of_first_order():
    """They find small errors, and take a part of large ones of the wheels for the track."""
    small = closed_form(squares(OdometryCalibration(1.0, 1.0005, 1.002, TRACK)), TRACK)
    assert small == pytest.approx((1.0005, 1.002), abs=2e-4)
    large = closed_form(squares(OdometryCalibration(1.0, 1.01, 1.0, TRACK)), TRACK)
    assert large[0] == pytest.approx(1.0091, abs=1e-4)
    assert large[1] == pytest.approx(1.014, abs=1e-3)
    assert closed_form(squares(OdometryCalibration()), TRACK) == pytest.approx((1.0, 1.0))
    scaled = squares(OdometryCalibration(1.02, 1.0005, 1.002, TRACK))
    assert closed_form(scaled, TRACK)[1] < 0.99
    assert closed_form(scaled, TRACK, 1.02) == pytest.approx((1.0005, 1.002), abs=2e-4)


@pytest.mark.parametrize('track', [0.1, 0.3])
def test_a_wrong_track_gives_another_wheel_ratio_and_the_same_correction(track):
    true = OdometryCalibration(1.0, 1.004, 1.02, TRACK)
    fit = fit_umbmark(squares(true), track)
    assert fit.wheel_ratio.value - 1.0 == pytest.approx(0.004 * track / TRACK, rel=0.01)
    assert fit.track_ratio.value == pytest.approx(1.02, abs=1e-4)
    assert fit.after < 0.001


def mirrored(square):
    """Return a square measured with y to the right."""
    return square._replace(measured=replace(square.measured, y=-square.measured.y))


anything = st.builds(
    Square, st.builds(corners, st.sampled_from([0.0, 0.01, 1.0, 4.0]),
                      st.sampled_from([-1.0, 1.0])),
    st.builds(Pose, st.floats(-5.0, 5.0) | st.floats(), st.floats(-5.0, 5.0) | st.floats(),
              st.floats(-3.0, 3.0) | st.floats()))


@given(st.lists(anything, max_size=4), st.floats(0.01, 10.0), st.floats(0.5, 2.0))
def test_whatever_was_measured_it_fits_or_says_why_not(driven, track, scale):
    with contextlib.suppress(CalibrationError):
        fit = fit_umbmark(driven, track, scale)
        assert 0.9 <= fit.wheel_ratio.value <= 1.1


TRUE = OdometryCalibration(1.0, 1.004, 1.02, TRACK)


@pytest.mark.parametrize('driven, message', [
    (squares(TRUE)[:1],
     'squares in one direction cannot tell unequal wheels from a wrong track: drive both'),
    ([], 'squares in one direction cannot tell unequal wheels from a wrong track: drive both'),
    ([square._replace(measured=Pose(math.nan)) for square in squares(TRUE)],
     'what was measured has a value that is no finite number'),
    ([square._replace(measured=Pose(400.0)) for square in squares(TRUE)],
     ('a square ended 400 m from where odometry reported it, after 16 m: is that in metres, and '
      'from where it began?')),
    ([square._replace(measured=Pose(theta=3.0)) for square in squares(TRUE)],
     ('a square ended turned 172 deg from what odometry reported: is that the heading as seen '
      'from its start?')),
    ([mirrored(square) for square in squares(TRUE)],
     ('what was measured lies 41 times further beside the best fit than measuring explains: is '
      'a sign wrong, was the robot moved, or do wheels slip?')),
    (squares(OdometryCalibration(), side=0.1),
     ('the wheel ratio is 1.0000, give or take 0.0037, and the track ratio 1.000, give or take '
      '0.001: drive larger squares, or more')),
])
def test_what_squares_cannot_tell_is_refused(driven, message):
    with pytest.raises(CalibrationError) as caught:
        fit_umbmark(driven, TRACK)
    assert str(caught.value) == message


def drive(name, parameters, seed):
    """Return the log of a simulated robot, and its true pose at the end."""
    simulated = SimulatedDrive(20.0, parameters=parameters, seed=seed)
    simulated.drive(find(name).motion)
    return simulated.close(), simulated._robot.state(simulated.now)[0]


WORN = SimulationParameters(
    dead_time=0.1, lag=0.1, linear_gain=0.97, angular_gain=1.02, veer=0.02, odometry_scale=0.98,
    wheel_ratio=1.004, track_ratio=1.02, odometry_noise=0.003, heading_noise=math.radians(0.5))


@pytest.mark.slow
@pytest.mark.needs('yaml', 'jsonschema')
def test_a_robot_of_which_all_is_wrong_is_measured_by_its_own_odometry():
    """What it makes of what it is sent does not matter, for odometry reported it."""
    driven = []
    for seed, name in enumerate(('umbmark_cw', 'umbmark_ccw')):
        log, end = drive(name, WORN, seed)
        driven.append(Square(reported_path(log), end))
    fit = fit_umbmark(driven, TRACK, 0.98)
    assert fit.wheel_ratio.value == pytest.approx(1.004, abs=0.0001)
    assert fit.track_ratio.value == pytest.approx(1.02, abs=0.001)
    assert fit.before > 0.5
    assert fit.after < 0.02
