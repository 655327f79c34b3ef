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
"""Arcs joined without a stop: exact, within all limits, near their path, and faster."""

from itertools import pairwise
import math
import random

from example_counts import examples
from flows import (
    apart,
    end_of,
    excesses,
    FLOW_LIMITS,
    FLOW_RATES,
    KACHAKA,
    Message,
    messages,
    TOLERANCES,
    TURNS,
)
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.motion.arc_group import EQUAL
from kachaka_simple_control.motion.chain import Axis, ChainPath
from kachaka_simple_control.motion.geometry import advance, ORIGIN, Pose
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Turn
from kachaka_simple_control.motion.transition import Circle, plan_transition
import pytest
from strategies import spread

ROUNDING = 1e-9
UNIT = Limits(1.0, 1.0, 1.0, 1.0)
RADII = spread(0.05, 2.0)
SIDES = st.sampled_from((1.0, -1.0))
ANGLES = st.sampled_from((45.0, 90.0, 180.0, 360.0)) | st.floats(1.0, 400.0)


def degrees(radius: float, angle: float, speed: float | None = None) -> Arc:
    """Return an arc with its angle in degrees."""
    return Arc(radius, math.radians(angle), speed)


@st.composite
def arc_flows(draw) -> Motion:
    """Return a motion of lines and arcs in one direction, with turns between some lines."""
    direction = draw(st.sampled_from((1.0, 1.0, -1.0)))
    steps = []
    for _ in range(draw(st.integers(2, 6))):
        last = steps[-1] if steps else None
        if draw(st.integers(0, 2)):
            radius = abs(last.radius) if isinstance(last, Arc) and not draw(
                st.integers(0, 3)) else draw(RADII)
            steps.append(degrees(draw(SIDES) * radius, direction * draw(ANGLES)))
        else:
            if isinstance(last, Forward) and draw(st.booleans()):
                steps.append(draw(TURNS))
            steps.append(Forward(direction * draw(spread(0.01, 2.0))))
    return Motion('arcs', steps, corners=draw(TOLERANCES))


class Piece:
    """A line, an arc or a turn in place."""

    def __init__(self, begin: Pose, length: float, angle: float) -> None:
        self.begin, self.length, self.angle = begin, length, angle
        self.end = advance(begin, length, angle)

    def points(self, count: int) -> list[tuple[float, float]]:
        """Return points on the piece, from its begin to its end."""
        poses = (advance(self.begin, self.length * part / count, self.angle * part / count)
                 for part in range(count + 1))
        return [(pose.x, pose.y) for pose in poses]

    def distance(self, point: tuple[float, float]) -> float:
        """Return the distance of a point from the piece [m]."""
        x, y = point
        ends = min(math.hypot(x - end.x, y - end.y) for end in (self.begin, self.end))
        heading = self.begin.theta
        if abs(self.angle) < 1e-7:
            along = (x - self.begin.x) * math.cos(heading) + (
                y - self.begin.y) * math.sin(heading)
            if not 0.0 < along * math.copysign(1.0, self.length) < abs(self.length):
                return ends
            return abs((y - self.begin.y) * math.cos(heading)
                       - (x - self.begin.x) * math.sin(heading))
        radius = self.length / self.angle
        east = x - self.begin.x + radius * math.sin(heading)
        north = y - self.begin.y - radius * math.cos(heading)
        bearing = math.atan2(north, east) - math.atan2(-math.cos(heading) * radius,
                                                       math.sin(heading) * radius)
        turned = math.copysign(1.0, self.angle) * bearing % math.tau
        if turned > abs(self.angle):
            return ends
        return abs(math.hypot(east, north) - abs(radius))


def asked_path(motion: Motion) -> list[Piece]:
    """Return the path of the steps, each from rest to rest."""
    pieces, pose = [], ORIGIN
    for step in motion.steps:
        for segment in step.path():
            pieces.append(Piece(pose, segment.length, segment.angle))
            pose = pieces[-1].end
    return pieces


def sent_path(sent: list[Message]) -> list[Piece]:
    """Return the path of what is sent."""
    pieces, pose = [], ORIGIN
    for velocity, duration in sent:
        pieces.append(Piece(
            pose, velocity.linear_x * duration, velocity.angular_z * duration))
        pose = pieces[-1].end
    return pieces


def hausdorff(one: list[Piece], two: list[Piece], counts: tuple[int, int]) -> float:
    """Return the Hausdorff distance of two paths, from some points on each piece [m]."""
    return max(
        min(piece.distance(point) for piece in others)
        for pieces, others, count in ((one, two, counts[0]), (two, one, counts[1]))
        for part in pieces for point in part.points(count))


@pytest.mark.slow
@settings(max_examples=examples(40), deadline=None)
@given(arc_flows(), FLOW_LIMITS, FLOW_RATES)
def test_what_is_sent_keeps_every_promise(motion: Motion, limits: Limits, rate: float):
    planned = plan(motion, limits, rate)
    stopping = plan(Motion('stops', motion.steps), limits, rate)
    sent = messages(planned.segments)
    assert apart(end_of(sent), stopping.pose) < 1e-9
    assert apart(planned.pose, stopping.pose) < 1e-9
    assert planned.duration <= stopping.duration
    assert max(one.duration for one in sent) <= (1.0 + ROUNDING) / rate
    for velocity, _ in sent:
        limits.check(velocity)
    own = excesses(sent, limits, 1.0 / rate)
    others = excesses(messages(stopping.segments), limits, 1.0 / rate)
    for axis, excess in own.items():
        assert excess.acceleration <= ROUNDING
        assert excess.jerk <= 1e-6
        assert excess.jerk_unequal <= max(1e-6, others[axis].jerk_unequal)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(arc_flows(), FLOW_LIMITS, st.sampled_from((5.0, 10.0, 20.0)))
def test_the_path_is_within_the_tolerance(motion, limits, rate):
    sent = messages(plan(motion, limits, rate).segments)
    assert hausdorff(sent_path(sent), asked_path(motion), (3, 16)) <= motion.corners * (
        1.0 + 1e-6)


@pytest.mark.slow
@settings(max_examples=examples(20), deadline=None)
@given(arc_flows(), FLOW_LIMITS, FLOW_RATES, st.integers(0, 1 << 30))
def test_any_speed_factor_keeps_the_path_and_the_limits(motion, limits, rate, seed):
    planned = plan(motion, limits, rate)
    sent = driven(planned, random.Random(seed))
    assert apart(end_of(sent), planned.pose) < 1e-9
    assert max(one.duration for one in sent) <= (1.0 + 1e-6) / rate
    for axis, acceleration, deceleration in (
            ('linear_x', limits.max_linear_acceleration, limits.linear_deceleration),
            ('angular_z', limits.max_angular_acceleration, limits.angular_deceleration)):
        for (one, before), (two, after) in pairwise(sent):
            first, second = getattr(one, axis), getattr(two, axis)
            if first * second < 0.0:
                limit = max(acceleration, deceleration)
            else:
                limit = acceleration if abs(second) > abs(first) else deceleration
            assert abs(second - first) <= limit * (before + after) / 2.0 * (1.0 + ROUNDING)


def driven(planned: Plan, chance: random.Random) -> list[Message]:
    """Return what is sent if the speed factor changes again and again, and ends at 1."""
    scheduler, sent, time, factor = TickScheduler(planned), [], 0.0, 1.0
    changes = sorted(chance.uniform(0.0, planned.duration) for _ in range(4))
    while (tick := scheduler.due(time, factor)) is not None:
        sent.append(Message(tick.velocity, tick.deadline - tick.start))
        time = tick.deadline
        if changes and time >= changes[0]:
            changes.pop(0)
            factor = chance.choice((0.0, 1.0, chance.uniform(0.05, 1.0))) if changes else 1.0
            if not factor and changes:
                changes[0] = time + chance.uniform(0.1, 3.0)
    return sent


@pytest.mark.slow
@settings(max_examples=examples(30), deadline=None)
@given(st.tuples(RADII, RADII), st.tuples(SIDES, SIDES), st.floats(0.001, 0.2),
       st.floats(0.05, 1.0), FLOW_RATES, FLOW_LIMITS)
@example((1.0, 1.0 + 1.1e-11), (1.0, 1.0), 0.125, 1.0, 10.0, UNIT)
@example((1.0000000000100473, 0.9999999999999987), (1.0, 1.0), 0.001, 0.05, 5.0,
         Limits(0.05, 0.2, 0.1, 0.5))
def test_a_joint_replaces_no_more_than_it_says(radii, sides, share, part, rate, limits):
    """At its own speed and at each lower one, from the few arcs of a slow rate to many."""
    # Nearer circles are one.
    assume(sides[0] != sides[1] or abs(radii[0] - radii[1]) > EQUAL * max(radii))
    turning = Axis(limits.max_angular_acceleration, limits.angular_deceleration)
    one, two = (Circle(side / (radius - share * min(radii) ** 2 / radius), 0.0, side * radius)
                for side, radius in zip(sides, radii))
    for pair in ((Circle(0.0), two), (one, Circle(0.0)), (one, two)):
        transition = pair[0] != pair[1] and plan_transition(
            *pair, 0.5, turning, limits.max_angular_jerk, rate)
        if not transition:
            continue
        for speed in (transition.speed, part * transition.speed):
            time, count = transition.bend.duration(speed)
            lost = transition.bend.replaced(speed, time, count)
            assert abs(transition.bend.gap(speed, time, count)) < 1e-12
            assert time * rate / count <= math.sqrt(0.5) * (1.0 + 1e-6)
            assert lost.before / (abs(pair[0].curvature) or 1.0) <= transition.before
            assert lost.after / (abs(pair[1].curvature) or 1.0) <= transition.after


def duration(steps, corners: float) -> float:
    """Return the duration on a Kachaka at 20 Hz [s]."""
    return plan(Motion('arcs', steps, corners=corners), KACHAKA, 20.0).duration


EIGHT = [degrees(0.3, 180.0), degrees(-0.3, 360.0), degrees(0.3, 180.0)]


@pytest.mark.parametrize('steps, corners, most, stopping', [
    (EIGHT, 0.004, 13.8, 15.12),
    (EIGHT, 0.002, 14.2, 15.12),
    (EIGHT, 0.010, 13.2, 15.12),
    ([Forward(0.5), degrees(0.3, 90.0), Forward(0.5)], 0.005, 5.76, 7.45),
    ([Forward(0.5), degrees(0.3, 180.0), Forward(0.5)], 0.005, 7.32, 9.02),
    ([Forward(0.5), degrees(0.3, 360.0), Forward(0.5)], 0.005, 10.43, 12.17),
    ([Forward(0.05), degrees(0.2, 90.0), Forward(0.05)], 0.01, 3.25, 3.75)])
def test_known_motions_are_fast(steps, corners, most, stopping):
    assert duration(steps, corners) <= most
    assert duration(steps, 0.0) == pytest.approx(stopping, abs=0.01)


@pytest.mark.parametrize('steps', [
    [Forward(0.5), degrees(0.3, 90.0), Forward(0.5)],
    [Forward(0.5), degrees(-0.3, 180.0), degrees(0.3, 180.0), Forward(0.5)],
    [Forward(-0.5), degrees(0.3, -270.0)],
    [degrees(0.3, 180.0), degrees(-0.2, 120.0)],
    [degrees(0.5, 180.0), degrees(0.2, 180.0), degrees(0.5, 180.0)],
    EIGHT])
def test_a_small_tolerance_is_used_in_full(steps):
    motion = Motion('near', steps, corners=0.002)
    sent = messages(plan(motion, KACHAKA, 20.0).segments)
    distance = hausdorff(sent_path(sent), asked_path(motion), (8, 200))
    assert 0.97 * 0.002 < distance <= 0.002 * (1.0 + 1e-6)


def test_the_robot_does_not_stop_in_a_flow():
    planned = plan(Motion('eight', EIGHT, corners=0.004), KACHAKA, 20.0)
    assert [step.joins_next for step in planned.steps] == [True, True, False]
    moving = [segment.velocity.linear_x for segment in planned.segments
              if 1.0 < segment.start < planned.duration - 1.0]
    assert min(moving) > 0.2
    assert [[isinstance(path, ChainPath) for path in step.trajectories]
            for step in planned.steps] == [[False, True], [False, True], [False]]


def test_a_joint_of_a_line_belongs_to_the_arc():
    planned = plan(Motion('bend', [Forward(0.5), degrees(0.3, 90.0), Forward(0.5)],
                          corners=0.005), KACHAKA, 20.0)
    assert [[isinstance(path, ChainPath) for path in step.trajectories]
            for step in planned.steps] == [[False], [True, False, True], [False]]
    assert planned.steps[1].displacement.angle == pytest.approx(math.pi / 2.0)
    assert not any(step.cut for step in planned.steps)


@pytest.mark.parametrize('steps', [
    [degrees(0.3, 360.0), degrees(-0.3, 360.0)],
    [degrees(0.3, 360.0), Forward(0.5)],
    [Forward(0.5), Turn(0.4), degrees(0.3, 90.0)],
    [degrees(0.3, 90.0), Turn(0.4), Forward(0.5)],
    [degrees(0.3, 90.0), degrees(0.3, -90.0)],
    [Forward(1.0), Arc(0.3, 1e-7), Forward(1.0)],
    [Forward(1.0), Arc(1e-6, 1.0), Forward(1.0)]])
def test_where_nothing_fits_the_robot_stops(steps):
    flowing, stopping = (plan(Motion('rest', steps, corners=corners), KACHAKA, 20.0)
                         for corners in (0.05, 0.0))
    assert flowing.segments == stopping.segments
    assert not any(step.joins_next for step in flowing.steps)


@pytest.mark.parametrize('limits', [
    Limits(0.3, 1.57), Limits(0.3, 1.57, 0.5, math.inf, 2.0, math.inf),
    Limits(0.3, 1.57, math.inf, 2.5, math.inf, 10.0)])
def test_limits_may_be_infinite(limits):
    steps = [Forward(1.0), degrees(0.3, 90.0), degrees(-0.3, 90.0), Forward(1.0)]
    flowing, stopping = (plan(Motion('wild', steps, corners=corners), limits, 20.0)
                         for corners in (0.02, 0.0))
    assert flowing.duration <= stopping.duration
    assert apart(end_of(messages(flowing.segments)), stopping.pose) < 1e-9
