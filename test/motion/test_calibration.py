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
"""What is sent to a calibrated robot makes it do what was planned, within its limits."""

import math

from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.simulator.drive_model import DriveModel, SimulationParameters
from kachaka_simple_control.motion.calibration import Calibration
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
import pytest

gains = st.floats(0.8, 1.25)
calibrations = st.builds(Calibration, gains, gains, gains, gains, st.floats(-0.1, 0.1))
parts = st.floats(-1.0, 1.0)
#: A robot that is faster forwards than backwards, and brakes otherwise than it speeds up.
UNEQUAL = Limits(0.3, 1.57, 0.5, 2.5, 2.0, 10.0, 0.8, 4.0, 0.2)


@given(calibrations, parts, parts)
def test_the_robot_does_what_was_planned(calibration, linear, angular):
    velocity = Velocity(0.3 * linear, 1.57 * angular)
    done = calibration.response(calibration.command(velocity))
    assert done.linear_x == pytest.approx(velocity.linear_x, abs=1e-12)
    assert done.angular_z == pytest.approx(velocity.angular_z, abs=1e-12)


@pytest.mark.parametrize('limits', [KACHAKA.limits, UNEQUAL], ids=['kachaka', 'unequal'])
@given(calibration=calibrations, linear=parts, angular=parts)
def test_neither_plan_nor_commands_exceed_the_limits(limits, calibration, linear, angular):
    reduced = calibration.reduce(limits)
    speed = reduced.max_linear_velocity if linear >= 0.0 else reduced.backward_velocity
    velocity = Velocity(speed * linear, reduced.max_angular_velocity * angular)
    limits.check(velocity)
    limits.check(calibration.command(velocity))


@given(calibrations, parts, parts, parts, parts)
def test_no_change_of_what_is_sent_exceeds_the_limits(calibration, linear, angular, dv, dw):
    """A command is linear in a velocity, so accelerations and jerks are as changes are."""
    limits = KACHAKA.limits
    reduced = calibration.reduce(limits)
    for linear_bound, reduced_linear, angular_bound, reduced_angular in (
            (limits.max_linear_acceleration, reduced.max_linear_acceleration,
             limits.max_angular_acceleration, reduced.max_angular_acceleration),
            (limits.max_linear_jerk, reduced.max_linear_jerk,
             limits.max_angular_jerk, reduced.max_angular_jerk)):
        time = 0.01
        before = Velocity(0.2 * linear, angular)
        after = Velocity(before.linear_x + reduced_linear * dv * time,
                         before.angular_z + reduced_angular * dw * time)
        sent, then = calibration.command(before), calibration.command(after)
        assert abs(then.linear_x - sent.linear_x) <= linear_bound * time * (1.0 + 1e-9)
        assert abs(then.angular_z - sent.angular_z) <= angular_bound * time * (1.0 + 1e-9)


@pytest.mark.parametrize('values, message', [
    ({'forward_gain': 0.4}, 'forward_gain is 0.4; it must be from 0.5 to 2'),
    ({'right_gain': math.nan}, 'right_gain is nan ; it must be a finite number'),
    ({'veer': 1.1}, 'veer is 1.1 rad/m; it must be from -1 to 1 rad/m'),
    ({'delay': -0.1}, 'delay is -0.1 s; it must be from 0 to 3 s'),
    ({'delay': 300.0}, 'delay is 300.0 s; it must be from 0 to 3 s'),
    ({'delay': math.nan}, 'delay is nan s; it must be a finite number'),
])
def test_what_cannot_be_is_refused(values, message):
    with pytest.raises(InvalidMotionError) as caught:
        Calibration(**values)
    assert str(caught.value) == message


def test_a_veer_that_leaves_nothing_to_turn_with_is_refused():
    with pytest.raises(InvalidMotionError, match=(
            'veer is -0.5 rad/m, which needs all of max_angular_velocity, 0.1$')):
        Calibration(veer=-0.5).reduce(Limits(0.3, 0.1))


def drive(motion, calibration, robot, rate=20.0):
    """Return where a simulated robot ends that is sent a motion, open loop."""
    drive = DriveModel(robot, 0.0, 0)
    planned = plan(motion, calibration.reduce(KACHAKA.limits), rate)
    for segment in planned.segments:
        drive.set_target(calibration.command(segment.velocity), segment.start)
    drive.set_target(ZERO, planned.duration)
    return planned.pose, drive.state_at(planned.duration + 2.0)[0]


@pytest.mark.slow
@given(calibrations)
@settings(max_examples=examples(8))  # each is a drive
def test_a_calibrated_square_ends_where_it_was_planned(calibration):
    robot = SimulationParameters(
        dead_time=0.2, lag=0.1, linear_gain=calibration.forward_gain,
        backward_gain=calibration.backward_gain / calibration.forward_gain,
        angular_gain=calibration.left_gain,
        right_gain=calibration.right_gain / calibration.left_gain, veer=calibration.veer)
    planned, done = drive(find('square').motion, calibration, robot)
    assert math.hypot(done.x - planned.x, done.y - planned.y) < 0.002
    assert abs(math.degrees(math.remainder(done.theta - planned.theta, math.tau))) < 0.3
