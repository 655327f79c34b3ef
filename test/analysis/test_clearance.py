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
"""Where robots on one floor come too near, compared with dense sampling of their plans."""

from __future__ import annotations

from bisect import bisect_right
from itertools import pairwise, product
import math

from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.analysis import pair_search
from kachaka_simple_control.analysis.clearance import (
    FloorRobot,
    MAX_ROUNDS,
    near_passes,
    TOUCH,
)
from kachaka_simple_control.analysis.pair_search import EDGE, GRAIN, PairSearch, Track
from kachaka_simple_control.motion.geometry import (
    Box,
    compose,
    Disc,
    integrate,
    ORIGIN,
    outline,
    Pose,
    relative_to,
    transform_point,
)
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.separation import gap, Hull
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Turn, Wait
from plans import ABRUPT, BOX, EMPTY, GENTLE, QUARTER, SPIN, SQUARE, SQUARE_CW
import pytest
from strategies import MOTIONS

#: How far rounding may move a figure [m].
EXACT = 1e-9
FOOTPRINTS = st.one_of(
    st.none(), st.builds(Disc, st.floats(0.01, 0.5)),
    st.builds(Box, st.floats(0.05, 1.0), st.floats(0.05, 1.0), st.floats(-0.3, 0.3)))
#: Linear [m/s] and angular [rad/s].
VELOCITIES = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.5, 1.5))
POSES = st.builds(Pose, st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-4.0, 4.0))
MARGIN = 0.1


def robot(name, motion, x=0.0, y=0.0, degrees=0.0, footprint=BOX, limits=GENTLE):
    """Return a robot on the floor."""
    return FloorRobot(name, plan(motion, limits, 10.0), Pose(x, y, math.radians(degrees)),
                      footprint)


def distance_of(one, pose, two, other):
    """Return the distance between two outlines by their edges, another way than the program's."""
    (first, grown), (second, more) = (
        ([(place.x, place.y)], footprint.radius if footprint else 0.0)
        if footprint is None or isinstance(footprint, Disc) else (outline(footprint, place), 0.0)
        for footprint, place in ((one, pose), (two, other)))
    if any(is_inside(point, corners) for corners, points in ((first, second), (second, first))
           for point in points) or any(
               cross(*one, *two) for one, two in product(edges(first), edges(second))):
        return 0.0
    return max(0.0, min(
        to_edge(point, edge) for corners, points in ((first, second), (second, first))
        for point in points for edge in edges(corners)) - grown - more)


def edges(corners):
    """Return the edges of a polygon; of a point, one without length."""
    return [*pairwise([*corners, corners[0]])] if len(corners) > 1 else [(corners[0],) * 2]


def side(a, b, c):
    """Return on which side of a line from a to b the point c is: above 0 to the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def is_inside(point, corners):
    """Return whether a point is in a polygon, which is counter-clockwise."""
    return len(corners) > 1 and all(side(*edge, point) >= 0.0 for edge in edges(corners))


def cross(a, b, c, d):
    """Return whether two lines cross."""
    return (side(a, b, c) * side(a, b, d) < 0.0) and (side(c, d, a) * side(c, d, b) < 0.0)


def to_edge(point, edge):
    """Return how far a point is from a line between two points."""
    (x, y), (end_x, end_y) = edge
    length = (end_x - x) ** 2 + (end_y - y) ** 2
    along = 0.0 if not length else min(max(0.0, (
        (point[0] - x) * (end_x - x) + (point[1] - y) * (end_y - y)) / length), 1.0)
    return math.hypot(point[0] - x - along * (end_x - x), point[1] - y - along * (end_y - y))


def poses_at(robot, times):
    """Return where a robot is at some times, in their order, on the floor."""
    poses, segments = robot.plan.path(robot.start), robot.plan.segments
    starts = [segment.start for segment in segments]
    found = []
    for time in times:
        index = bisect_right(starts, time) - 1
        if index < 0:
            found.append(robot.start)
            continue
        since = min(time, segments[index].end) - segments[index].start
        found.append(integrate(poses[index], segments[index].velocity, since))
    return found


def distances_at(one, two, times):
    """Return the distances of two robots at some times."""
    return [distance_of(one.footprint, pose, two.footprint, other)
            for pose, other in zip(poses_at(one, times), poses_at(two, times))]


@given(FOOTPRINTS, FOOTPRINTS, POSES, POSES)
@settings(max_examples=examples(60))
def test_the_distance_of_outlines_is_that_of_their_edges(one, two, pose, other):
    found = gap(Hull.of(one), Hull.of(two), relative_to(pose, other))
    true = distance_of(one, pose, two, other)
    assert found.distance == pytest.approx(true, abs=EXACT)
    if true > 1e-6:
        # The place is in the middle, and the direction leads through it from one to the other.
        place = transform_point(found.place, pose)
        spot = Pose(*place)
        assert distance_of(one, pose, None, spot) == pytest.approx(true / 2.0, abs=EXACT)
        assert distance_of(two, other, None, spot) == pytest.approx(true / 2.0, abs=EXACT)
        angle = math.atan2(*found.direction[::-1]) + pose.theta
        nearer = Pose(other.x - 0.5 * true * math.cos(angle),
                      other.y - 0.5 * true * math.sin(angle), other.theta)
        assert distance_of(one, pose, two, nearer) == pytest.approx(true / 2.0, abs=EXACT)


@pytest.mark.parametrize('degrees', [0.0, 20.0, -40.0])
def test_crossed_outlines_overlap_without_a_corner_in_the_other(degrees):
    long, pose = Hull.of(Box(2.0, 0.1)), Pose(0.0, 0.0, math.radians(degrees))
    wide = Hull.of(Box(0.1, 2.0))
    found = gap(long, wide, pose)
    assert found.distance == 0.0
    assert math.hypot(*found.place) < 0.1


@given(MOTIONS, MOTIONS, FOOTPRINTS, FOOTPRINTS, POSES, st.floats(0.0, 0.5))
def test_no_near_pass_is_missed_and_each_is_as_found(first, second, box, other, start, margin):
    limits = Limits(0.3, 1.57, 0.5, 2.5, 2.0, 10.0)
    one = FloorRobot('one', plan(first, limits, 10.0), Pose(0.3, -0.2, 0.7), box)
    two = FloorRobot('two', plan(second, limits, 10.0), compose(one.start, start), other)
    below = max(margin, TOUCH)
    duration = max(one.plan.duration, two.plan.duration)
    times = [duration * number / 200 for number in range(201)]
    sampled = distances_at(one, two, times)
    found = near_passes([one, two], margin)
    if not found:
        assert min(sampled) >= below - 2.0 * GRAIN - EXACT
        return
    [near] = found
    assert near.names == ('one', 'two')
    assert near.distance <= min(min(sampled) + GRAIN + EXACT, below - GRAIN)
    # The smallest distance may be in a later pass than the first.
    assert 0.0 <= near.begin <= min(near.time, near.end)
    assert max(near.time, near.end) <= duration
    assert distances_at(one, two, [near.time]) == [pytest.approx(near.distance, abs=2.0 * EDGE)]
    spot = Pose(*near.place)
    if near.distance > 3.0 * EDGE:
        for passing in (one, two):
            assert distance_of(passing.footprint, *poses_at(passing, [near.time]), None, spot) == (
                pytest.approx(near.distance / 2.0, abs=2.0 * EDGE))
    for time, distance in zip(times, sampled):
        if time < near.begin:
            assert distance >= below - GRAIN - EXACT
        elif time < near.end:
            assert distance < below + EDGE
    for passing, index in zip((one, two), near.steps):
        if index is None:
            assert near.time >= passing.plan.duration
        else:
            step = passing.plan.steps[index]
            assert step.start <= near.time <= step.end


@given(VELOCITIES, VELOCITIES, FOOTPRINTS, FOOTPRINTS, POSES, st.floats(0.01, 2.0))
@settings(max_examples=examples(40))
def test_the_bounds_between_two_moments_hold(first, second, box, other, offset, span):
    limits = Limits(2.0, 2.0)
    tracks = [Track(plan(Motion([Move(*velocity, span)]), limits, 10.0))
              for velocity in (first, second)]
    search = PairSearch((tracks[0], tracks[1]), (Hull.of(box), Hull.of(other)), offset)
    moments = [search._at(span * number / 100) for number in range(101)]
    lowest, highest = search._bounds(moments[0], moments[-1])
    for moment in moments:
        assert lowest - EXACT <= moment.gap.distance <= highest + EXACT


def test_robots_that_drive_beside_each_other_at_the_margin_are_not_near():
    """Their distance is the margin all the time, but for rounding."""
    width = BOX.width + MARGIN
    for motion in (Motion([Forward(1.0)]), Motion([Move(-0.2, 0.0, 5.0)])):
        robots = [robot(f'r{number}', motion, y=number * width) for number in range(5)]
        assert near_passes(robots, MARGIN) == []
        passes = near_passes(robots, MARGIN + 0.001)
        assert len(passes) == 4
        assert {(near.begin, near.time) for near in passes} == {(0.0, 0.0)}


def test_robots_that_pass_at_the_margin_on_lanes_are_not_near():
    lanes = [robot('out', Motion([Forward(2.0)])),
             robot('back', Motion([Forward(2.0)]), x=2.0, y=BOX.width + MARGIN, degrees=180.0)]
    assert near_passes(lanes, MARGIN) == []
    [near] = near_passes(lanes, MARGIN + 0.001)
    assert near.distance == pytest.approx(MARGIN, abs=GRAIN)


def test_a_pass_that_is_hardly_near_does_not_begin_after_its_smallest_distance():
    lanes = [robot('out', Motion([Forward(2.0)])),
             robot('back', Motion([Forward(2.0)]), 2.0, BOX.width + MARGIN - 1.5 * GRAIN, 180.0)]
    [near] = near_passes(lanes, MARGIN)
    assert near.begin <= near.time


@pytest.mark.slow
def test_a_velocity_held_for_an_hour_is_looked_at_in_parts():
    robots = [robot('a', Motion([Move(0.1, 1.0, 3600.0)])), robot('b', EMPTY, x=0.5)]
    assert len(near_passes(robots, MARGIN)) == 1


def test_robots_on_circles_about_one_centre_keep_their_distance():
    """A rigid formation turns about a point, the outer one faster."""
    robots = [robot('inner', Motion([Move(0.1, 0.5, 12.0)])),
              robot('outer', Motion([Move(0.27, 0.5, 12.0)]), y=-0.34)]
    assert near_passes(robots, MARGIN + 0.04 - 1e-9) == []
    [near] = near_passes(robots, MARGIN + 0.04 + 0.001)
    assert near.distance == pytest.approx(MARGIN + 0.04, abs=GRAIN)


def test_a_short_pass_between_two_messages_is_found():
    """Two fast robots, each as large as a coin, cross at a point within 10 ms."""
    limits = Limits(3.0, 3.0)
    coin = Disc(0.012)
    out = robot('out', Motion([Move(3.0, 0.0, 2.0)]), footprint=coin, limits=limits)
    for delay, is_near in ((0.0, True), (0.1, False)):
        across = robot('across', Motion([Wait(delay), Move(3.0, 0.0, 2.0)]), x=2.03, y=-2.03,
                       degrees=90.0, footprint=coin, limits=limits)
        found = near_passes([out, across], TOUCH)
        assert [near.time for near in found] == (
            [pytest.approx(2.03 / 3.0, abs=0.01)] if is_near else [])


def test_a_robot_that_has_ended_stands_still():
    late = robot('late', Motion([Wait(10.0), Forward(1.0)]), x=-1.0)
    [near] = near_passes([robot('done', Motion([Forward(0.2)])), late], MARGIN)
    assert near.steps == (None, 1)
    # Both outlines meet 5 mm after half of the way.
    assert near.distance == 0.0
    assert near.begin > 10.0
    assert near.end == pytest.approx(late.plan.duration)


def test_robots_that_start_in_one_place_touch_at_once():
    [near] = near_passes([robot('a', SQUARE), robot('b', SQUARE)], 0.0)
    assert (near.distance, near.begin, near.time, near.steps) == (0.0, 0.0, 0.0, (0, 0))
    assert near.end == pytest.approx(plan(SQUARE, GENTLE, 10.0).duration)


def test_robots_that_never_move_are_compared_where_they_stand():
    assert near_passes([robot('a', EMPTY), robot('b', EMPTY, y=0.31)], MARGIN) == []
    [near] = near_passes([robot('a', EMPTY), robot('b', EMPTY, y=0.25)], MARGIN)
    assert near.distance == pytest.approx(0.05)
    assert near.place == pytest.approx((0.05, 0.125), abs=0.21)
    assert near.steps == (None, None)
    assert (near.begin, near.end) == (0.0, 0.0)


def test_two_passes_are_one_with_the_first_interval_and_the_smallest_distance():
    """The second robot goes away, and then comes nearer than it was."""
    moving = robot('b', Motion([Forward(0.5), Wait(1.0), Forward(-0.53)]), x=BOX.length + 0.08)
    [near] = near_passes([robot('a', EMPTY), moving], MARGIN)
    assert near.begin == 0.0
    assert near.end < 1.0
    assert near.distance == pytest.approx(0.05, abs=2.0 * GRAIN)
    assert near.time == pytest.approx(moving.plan.duration, abs=0.2)
    assert near.steps[0] is None


def test_a_turn_swings_the_corners_of_an_outline():
    """The middle of the robot stays, and its front reaches the other one."""
    standing = robot('a', EMPTY, y=0.35, footprint=None)
    [near] = near_passes([standing, robot('b', Motion([Turn(math.pi)]))], MARGIN)
    assert near.distance == pytest.approx(0.35 - math.hypot(0.25, 0.1), abs=GRAIN)
    assert near_passes([standing, robot('b', Motion([Turn(math.pi)]), footprint=Disc(0.2))],
                       MARGIN) == []


def test_an_arc_bulges_out_of_the_chord_between_two_messages():
    """A velocity that is held for a whole circle ends where it began."""
    circle = robot('circle', Motion([Move(0.3, 0.3, math.tau / 0.3)]), footprint=None)
    for y, count in ((1.95, 1), (2.05, 1), (2.2, 0)):
        assert len(near_passes([circle, robot('b', EMPTY, y=y, footprint=None)], MARGIN)) == count


def test_robots_that_drift_come_near_in_a_later_round():
    ahead = robot('ahead', EMPTY, x=2.6)
    rover = robot('rover', Motion([Forward(1.0)]))
    assert near_passes([rover, ahead], MARGIN, rounds=2) == []
    passes = near_passes([rover, ahead], MARGIN, rounds=5)
    assert [near.round_number for near in passes] == [3, 4]
    assert passes[0].begin > 0.0
    assert passes[0].place[0] == pytest.approx(2.45, abs=0.01)


def test_a_round_that_is_as_before_is_named_once():
    robots = [robot('a', SQUARE), robot('b', SQUARE_CW, y=-0.1)]
    assert len(near_passes(robots, MARGIN, rounds=10_000)) == 1
    # They come back to their start after four rounds.
    quarter = Motion([Forward(0.2), Turn(QUARTER)])
    turning = [robot('a', quarter), robot('b', EMPTY, x=0.45)]
    numbers = [near.round_number for near in near_passes(turning, MARGIN, rounds=40)]
    assert numbers
    assert max(numbers) <= 4


def test_of_very_many_rounds_the_first_are_looked_at():
    robots = [robot('a', Motion([Forward(1.0)])), robot('b', EMPTY, x=200.0)]
    assert near_passes(robots, MARGIN, rounds=10_000) == []
    assert MAX_ROUNDS < 200


def test_the_order_is_that_of_time():
    robots = [robot('far', EMPTY, x=1.5), robot('near', EMPTY, x=0.6),
              robot('rover', Motion([Forward(2.0)]))]
    passes = near_passes(robots, MARGIN)
    assert [near.names for near in passes] == [('near', 'rover'), ('far', 'rover')]
    assert passes[0].begin < passes[1].begin


def grid(count, columns, spacing, motion, turn=0.0):
    """Return robots on a grid, each with a plan of its own."""
    return [robot(f'r{number}', motion, number % columns * spacing,
                  number // columns * spacing, number * turn) for number in range(count)]


@pytest.fixture
def looked_at(monkeypatch):
    """Return a list that grows by one with each distance that is computed."""
    calls = []

    def count(*arguments):
        calls.append(arguments)
        return gap(*arguments)

    monkeypatch.setattr(pair_search, 'gap', count)
    return calls


def test_far_apart_robots_cost_nothing(looked_at):
    assert near_passes(grid(200, 20, 3.0, SQUARE, 7.0), MARGIN) == []
    assert looked_at == []


def test_fifty_robots_close_together_cost_some_thousand_distances(looked_at):
    """A distance takes 10 us; dense sampling to a tenth of a millimetre would take 10^7."""
    near_passes(grid(50, 10, 0.8, SQUARE, 7.0), MARGIN)
    assert 0 < len(looked_at) < 100_000


def test_pairs_that_are_alike_are_computed_once(looked_at):
    shared = plan(SQUARE, GENTLE, 10.0)
    robots = [FloorRobot(f'r{number}', shared, Pose(x=0.9 * number), BOX) for number in range(50)]
    near_passes(robots, MARGIN)
    assert 0 < len(looked_at) < 1000
    assert len(near_passes([FloorRobot(f'r{number}', shared, ORIGIN, BOX)
                            for number in range(60)], MARGIN)) == 60 * 59 / 2


def test_a_text_says_who_how_near_when_where_and_in_which_step():
    robots = [robot('r1', Motion([Wait(1.0), Forward(1.0)])), robot('r2', SPIN, y=2.0),
              robot('r3', EMPTY, x=1.45)]
    [near] = near_passes(robots, MARGIN, rounds=1)
    assert near.text == (
        'r1 and r3 come within 5 cm after 5.08 s, at x 1.27 m, y 0.10 m, r1 in step 2 and r3 at '
        'its end')


def test_a_text_says_touch_and_the_round():
    passes = near_passes(
        [robot('r1', Motion([Forward(0.5)])), robot('r2', EMPTY, x=0.95)], MARGIN, rounds=2)
    assert [near.text.partition(', at')[0] for near in passes] == [
        'r1 and r2 come within 5 cm after 2.42 s', 'r1 and r2 touch in round 2, after 0.56 s']


def test_abrupt_plans_are_compared_as_well():
    first = robot('a', Motion([Arc(0.5, math.pi)]), limits=ABRUPT)
    second = robot('b', Motion([Arc(-0.5, math.pi)]), x=0.0, y=1.0, limits=ABRUPT)
    [near] = near_passes([first, second], MARGIN)
    assert near.distance == 0.0
