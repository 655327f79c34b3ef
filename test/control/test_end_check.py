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
"""How far from its plan a drive ends, by odometry."""

import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.end_check import describe_end, EndCheck, EndTolerance
from kachaka_simple_control.motion.calibration import OdometryCalibration
from kachaka_simple_control.motion.geometry import compose, Displacement, Pose
from kachaka_simple_control.motion.units import UnitError
import pytest

METRE = Pose(1.0, 0.0, 0.0)
POSES = st.builds(Pose, *3 * [st.floats(-3.0, 3.0)])


@given(start=POSES, ways=st.lists(POSES, min_size=1, max_size=4), off=POSES)
def test_motions_without_a_rest_between_count_as_one(start, ways, off):
    check, goal = EndCheck(None), start
    check.on_odometry(start)
    for way in ways:
        check.begin()
        check.on_odometry(Pose(9.0, 9.0, 1.0))  # still on its way
        check.on_complete(way)
        goal = compose(goal, way)
    check.on_odometry(compose(goal, off))
    error = check.at_rest()
    assert error.distance == pytest.approx(math.hypot(off.x, off.y), abs=1e-9)
    assert error.angle == pytest.approx(math.remainder(off.theta, math.tau), abs=1e-9)


def test_after_a_rest_a_motion_begins_where_the_robot_is():
    check = EndCheck(None)
    for pose in (Pose(), Pose(5.0, 5.0, 0.0)):  # carried there meanwhile
        check.on_odometry(pose)
        check.begin()
        check.on_odometry(compose(pose, METRE))
        check.on_complete(METRE)
        assert check.at_rest() == Displacement(0.0, 0.0)
        assert check.at_rest() is None


def test_a_motion_that_was_ended_early_is_not_judged():
    check = EndCheck(None)
    check.on_odometry(Pose())
    check.begin()
    check.on_complete(METRE)
    check.begin()
    assert check.at_rest() is None


def test_without_odometry_nothing_is_known():
    check = EndCheck(None)
    check.begin()
    check.on_complete(METRE)
    check.on_odometry(METRE)
    assert check.at_rest() is None


def test_odometry_is_judged_as_calibrated():
    check = EndCheck(OdometryCalibration(scale=1.25))
    check.on_odometry(Pose(2.0, 0.0, 0.0))
    check.begin()
    check.on_odometry(Pose(2.8, 0.0, 0.0))
    check.on_complete(METRE)
    assert check.at_rest().distance == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('text, distance, angle', [
    ('2cm', 0.02, math.radians(3.0)), ('2 cm, 5 deg', 0.02, math.radians(5.0)),
    ('0m,0deg', 0.0, 0.0)])
def test_a_tolerance_is_a_length_and_perhaps_an_angle(text, distance, angle):
    assert EndTolerance.parse(text) == EndTolerance(distance, pytest.approx(angle))


@pytest.mark.parametrize('text', ['', '2', '3deg', '2cm,', '2cm,3', '-2cm', '2cm,3cm', '2m'])
def test_another_text_is_refused_with_what_to_write(text):
    with pytest.raises(UnitError, match='; for example 2cm or 2cm,3deg$'):
        EndTolerance.parse(text)


@pytest.mark.parametrize('error, is_near', [
    (Displacement(0.02, 0.0), True), (Displacement(0.021, 0.0), False),
    (Displacement(0.0, math.radians(-2.9)), True), (Displacement(0.0, math.radians(-3.1)), False)])
def test_distance_and_angle_both_count(error, is_near):
    assert (describe_end(error, EndTolerance()) is None) is is_near
