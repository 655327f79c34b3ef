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
"""What is drawn of a plan, before there is a picture: lines, outlines, stairs."""

import math

from hypothesis import given
from kachaka_simple_control.motion.geometry import ORIGIN, outline, Pose
from kachaka_simple_control.motion.paths import (
    arc_segments,
    ArcSegment,
    MAX_POINTS,
    polyline,
)
from kachaka_simple_control.motion.steps import Arc, Motion, Move, Repeat
from kachaka_simple_control.report.plot_style import velocity_steps
from plans import BOX, HOUR, preview, QUARTER
import pytest
from strategies import LIMITS, MOTIONS, RATES


def distance_to(points, x, y):
    """Return how far a point is from a line through points [m]."""
    best = math.inf
    for (ax, ay), (bx, by) in zip(points, points[1:] or points):
        along = (bx - ax) ** 2 + (by - ay) ** 2
        part = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / along if along else 0.0
        part = min(1.0, max(0.0, part))
        best = min(best, math.hypot(x - ax - part * (bx - ax), y - ay - part * (by - ay)))
    return best


@given(MOTIONS, LIMITS, RATES)
def test_the_line_goes_where_the_velocities_lead(motion, limits, rate):
    """What is drawn by step is what is sent by tick."""
    plan = preview(motion, limits, rate).plan
    points = polyline(arc_segments(plan), 0.001)
    poses = plan.path()
    assert points[-1] == pytest.approx((poses[-1].x, poses[-1].y), abs=1e-6)
    if len(points) < 500:
        for pose in poses[::1 + len(poses) // 20]:
            # A chord of 4 degrees is off by 1/1600 of the radius.
            assert distance_to(points, pose.x, pose.y) <= 1e-6 + 60.0 / 1600.0


def test_a_thousand_rounds_are_drawn_as_two():
    plan = preview(Motion('', [Arc(0.3, 1000.25 * math.tau)])).plan
    points = polyline(arc_segments(plan), 0.001)
    assert len(points) < 200
    assert points[-1] == pytest.approx((0.3, 0.3))
    assert points[-1] == pytest.approx((plan.pose.x, plan.pose.y))


def test_repeated_lines_are_drawn_once():
    points = polyline(arc_segments(preview(HOUR).plan), 0.001)
    seen = [point for point in points if not math.isnan(point[0])]
    assert len(seen) < 10
    for corner in ((0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)):
        assert any(point == pytest.approx(corner, abs=1e-6) for point in seen)


def test_a_line_without_end_keeps_its_extent():
    steps = [Move(0.001 * number, 1.0, 0.5) for number in range(200)]
    points = polyline(arc_segments(preview(Motion('', [Repeat(10, steps)])).plan), 1e-6)
    assert len(points) <= MAX_POINTS


def test_outlines_turn_about_the_axle():
    """The axle of this box is 0.05 m behind its middle."""
    assert outline(BOX, ORIGIN) == [pytest.approx(corner) for corner in (
        (0.25, -0.1), (0.25, 0.1), (-0.15, 0.1), (-0.15, -0.1))]
    assert outline(BOX, Pose(1.0, 2.0, QUARTER)) == [pytest.approx(corner) for corner in (
        (1.1, 2.25), (0.9, 2.25), (0.9, 1.85), (1.1, 1.85))]


def test_a_turn_in_place_is_swept_to_its_end():
    points = ArcSegment(Pose(1.0, 0.0, QUARTER), 0.0, -QUARTER).sweep(0.2)
    assert points[0] == pytest.approx((1.0, 0.2))
    assert points[-1] == pytest.approx((1.2, 0.0))
    many = ArcSegment(ORIGIN, 0.0, 100.25 * math.tau).sweep(0.2)
    assert many[-1] == pytest.approx((0.0, 0.2))
    assert len(many) < 90


@given(MOTIONS, LIMITS, RATES)
def test_stairs_hold_each_velocity_until_the_next(motion, limits, rate):
    plan = preview(motion, limits, rate).plan
    for component in ('linear_x', 'angular_z'):
        corners = velocity_steps(plan, component)
        assert corners[-1] == (plan.duration, 0.0)
        if len(corners) <= 200:
            for segment in plan.segments[::1 + len(plan.segments) // 20]:
                middle = (segment.start + segment.end) / 2.0
                held = [value for time, value in corners if time <= middle]
                # Between two times next to each other there is none.
                assert middle == segment.end or held[-1] == getattr(segment.velocity, component)
