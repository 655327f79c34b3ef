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
"""Whole plans: they end where the motion leads, whatever the limits and the rate."""

from dataclasses import replace
from itertools import pairwise
import math
import pickle

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.motion.geometry import Pose, Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import Arc, Forward, Motion, Move, Repeat, Turn, Wait
import pytest
from strategies import (
    closed_form,
    expand,
    GOALS,
    KACHAKA,
    LIMITS,
    MOTIONS,
    motions,
    RATES,
)


def close(one: Pose, two: Pose, size: float = 1.0) -> bool:
    """Return whether two poses differ by less than a billionth of the way, or of a metre."""
    tolerance = 1e-9 * max(1.0, size)
    return (math.hypot(one.x - two.x, one.y - two.y) <= tolerance
            and abs(one.theta - two.theta) <= tolerance)


def size(planned: Plan) -> float:
    """Return how much a plan drives and turns, for rounding to be measured by."""
    return planned.length + sum(
        abs(segment.velocity.angular_z) * (segment.end - segment.start)
        for segment in planned.segments)


def sent(planned: Plan) -> list[tuple[float, float]]:
    """Return the velocities of a plan."""
    return [(segment.velocity.linear_x, segment.velocity.angular_z)
            for segment in planned.segments]


@given(MOTIONS, LIMITS, RATES)
def test_another_process_gets_the_same_plan(motion, limits, rate):
    planned = plan(motion, limits, rate)
    assert pickle.loads(pickle.dumps(planned)) == planned


@given(MOTIONS, LIMITS, RATES)
def test_a_plan_ends_where_geometry_says(motion, limits, rate):
    planned = plan(motion, limits, rate)
    expected = closed_form(motion.steps)
    assert close(expected, planned.path()[-1], size(planned))
    assert close(expected, planned.pose, size(planned))


@given(MOTIONS, LIMITS, RATES)
def test_every_stage_ends_where_geometry_says(motion, limits, rate):
    planned = plan(motion, limits, rate)
    leaves = expand(motion.steps)
    assert [stage.step for stage in planned.steps] == leaves
    pose = Pose()
    for leaf, stage in zip(leaves, planned.steps):
        pose = closed_form([leaf], pose)
        assert close(pose, stage.pose, size(planned))


@given(MOTIONS, LIMITS, RATES)
def test_segments_and_stages_follow_each_other_without_a_gap(motion, limits, rate):
    planned = plan(motion, limits, rate)
    for row in (planned.segments, planned.steps):
        assert all(one.end == two.start for one, two in pairwise(row))
        assert not row or row[0].start == 0.0
        assert not row or row[-1].end == planned.duration
    assert all(segment.end > segment.start for segment in planned.segments)


@given(motions(GOALS), LIMITS, RATES)
def test_ticks_of_a_goal_are_equal_and_at_most_a_period(motion, limits, rate):
    planned = plan(motion, limits, rate)
    for stage in planned.steps:
        own = [segment.end - segment.start for segment in planned.segments
               if stage.start <= segment.start and segment.end <= stage.end]
        assert all(tick <= planned.period * (1.0 + 1e-6) for tick in own)
        assert not own or max(own) - min(own) <= 1e-6 * max(own)


@given(MOTIONS, LIMITS, RATES)
def test_the_velocity_gate_refuses_nothing_of_a_plan(motion, limits, rate):
    """It checks each velocity once more, and a refused velocity ends the run."""
    for segment in plan(motion, limits, rate).segments:
        limits.check(segment.velocity)


@pytest.mark.parametrize('radius', [0.181, -0.163, 0.186])
def test_an_arc_at_the_angular_limit_is_not_refused_either(radius):
    """1.57 rad/s times one of these radii, divided by it again, is more than 1.57 rad/s."""
    for speed in (None, abs(radius) * 1.57):
        planned = plan(Motion('arc', (Arc(radius, 3.0, speed),)), KACHAKA, 10.0)
        for segment in planned.segments:
            KACHAKA.check(segment.velocity)
        assert planned.max_angular_velocity == pytest.approx(1.57)


@given(MOTIONS, LIMITS, RATES, RATES)
def test_the_rate_does_not_change_the_motion(motion, limits, rate, other):
    one, two = plan(motion, limits, rate), plan(motion, limits, other)
    assert close(one.path()[-1], two.path()[-1], size(one))
    assert one.duration == two.duration
    assert [stage.end for stage in one.steps] == [stage.end for stage in two.steps]


@given(MOTIONS, LIMITS, RATES, st.integers(0, 4))
def test_a_repeat_equals_its_steps_written_out(motion, limits, rate, times):
    repeated = plan(Motion('many', (Repeat(times, motion.steps),)), limits, rate)
    by_hand = plan(Motion('many', motion.steps * times), limits, rate)
    assert repeated.segments == by_hand.segments
    assert [stage.pose for stage in repeated.steps] == [stage.pose for stage in by_hand.steps]


def mirrored(step):
    """Return a step with left and right exchanged."""
    if isinstance(step, Move):
        return replace(step, angular_z=-step.angular_z)
    if isinstance(step, Repeat):
        return replace(step, steps=tuple(map(mirrored, step.steps)))
    if isinstance(step, Arc):
        return replace(step, radius=-step.radius)
    return replace(step, angle=-step.angle) if isinstance(step, Turn) else step


@given(MOTIONS, LIMITS, RATES)
def test_a_mirrored_motion_is_the_mirrored_plan(motion, limits, rate):
    there = plan(motion, limits, rate)
    mirror = plan(Motion('mirrored', tuple(map(mirrored, motion.steps))), limits, rate)
    assert [(v, -w) for v, w in sent(there)] == sent(mirror)
    assert there.duration == mirror.duration
    assert (there.pose.x, -there.pose.y, -there.pose.theta) == pytest.approx(
        (mirror.pose.x, mirror.pose.y, mirror.pose.theta), abs=1e-12)


def reversed_(step):
    """Return a step that drives its path backwards."""
    if isinstance(step, Move):
        return Move(-step.linear_x, -step.angular_z, step.duration)
    if isinstance(step, Repeat):
        return replace(step, steps=tuple(map(reversed_, step.steps)))
    if isinstance(step, Forward):
        return replace(step, distance=-step.distance)
    return replace(step, angle=-step.angle) if isinstance(step, (Arc, Turn)) else step


@given(MOTIONS, LIMITS, RATES)
def test_backwards_is_forwards_with_the_other_sign(motion, limits, rate):
    limits = replace(limits, max_backward_velocity=None)
    there = plan(motion, limits, rate)
    back = plan(Motion('back', tuple(map(reversed_, motion.steps))), limits, rate)
    assert [(-v, -w) for v, w in sent(there)] == sent(back)
    assert there.duration == back.duration


@pytest.mark.parametrize('distance', [0.07, 0.14, 0.28, 0.56])
def test_rounding_alone_makes_no_further_tick(distance):
    """Some of these take slightly more than a whole number of periods."""
    for bounds, speed in ((Limits(0.3, 1.57), 0.1), (Limits(0.1, 1.57), None)):
        planned = plan(Motion('x', (Forward(distance, speed),)), bounds, 10.0)
        assert len(planned.segments) == round(100.0 * distance)


def test_a_plan_is_an_immutable_value():
    planned = plan(Motion('x', (Forward(0.5), Wait(1.0))), KACHAKA, 10.0)
    assert planned == plan(Motion('y', (Forward(0.5), Wait(1.0))), KACHAKA, 10.0)
    segment = planned.segments[0]
    for thing, name in (
            (planned, 'period'), (segment, 'end'), (planned.steps[0], 'end'),
            (segment.velocity, 'linear_x')):
        with pytest.raises(AttributeError):
            setattr(thing, name, 1.0)
    assert planned.segments[-1].velocity == Velocity()
