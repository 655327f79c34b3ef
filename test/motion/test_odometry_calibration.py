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
"""A robot whose odometry is wrong does on the floor what was planned, within its limits."""

from dataclasses import replace
from itertools import pairwise
import math

from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.files.library import find
from kachaka_simple_control.files.robot_profile import KACHAKA, KACHAKA_TRACK
from kachaka_simple_control.kachaka.simulator.drive_model import DriveModel, SimulationParameters
from kachaka_simple_control.motion.calibration import Calibration, OdometryCalibration
from kachaka_simple_control.motion.geometry import advance, Pose, Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Turn
import pytest

gains = st.floats(0.8, 1.25)
calibrations = st.builds(Calibration, gains, gains, gains, gains, st.floats(-0.1, 0.1))
odometry_calibrations = st.builds(
    OdometryCalibration, gains, st.floats(0.98, 1.02), gains, st.floats(0.15, 0.6))
parts = st.floats(-1.0, 1.0)
#: A robot that is faster forwards than backwards, and brakes otherwise than it speeds up.
UNEQUAL = Limits(0.3, 1.57, 0.5, 2.5, 2.0, 10.0, 0.8, 4.0, 0.2)


@given(odometry_calibrations, parts, parts)
def test_it_is_the_geometry_of_two_wheels(calibration, linear, angular):
    """Wheels of the true radii, a true track apart, turn as those do that odometry thinks of."""
    ratio = calibration.wheel_ratio
    left = 2.0 * calibration.scale / (1.0 + ratio)
    right = ratio * left
    half = calibration.track / 2.0
    ways = (linear - half * angular) * left, (linear + half * angular) * right
    velocity = calibration.to_floor(Velocity(linear, angular))
    assert velocity.linear_x == pytest.approx(sum(ways) / 2.0, abs=1e-12)
    assert velocity.angular_z == pytest.approx(
        (ways[1] - ways[0]) / (calibration.track * calibration.track_ratio), abs=1e-11)


@given(odometry_calibrations, parts, parts)
def test_there_and_back_is_the_same(calibration, linear, angular):
    velocity = Velocity(linear, angular)
    back = calibration.to_floor(calibration.to_odometry(velocity))
    assert back.linear_x == pytest.approx(linear, abs=1e-12)
    assert back.angular_z == pytest.approx(angular, abs=1e-12)


poses = st.builds(Pose, parts, parts, st.floats(-10.0, 10.0))


@given(odometry_calibrations, parts, st.floats(-3.0, 3.0), poses, poses)
def test_an_increment_of_odometry_is_an_arc_on_the_floor(
        calibration, distance, angle, before, start):
    seen = advance(before, distance, angle)
    wrapped = replace(seen, theta=math.remainder(seen.theta, math.tau))
    done = calibration.advance_on_floor(start, before, wrapped)
    way = calibration.to_floor(Velocity(distance, angle))
    expected = advance(start, way.linear_x, way.angular_z)
    assert (done.x, done.y, done.theta) == pytest.approx(
        (expected.x, expected.y, expected.theta), abs=1e-9)


@given(st.lists(poses, min_size=2, max_size=5))
def test_without_errors_the_floor_is_as_odometry_says_with_all_its_noise(seen):
    pose = seen[0]
    for before, after in pairwise(seen):
        pose = OdometryCalibration().advance_on_floor(pose, before, after)
    assert (pose.x, pose.y) == pytest.approx((seen[-1].x, seen[-1].y), abs=1e-9)
    assert math.remainder(pose.theta - seen[-1].theta, math.tau) == pytest.approx(0.0, abs=1e-9)


@given(calibrations, odometry_calibrations, parts, parts)
def test_the_robot_does_what_was_planned(calibration, odometry_calibration, linear, angular):
    profile = replace(
        KACHAKA, calibration=calibration, odometry_calibration=odometry_calibration)
    done = profile.expected(profile.command(Velocity(0.3 * linear, angular)))
    assert done.linear_x == pytest.approx(0.3 * linear, abs=1e-12)
    assert done.angular_z == pytest.approx(angular, abs=1e-12)


@pytest.mark.parametrize('limits', [KACHAKA.limits, UNEQUAL], ids=['kachaka', 'unequal'])
@given(calibration=st.none() | calibrations, odometry_calibration=odometry_calibrations,
       linear=parts, angular=parts)
def test_no_velocity_exceeds_the_limits(
        limits, calibration, odometry_calibration, linear, angular):
    """Neither on the floor, nor by odometry, nor as it is sent."""
    profile = replace(
        KACHAKA, limits=limits, calibration=calibration,
        odometry_calibration=odometry_calibration)
    reduced = profile.planning_limits
    speed = reduced.max_linear_velocity if linear >= 0.0 else reduced.backward_velocity
    velocity = Velocity(speed * linear, reduced.max_angular_velocity * angular)
    limits.check(velocity)
    limits.check(odometry_calibration.to_odometry(velocity))
    limits.check(profile.command(velocity))


@given(calibrations, odometry_calibrations, parts, parts, parts, parts)
def test_no_change_of_what_is_sent_exceeds_the_limits(
        calibration, odometry_calibration, linear, angular, dv, dw):
    """A command is linear in a velocity, so accelerations and jerks are as changes are."""
    profile = replace(
        KACHAKA, calibration=calibration, odometry_calibration=odometry_calibration)
    limits, reduced, time = profile.limits, profile.planning_limits, 0.01
    for kind in ('acceleration', 'jerk'):
        bounds = [getattr(limits, f'max_{axis}_{kind}') for axis in ('linear', 'angular')]
        steps = [getattr(reduced, f'max_{axis}_{kind}') for axis in ('linear', 'angular')]
        before = Velocity(0.2 * linear, angular)
        after = Velocity(before.linear_x + steps[0] * dv * time,
                         before.angular_z + steps[1] * dw * time)
        sent, then = profile.command(before), profile.command(after)
        assert abs(then.linear_x - sent.linear_x) <= bounds[0] * time * (1.0 + 1e-9)
        assert abs(then.angular_z - sent.angular_z) <= bounds[1] * time * (1.0 + 1e-9)


ways = st.floats(-2.0, 2.0).filter(lambda value: abs(value) > 0.01)
steps = (st.builds(Forward, ways) | st.builds(Turn, ways)
         | st.builds(Arc, ways, st.floats(0.1, 3.0)))


@given(calibrations, odometry_calibrations, st.lists(steps, min_size=1, max_size=4),
       st.sampled_from([10.0, 50.0]))
def test_no_plan_asks_for_more_than_the_robot_can(
        calibration, odometry_calibration, driven, rate):
    """Nothing that is sent for a plan within the reduced limits is beyond those of the robot."""
    profile = replace(KACHAKA, limits=UNEQUAL, calibration=calibration,
                      odometry_calibration=odometry_calibration)
    planned = plan(Motion('ways', driven), profile.planning_limits, rate)
    sent = [profile.command(segment.velocity) for segment in planned.segments]
    for velocity in sent:
        UNEQUAL.check(velocity)
    ticks = [segment for segment in planned.segments if segment.end - segment.start > 0.999 / rate]
    for one, two in pairwise(ticks):
        change = 1.0 / rate * (1.0 + 1e-6)
        before, after = profile.command(one.velocity), profile.command(two.velocity)
        assert abs(after.linear_x - before.linear_x) <= 0.8 * change
        assert abs(after.angular_z - before.angular_z) <= 4.0 * change


def drive(motion, profile, robot, rate=20.0):
    """Return where a motion ends as planned, and where on the floor if it is sent open loop."""
    simulated = DriveModel(robot, 0.0, 0)
    planned = plan(motion, profile.planning_limits, rate)
    for segment in planned.segments:
        simulated.set_target(profile.command(segment.velocity), segment.start)
    simulated.set_target(ZERO, planned.duration)
    return planned.pose, simulated.state_at(planned.duration + 2.0)[0]


@pytest.mark.slow
@settings(max_examples=examples(8))  # each is a drive
@given(calibrations, st.floats(0.9, 1.1), st.floats(0.99, 1.01), st.floats(0.9, 1.1))
def test_a_square_ends_on_the_floor_where_it_was_planned(
        calibration, scale, wheel_ratio, track_ratio):
    """Of a robot that does otherwise than it is sent, and whose odometry is wrong as well."""
    robot = SimulationParameters(
        dead_time=0.2, lag=0.1, linear_gain=calibration.forward_gain,
        backward_gain=calibration.backward_gain / calibration.forward_gain,
        angular_gain=calibration.left_gain,
        right_gain=calibration.right_gain / calibration.left_gain, veer=calibration.veer,
        odometry_scale=scale, wheel_ratio=wheel_ratio, track_ratio=track_ratio)
    profile = replace(KACHAKA, calibration=calibration, odometry_calibration=OdometryCalibration(
        scale, wheel_ratio, track_ratio, KACHAKA_TRACK))
    planned, done = drive(find('square').motion, profile, robot)
    assert math.hypot(done.x - planned.x, done.y - planned.y) < 0.002
    assert abs(math.degrees(math.remainder(done.theta - planned.theta, math.tau))) < 0.3


@pytest.mark.parametrize('values, message', [
    ({'scale': 0.4}, 'scale is 0.4; it must be from 0.5 to 2'),
    ({'wheel_ratio': 1.2, 'track': 0.2}, 'wheel_ratio is 1.2; it must be from 0.9 to 1.1'),
    ({'track_ratio': 2.5}, 'track_ratio is 2.5; it must be from 0.5 to 2'),
    ({'track': 0.0}, 'track is 0.0 m; it must be from 0.01 to 10 m'),
    ({'track': math.nan}, 'track is nan m; it must be a finite number'),
    ({'wheel_ratio': 1.01},
     'wheel_ratio is 1.01, which needs track, the one that odometry uses, such as 0.2 m'),
])
def test_what_cannot_be_is_refused(values, message):
    with pytest.raises(InvalidMotionError) as caught:
        OdometryCalibration(**values)
    assert str(caught.value) == message


def test_a_wheel_ratio_that_leaves_nothing_to_turn_with_is_refused():
    with pytest.raises(InvalidMotionError, match=(
            'wheel_ratio is 1.1, which needs all of max_angular_velocity, 0.1$')):
        OdometryCalibration(wheel_ratio=1.1, track=0.2).reduce(Limits(0.3, 0.1))
