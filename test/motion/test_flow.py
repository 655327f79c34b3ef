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
"""Flows: exact, within all limits on what is sent, near their legs, and never slower."""

from itertools import pairwise
import math
import time

from example_counts import examples
from flows import (
    apart,
    end_of,
    excesses,
    fine_path,
    FLOW_LIMITS,
    FLOW_RATES,
    flows,
    hausdorff,
    KACHAKA,
    messages,
    skeleton,
)
from hypothesis import example, given, settings
from hypothesis import strategies as st
from kachaka_simple_control.errors import InvalidMotionError
from kachaka_simple_control.motion.corner import CornerTurn, plan_corner
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import (
    Arc,
    Forward,
    Motion,
    Move,
    Repeat,
    Settle,
    Turn,
    Wait,
)
from kachaka_simple_control.motion.waypoints import Waypoints
import pytest

QUARTER = math.pi / 2.0
ROUNDING = 1e-9


def with_stops(motion: Motion) -> Motion:
    """Return the motion with a stop at each step."""
    return Motion(motion.name, motion.steps)


@settings(max_examples=examples(30), deadline=None)
@given(st.lists(st.floats(5.0, 40.0), min_size=3, max_size=8), st.floats(0.05, 0.3),
       st.sampled_from((5.0, 10.0, 20.0)))
def test_corners_that_use_whole_legs_lose_nothing_of_them(angles, tolerance, rate):
    steps = [Forward(1.0)]
    for index, angle in enumerate(angles):
        steps += [Turn((-1) ** index * math.radians(angle)), Forward(1.0)]
    motion, limits = Motion('zigzag', tuple(steps), corners=tolerance), Limits(1.0, 1.0, 2.0, 1.0)
    end = plan(with_stops(motion), limits, rate).pose
    assert apart(end_of(messages(plan(motion, limits, rate).segments)), end) < 1e-9


@pytest.mark.slow
@settings(max_examples=examples(20), deadline=None)
@given(flows(), FLOW_LIMITS, FLOW_RATES)
@example(Motion('flow', (
    Forward(1.0), Turn(-0.3141592653589793), Forward(1.0), Turn(-0.20943951023931956),
    Forward(1.0), Turn(-0.29670597283903605), Forward(1.0)), corners=0.1),
    Limits(1.0, 1.0, 2.0, 1.0), 5.0)
def test_what_is_sent_keeps_every_promise(motion: Motion, limits: Limits, rate: float):
    planned, stopping = plan(motion, limits, rate), plan(with_stops(motion), limits, rate)
    sent = messages(planned.segments)
    assert apart(end_of(sent), stopping.pose) < 1e-9
    assert apart(planned.pose, stopping.pose) < 1e-9
    assert planned.duration <= stopping.duration
    assert planned.saved_time == pytest.approx(stopping.duration - planned.duration)
    assert max(one.duration for one in sent) <= (1.0 + ROUNDING) / rate
    own = excesses(sent, limits, 1.0 / rate)
    others = excesses(messages(stopping.segments), limits, 1.0 / rate)
    for axis, excess in own.items():
        assert excess.velocity <= ROUNDING
        assert excess.acceleration <= ROUNDING
        assert excess.jerk <= 1e-6
        assert excess.jerk_unequal <= max(1e-6, others[axis].jerk_unequal)


@pytest.mark.slow
@settings(max_examples=examples(10), deadline=None)
@given(flows(), FLOW_LIMITS, FLOW_RATES)
def test_the_path_is_within_the_tolerance_of_the_legs(motion, limits, rate):
    sent = messages(plan(motion, limits, rate).segments)
    assert hausdorff(fine_path(sent), skeleton(motion)) <= motion.corners * (1.0 + 1e-6)


def duration(steps, corners: float) -> float:
    """Return the duration on a Kachaka at 20 Hz [s]."""
    return plan(Motion('flow', steps, corners=corners), KACHAKA, 20.0).duration


def lawn_mower(rows: int, length: float, between: float) -> list:
    steps = [Forward(length)]
    for row in range(rows - 1):
        turn = Turn(QUARTER if row % 2 == 0 else -QUARTER)
        steps += [turn, Forward(between), turn, Forward(length)]
    return steps


def slalom() -> list:
    """Return a way through six points, 0.5 m apart and 0.2 m to either side."""
    points = [(0.0, 0.0), (0.5, 0.2), (1.0, -0.2), (1.5, 0.2), (2.0, -0.2), (2.5, 0.2), (3.0, 0.0)]
    steps, heading = [], None
    for (x, y), (next_x, next_y) in pairwise(points):
        bearing = math.atan2(next_y - y, next_x - x)
        if heading is not None:
            steps.append(Turn(bearing - heading))
        steps.append(Forward(math.hypot(next_x - x, next_y - y)))
        heading = bearing
    return steps


@pytest.mark.parametrize('steps, most, stopping', [
    ([Forward(0.5), Turn(QUARTER)] * 3 + [Forward(0.5)], 8.25, 15.70),
    ([Forward(0.5), Turn(QUARTER)] * 4, 10.2, 17.58),
    (slalom(), 12.9, 25.60),
    (lawn_mower(5, 2.0, 0.3), 45.3, 60.01)])
def test_known_motions_are_fast(steps, most, stopping):
    assert duration(steps, 0.05) <= most
    assert duration(steps, 0.0) == pytest.approx(stopping, abs=0.01)


def test_a_corner_of_90_degrees_is_nearly_as_fast_as_can_be():
    """Between two legs of 0.25 m that are driven at full speed at their other ends."""
    whole = duration([Forward(1.0), Turn(QUARTER), Forward(1.0)], 0.05)
    # Without the legs' other 0.75 m, which take a ramp of 0.85 s and 0.1275 m, and a cruise.
    assert whole - 2.0 * (0.85 + (0.75 - 0.1275) / 0.3) <= 1.90


@pytest.mark.parametrize('steps', [
    [Forward(0.5), Wait(0.0), Forward(0.5)],
    [Forward(0.5), Settle(1.0), Forward(0.5)],
    [Forward(0.5), Move(0.1, 0.0, 1.0), Forward(0.5)],
    [Forward(0.5), Forward(-0.5)],
    [Forward(0.5), Turn(QUARTER), Forward(-0.5)],
    [Forward(0.5), Turn(math.radians(175.0)), Forward(0.5)],
    [Forward(0.5), Turn(0.4), Turn(0.4), Forward(0.5)],
    [Forward(0.5), Turn(0.4), Arc(0.3, 1.0)],
    [Forward(0.5), Forward(0.0), Forward(0.5)],
    [Forward(0.5), Turn(0.0), Forward(0.5)],
    [Turn(QUARTER), Forward(0.5), Turn(QUARTER)]])
def test_what_rests_stays_at_rest(steps):
    flowing, stopping = (plan(Motion('rest', steps, corners=corners), KACHAKA, 20.0)
                         for corners in (0.05, 0.0))
    assert flowing.segments == stopping.segments
    assert not any(step.cut or step.joins_next for step in flowing.steps)


def test_legs_in_line_join_at_the_lower_speed():
    planned = plan(Motion('line', [Forward(0.5), Forward(0.5, speed=0.1), Forward(0.5)],
                          corners=0.05), KACHAKA, 20.0)
    assert [step.joins_next for step in planned.steps] == [True, True, False]
    boundary = [segment.velocity.linear_x for segment in planned.segments
                if abs(segment.start - planned.steps[1].start) < 0.06]
    assert boundary == pytest.approx([0.1] * len(boundary), abs=0.01)
    assert planned.saved_time > 0.5


def test_short_legs_shrink_their_corners():
    planned = plan(
        Motion('short', [Forward(0.2), Turn(QUARTER), Forward(0.2)], corners=0.2), KACHAKA, 20.0)
    cut = planned.steps[1].cut
    assert cut.is_shrunk
    assert 0.0 < cut.deviation < cut.tolerance == 0.2
    roomy = plan(
        Motion('roomy', [Forward(2.0), Turn(QUARTER), Forward(2.0)], corners=0.2), KACHAKA, 20.0)
    assert not roomy.steps[1].cut.is_shrunk
    assert roomy.steps[1].cut.deviation == pytest.approx(0.0918, abs=1e-3)


def test_a_corner_has_at_most_1_4_times_as_many_messages_as_the_rate():
    planned = plan(Motion('corner', [Forward(0.5), Turn(QUARTER), Forward(0.5)], corners=0.05),
                   KACHAKA, 20.0)
    corner = planned.steps[1]
    sent = [one for one in planned.segments if corner.start <= one.start < corner.end]
    assert 20.0 * corner.duration < len(sent) <= 20.0 * math.sqrt(2.0) * corner.duration + 1.0


@pytest.mark.slow
def test_repeats_are_planned_once():
    """An hour of squares shares its velocities, and is planned in a moment."""
    motion = Motion('hour', [Repeat(480, [Forward(0.5), Turn(QUARTER)] * 4)], corners=0.05)
    began = time.process_time()
    planned = plan(motion, KACHAKA, 50.0)
    # Typically 0.6 s; the bound is for a machine that is busy.
    assert time.process_time() - began < 2.0
    assert planned.duration > 3600.0
    assert len({id(step.trajectories) for step in planned.steps}) < 20
    assert apart(planned.pose, plan(with_stops(motion), KACHAKA, 50.0).pose) < 1e-9


@pytest.mark.parametrize('value, words', [
    (-0.05, 'must not be negative'), (2.0, 'at most 1 m'), (math.nan, 'finite'),
    (math.inf, 'finite'), ('5 cm', 'must be a number'), (True, 'must be a number')])
def test_a_bad_tolerance_is_refused(value, words):
    with pytest.raises(InvalidMotionError, match=words) as caught:
        Motion('flow', [Forward(0.5)], corners=value)
    assert caught.value.name == 'corners'


@pytest.mark.parametrize('tolerance', [1.5e-9, 3e-9, 5e-8])
def test_a_corner_without_length_keeps_its_tolerance(tolerance):
    # The first corner has room for nearly the whole leg, the second one needs nothing of it.
    limits = Limits(0.3, 0.2)
    for angle, length in ((QUARTER, 0.151516), (math.radians(20.0), 0.492497)):
        points = [(10.0, 0.0), (10.0 - length * math.sqrt(0.75), 0.5 * length)]
        motion = Motion('flow', [
            Waypoints(points, corners=1.0), Turn(angle), Forward(length)], corners=tolerance)
        planned = plan(motion, limits, 20.0)
        assert all(step.cut.deviation <= step.cut.tolerance for step in planned.steps if step.cut)
        assert apart(planned.path()[-1], plan(motion.with_stops(), limits, 20.0).pose) < 1e-9


def test_arcs_keep_their_lengths_where_joints_have_few_messages():
    limits = Limits(1.0, 2.0, 0.82, 49.5, 31.9, 4.0, 21.1, 17.8)
    motion = Motion('flow', [
        Forward(0.1, speed=0.028), Arc(0.2598, 0.0307), Arc(0.3, QUARTER, speed=0.0158),
        Arc(0.1933, QUARTER, speed=0.0718)], corners=0.05)
    end = plan(motion.with_stops(), limits, 10.56).pose
    assert apart(plan(motion, limits, 10.56).path()[-1], end) < 1e-9


@pytest.mark.parametrize('radius', [9e4, 1e9, -1e12, 1e308])
def test_hardly_bent_arcs_are_exact(radius):
    motion = Motion('flow', [
        Forward(0.5), Arc(radius, 1.0 / abs(radius)), Arc(0.3, 1.0),
        Arc(radius, 0.7 / abs(radius)), Forward(0.5)], corners=0.05)
    end = plan(motion.with_stops(), KACHAKA, 20.0).pose
    assert apart(plan(motion, KACHAKA, 20.0).path()[-1], end) < 1e-9


@pytest.mark.parametrize('step', [Turn(QUARTER), Arc(0.3, QUARTER)])
def test_flows_need_no_limit_of_velocity(step):
    motion = Motion('flow', [Forward(0.5), step, Forward(0.5)], corners=0.05)
    limits = Limits(math.inf, math.inf, 0.5, 2.5, 2.0, 10.0)
    planned, stopping = plan(motion, limits, 20.0), plan(with_stops(motion), limits, 20.0)
    assert planned.duration < stopping.duration
    assert apart(planned.path()[-1], stopping.pose) < 1e-9


def test_arcs_without_length_are_not_computed():
    # In a slow turn nearly all arcs may be without length.
    motion = Motion('flow', [
        Forward(1.0), Turn(QUARTER, speed=0.02), Forward(1.0)], corners=0.01)
    lines = [step.trajectories[0] for step in plan(motion.with_stops(), KACHAKA, 20.0).steps]
    turn = CornerTurn(lines[1].segment, lines[1].limits, lines[0].limits, 1.0, 20.0)
    corner = plan_corner(turn, motion.corners, 1.0, lines[0].limits.velocity)
    lengths, rests = turn.lengths(corner.shape), turn.rests(corner.shape)
    assert rests > 0.9 * len(lengths)
    assert not any(lengths[:rests])
    assert all(lengths[rests:])
    assert turn.rests(corner.shape._replace(low=0.01)) == 0
