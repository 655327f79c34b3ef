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
"""Tables and paths of plans with corners that are driven without a stop."""

from dataclasses import astuple
from itertools import pairwise
import math

from flow_motions import FLOWS, QUARTER, ROUNDED, ROUNDS, SIDE, TIGHT
from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.analysis.flows import (
    cut_corners,
    is_in_flow,
    repetition_key,
)
from kachaka_simple_control.analysis.plan_view import estimate_sleep_loop
from kachaka_simple_control.motion.geometry import distance_between
from kachaka_simple_control.motion.paths import (
    arc_segments,
    ArcSegment,
    BEND,
    ChainSegment,
    polyline,
    step_segments,
    uncut_path,
)
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Repeat
from plans import GENTLE, SQUARE
import pytest

RATES = st.sampled_from([5.0, 10.0, 20.0, 50.0, 100.0])


def distance_to(points, x, y):
    """Return how far a point is from a line through points [m]."""
    best = math.inf
    for (ax, ay), (bx, by) in pairwise(points):
        along = (bx - ax) ** 2 + (by - ay) ** 2
        part = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / along if along else 0.0
        part = min(1.0, max(0.0, part))
        best = min(best, math.hypot(x - ax - part * (bx - ax), y - ay - part * (by - ay)))
    return best


@given(FLOWS, RATES)
def test_the_drawn_path_is_the_one_that_is_sent(motion, rate):
    planned = plan(motion, GENTLE, rate)
    points = polyline(arc_segments(planned), 1e-6)
    path = planned.path()
    assert points[-1] == pytest.approx((path[-1].x, path[-1].y), abs=1e-9)
    for pose in path[::1 + len(path) // 50]:
        # A straight line that replaces a bend of 4 degrees passes it at 1/57 of its length.
        assert distance_to(points, pose.x, pose.y) < 0.001


@given(FLOWS, RATES)
def test_a_step_of_a_flow_is_one_part_of_the_path(motion, rate):
    """So it gets one number and one arrow, and no corner looks like a turn in place."""
    planned = plan(motion, GENTLE, rate)
    steps = step_segments(planned)
    assert [len(parts) for parts in steps] == [1] * len(motion.steps)
    for step, (part,), following in zip(planned.steps, steps, [*steps[1:], None]):
        assert (part.distance, part.angle) == (
            step.displacement.distance, step.displacement.angle)
        is_cut = step.cut is not None and step.cut.deviation > 0.0
        assert isinstance(part, ChainSegment if is_cut else ArcSegment)
        if following is not None:
            assert distance_between(part.end, following[0].start) == pytest.approx(
                (0.0, 0.0), abs=1e-9)


@given(FLOWS, RATES, st.integers(1, 100))
def test_all_poses_of_a_corner_lie_on_its_path(motion, rate, count):
    for part in arc_segments(plan(motion, GENTLE, rate)):
        if isinstance(part, ChainSegment):
            poses = part.poses(count)
            assert len(poses) == count
            assert distance_between(poses[-1], part.end) == pytest.approx((0.0, 0.0), abs=1e-9)
            headings = [pose.theta for pose in (part.start, *part.poses(part.count))]
            assert all(abs(two - one) <= 1.2 * BEND for one, two in pairwise(headings))


@given(FLOWS, RATES)
def test_the_legs_are_those_of_a_motion_with_stops(motion, rate):
    planned = plan(motion, GENTLE, rate)
    stops = plan(Motion('stops', motion.steps), GENTLE, rate)
    assert uncut_path(planned) == uncut_path(stops)
    assert distance_between(uncut_path(planned)[-1].end, planned.pose) == pytest.approx(
        (0.0, 0.0), abs=1e-9)


def test_what_a_step_of_a_flow_requests_is_what_is_planned_for_it():
    planned = plan(ROUNDED, GENTLE, 20.0)
    assert [is_in_flow(step) for step in planned.steps] == [True] * 7 + [False]
    wanted = [step.displacement for step in planned.steps]
    assert [one.angle for one in wanted[1::2]] == [pytest.approx(QUARTER)] * 4
    # A leg and the two halves of its corners are shorter than the leg.
    assert wanted[0].distance == pytest.approx(0.252, abs=0.001)
    assert wanted[1].distance == pytest.approx(0.44, abs=0.001)
    assert wanted[7] == planned.steps[7].step.displacement
    assert sum(one.distance for one in wanted) == pytest.approx(planned.length)


def test_a_corner_names_the_leg_that_is_short():
    corners = [*cut_corners(plan(TIGHT, GENTLE, 20.0))]
    assert [corner.number for corner in corners] == [1, 2]
    assert [corner.leg for corner in corners] == [0.05, 0.05]
    assert all(corner.cut.is_shrunk for corner in corners)
    assert [*cut_corners(plan(SQUARE, GENTLE, 20.0))] == []


def test_repetitions_that_are_driven_differently_are_told_apart():
    planned = plan(ROUNDS, GENTLE, 20.0)
    keys = [repetition_key(step) for step in planned.steps]
    # The first leg begins at rest, and the last one ends at rest.
    assert len({keys[0], keys[2], keys[-2]}) == 3
    assert keys[2] == keys[6]
    assert len(set(keys)) < 12
    stops = plan(SQUARE, GENTLE, 20.0)
    assert [repetition_key(step) for step in stops.steps] == [step.path for step in stops.steps]


def test_the_loop_of_the_lesson_drives_each_repetition_as_it_is_planned():
    repeated, listed = (
        estimate_sleep_loop([plan(Motion('', steps, corners=0.05), GENTLE, 20.0)])
        for steps in ((Repeat(4, SIDE),), SIDE * 4))
    assert astuple(repeated) == pytest.approx(astuple(listed), abs=1e-9)
