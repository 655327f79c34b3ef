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
"""What a robot sweeps on its planned path."""

from itertools import pairwise
import math

from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.geometry import Disc, integrate, ORIGIN, Pose, relative_to
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Repeat, Turn, Wait
from kachaka_simple_control.motion.swept_path import (
    Outline,
    PlannedWay,
    PointMap,
    SPACING,
    TURN_SPACING,
)
import pytest

FLOW = plan(Motion('flow', (
    Forward(0.5), Turn(1.2), Forward(0.4), Wait(1.0), Turn(-2.0), Arc(0.3, 2.0)), corners=0.05),
    KACHAKA.limits, 20.0)
TIMES = st.floats(0.0, FLOW.duration)
COORDINATES = st.floats(-1.0, 1.0)
POSES = st.builds(Pose, COORDINATES, COORDINATES, st.floats(-7.0, 7.0))
OUTLINES = st.builds(
    Outline, st.sampled_from([KACHAKA.footprint, Disc(0.2)]), st.floats(0.0, 0.1))


@given(st.lists(TIMES, min_size=1, max_size=5))
def test_poses_are_those_of_the_plan_in_any_order(times):
    way, path = PlannedWay(FLOW), FLOW.path()
    for time in times:
        index = next(number for number, segment in enumerate(FLOW.segments)
                     if time <= segment.end)
        segment = FLOW.segments[index]
        expected = integrate(path[index], segment.velocity, time - segment.start)
        assert relative_to(expected, way.pose_at(time)).x == pytest.approx(0.0, abs=1e-12)


@given(TIMES, TIMES)
def test_poses_between_two_times_are_dense_and_include_both(one, two):
    start, end = sorted((one, two))
    points = [*PlannedWay(FLOW).between(start, end)]
    assert points[0].time == start
    assert points[-1].time == pytest.approx(end, abs=1e-9)
    for before, after in pairwise(points):
        assert after.time >= before.time
        # It is longer where the robot speeds up.
        assert after.length - before.length <= 1.5 * SPACING
        assert after.angle - before.angle <= 1.5 * TURN_SPACING


def test_a_long_motion_keeps_few_poses():
    planned = plan(Motion('long', (Repeat(200, (Forward(0.5), Turn(1.0))),)), KACHAKA.limits, 20.0)
    way, path = PlannedWay(planned), planned.path()
    assert way.pose_at(planned.duration) == path[-1]
    assert len(way._poses) < 4100
    assert way.pose_at(0.0) == ORIGIN


def test_a_way_ends_with_a_corner_in_which_it_begins():
    corner = FLOW.steps[1]
    way = PlannedWay(FLOW)
    assert way.time_after(corner.start + 0.1, 0.01, 0.01) >= corner.end - 1e-9
    assert way.time_after(0.0, 0.1, 9.0) < corner.start
    assert way.time_after(0.0, 99.0, 99.0) == FLOW.duration


@settings(max_examples=200)
@given(OUTLINES, POSES, st.lists(st.tuples(COORDINATES, COORDINATES), max_size=20))
def test_points_in_an_outline_are_those_with_a_distance_of_0(outline, pose, points):
    inside = any(outline.distance(point, pose) <= 0.0 for point in points)
    near = any(abs(outline.distance(point, pose)) < 1e-9 for point in points)
    assert PointMap(points).touches(outline, pose) == inside or near


def test_an_outline_has_round_corners():
    outline = Outline(KACHAKA.footprint, 0.05)
    x, y = KACHAKA.footprint.corners()[1]
    step = 0.05 * math.sqrt(0.5)
    assert outline.contains(x + step - 1e-6, y + step - 1e-6)
    assert not outline.contains(x + step + 1e-6, y + step + 1e-6)
    assert outline.contains(x + 0.05 - 1e-9, 0.0)
