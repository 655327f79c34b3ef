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
"""1 m and a turn, as measured with a tape, are fitted to odometry, or refused with the reason."""

from dataclasses import replace
import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.analysis.calibration_fit import CalibrationError
from kachaka_simple_control.analysis.odometry_fit import (
    fit_floor,
    reported_displacement,
    reported_path,
)
from kachaka_simple_control.files.library import find
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
import pytest
from simulated_drive import SimulatedDrive


@given(st.floats(0.9, 1.1), st.floats(0.9, 1.1))
def test_a_line_and_a_turn_tell_scale_and_track(scale, track_ratio):
    fit = fit_floor(0.99, 0.99 * scale, 6.3, 6.3 * scale / track_ratio)
    assert fit.scale.value == pytest.approx(scale)
    assert fit.track_ratio.value == pytest.approx(track_ratio)
    assert fit.scale.error == pytest.approx(0.0015 / 0.99, rel=1e-6)
    assert fit.scale.error < fit.track_ratio.error < 0.005


@pytest.mark.parametrize('values, message', [
    ((1.0, 0.4, 6.28, 6.28),
     'the distance is 0.4 m by the tape and 1 m by odometry: which of them is wrong?'),
    ((1.0, 1.0, 6.28, 0.03),
     'the angle is 0.03 rad by the tape and 6.28 rad by odometry: which of them is wrong?'),
    ((1.0, 1.0, 6.28, -6.28),
     'the angle is -6.28 rad by the tape and 6.28 rad by odometry: which of them is wrong?'),
    ((0.0, 1.0, 6.28, 6.28),
     'the distance is 1 m by the tape and 0 m by odometry: which of them is wrong?'),
    ((1.0, math.nan, 6.28, 6.28), 'the distance is no finite number'),
    ((1.0, 1.9, 6.28, 3.3),
     'the track would be 3.62 times what odometry uses: was all measured rightly?'),
])
def test_what_1_m_cannot_tell_is_refused(values, message):
    with pytest.raises(CalibrationError) as caught:
        fit_floor(*values)
    assert str(caught.value) == message


def drive(name, parameters, seed=0, change=None):
    """Return the log of a simulated robot, and its true pose at the end."""
    simulated = SimulatedDrive(20.0, parameters=parameters, seed=seed)
    simulated.drive(find(name).motion)
    log = simulated.close()
    if change is not None:
        log.odometry[:] = [sample for sample in log.odometry if change(sample)]
    return log, simulated._robot.state(simulated.now)[0]


WORN = SimulationParameters(
    dead_time=0.1, lag=0.1, linear_gain=0.97, angular_gain=1.02, veer=0.02, odometry_scale=0.98,
    wheel_ratio=1.004, track_ratio=1.02, odometry_noise=0.003, heading_noise=math.radians(0.5))


@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize('seed', range(5))
def test_a_robot_of_which_all_is_wrong_is_measured_by_its_own_odometry(seed):
    """What it makes of what it is sent does not matter, for odometry reported it."""
    (line, line_end), (turn, turn_end) = (
        drive(name, WORN, seed) for name in ('floor_straight', 'floor_turn'))
    fit = fit_floor(
        reported_displacement(reported_path(line))[0], math.hypot(line_end.x, line_end.y),
        reported_displacement(reported_path(turn))[1], turn_end.theta)
    assert fit.scale.value == pytest.approx(0.98, abs=0.003)
    assert fit.track_ratio.value == pytest.approx(1.02, abs=0.005)


@pytest.mark.needs('yaml', 'jsonschema')
@pytest.mark.parametrize('name, change, message', [
    ('straight', None, 'the motion must begin and end with a wait'),
    ('floor_straight', lambda sample: sample.time < 5001.0,
     ('odometry reported where the robot stood 0 times in 1 s; at least 10 are needed: is its '
      'odometry there, at 10 Hz or more?')),
])
def test_a_drive_that_odometry_did_not_see_is_refused(name, change, message):
    log, _ = drive(name, replace(WORN, odometry_noise=0.0), change=change)
    with pytest.raises(CalibrationError) as caught:
        reported_path(log)
    assert str(caught.value) == message


@pytest.mark.needs('yaml', 'jsonschema')
def test_a_drive_that_was_stopped_is_refused():
    simulated = SimulatedDrive(20.0)
    simulated.drive(find('floor_straight').motion, until=3.0, reason='interrupted')
    with pytest.raises(CalibrationError, match='the drive was not completed: begin again'):
        reported_path(simulated.close())
