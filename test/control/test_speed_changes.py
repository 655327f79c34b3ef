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
"""A plan under a speed factor that changes: the same path, within the limits, to rest in time."""

from itertools import pairwise
import math

from example_counts import examples
from hypothesis import given, Phase, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.motion.geometry import integrate, ORIGIN
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion, Move, Wait
import pytest
from strategies import KACHAKA, LIMITS, MOTIONS, RATES

#: How the factor changes: to what, and for how many ticks.
CHANGES = st.lists(
    st.tuples(st.just(0.0) | st.just(1.0) | st.floats(0.05, 1.0), st.integers(0, 60)),
    max_size=12)
#: Of thorough tests as many random drives as the promise names, a thousand; to make a failing one
#: smaller takes too long.
MANY = settings(
    max_examples=examples(200),
    phases=(Phase.explicit, Phase.reuse, Phase.generate))


def drive(planned, changes):
    """Return the ticks of a plan whose factor changes; in the end it is 1."""
    scheduler, ticks, now = TickScheduler(planned), [], 0.0
    for factor, count in [*changes, (1.0, math.inf)]:
        left = count
        while left > 0:
            tick = scheduler.due(now, factor)
            if tick is None:
                return ticks
            ticks.append(tick)
            now, left = tick.deadline, left - 1
    raise AssertionError('a plan without an end')


def end_pose(ticks):
    """Return where a robot ends that follows its commands."""
    pose = ORIGIN
    for tick in ticks:
        pose = integrate(pose, tick.velocity, tick.deadline - tick.start)
    return pose


@pytest.mark.slow
@MANY
@given(MOTIONS, LIMITS, RATES, CHANGES)
def test_the_end_is_that_of_the_plan(motion, limits, rate, changes):
    planned = plan(motion, limits, rate)
    ticks = drive(planned, changes)
    end = end_pose(ticks)
    scale = 1.0 + planned.length
    assert end.x == pytest.approx(planned.pose.x, abs=1e-9 * scale)
    assert end.y == pytest.approx(planned.pose.y, abs=1e-9 * scale)
    assert end.theta == pytest.approx(planned.pose.theta, abs=1e-9 * scale)


@pytest.mark.slow
@MANY
@given(MOTIONS, LIMITS, RATES, CHANGES)
def test_ticks_follow_each_other_and_go_forward_on_the_plan(motion, limits, rate, changes):
    planned = plan(motion, limits, rate)
    ticks = drive(planned, changes)
    for before, after in pairwise(ticks):
        assert after.start == pytest.approx(before.deadline, abs=1e-9)
        assert after.plan_time >= before.plan_time - 1e-6
    for tick in ticks:
        assert 0.0 < tick.deadline - tick.start <= planned.period * (1.0 + 1e-5)
        limits.check(tick.velocity)


@given(MOTIONS, LIMITS, RATES)
def test_without_a_change_each_velocity_is_that_of_the_plan(motion, limits, rate):
    planned = plan(motion, limits, rate)
    segments = iter(planned.segments)
    segment = None
    for tick in drive(planned, []):
        if segment is None or tick.start >= segment.end:
            segment = next(segments)
        assert tick.velocity is segment.velocity
        assert tick.plan_time == tick.start


@pytest.mark.slow
@MANY
@given(st.lists(st.builds(Forward, st.floats(-3.0, 3.0)), min_size=1, max_size=3), RATES, CHANGES)
def test_what_is_sent_keeps_the_limits_of_acceleration(steps, rate, changes):
    """Between the middles of two ticks, for each carries the mean over its time."""
    ticks = drive(plan(Motion('straight', steps), KACHAKA, rate), changes)
    for before, after in pairwise(ticks):
        time = (after.deadline - before.start) / 2.0
        change = abs(after.velocity.linear_x - before.velocity.linear_x)
        assert change <= KACHAKA.max_linear_acceleration * time * (1.0 + 1e-9) + 1e-9


@given(st.floats(0.0, 20.0), st.sampled_from([0.0, 0.3, 0.7]), RATES)
def test_a_brake_goes_on_into_the_next_move_and_ends_before_a_rest(part, factor, rate):
    moves = (Move(0.3, 0.0, 10.0), Move(0.15, 0.0, 10.0), Wait(1.0))
    planned = plan(Motion('moves', moves), KACHAKA, rate)
    count = math.ceil(part * rate)
    ticks = drive(planned, [(1.0, count), (factor, 100_000)] if factor else [
        (1.0, count), (0.0, math.ceil(5.0 * rate))])
    for before, after in pairwise(ticks):
        if any(abs(after.plan_time - edge) < 2.0 / rate for edge in (0.0, 10.0, 20.0)):
            continue  # the plan itself steps there
        time = (after.deadline - before.start) / 2.0
        change = abs(after.velocity.linear_x - before.velocity.linear_x)
        assert change <= KACHAKA.max_linear_acceleration * time * (1.0 + 1e-9) + 1e-9
    end = end_pose(ticks)
    assert end.x == pytest.approx(planned.pose.x, abs=1e-9)


def test_after_a_pause_the_next_step_is_that_of_the_plan_again():
    planned = plan(Motion('two', (Forward(0.5), Forward(0.4))), KACHAKA, 50.0)
    ticks = drive(planned, [(1.0, 20), (0.0, 100)])
    count = sum(segment.start >= planned.steps[1].start for segment in planned.segments)
    assert [tick.velocity for tick in ticks[-count:]] == [
        segment.velocity for segment in planned.segments[-count:]]
    assert ticks[-count].plan_time == planned.steps[1].start


def test_a_late_call_skips_ticks_and_moves_no_deadline():
    planned = plan(Motion('late', (Forward(1.0),)), KACHAKA, 10.0)
    scheduler = TickScheduler(planned)
    for index in range(15):
        scheduler.due(index * 0.1)
    first = scheduler.due(1.5, 0.5)
    late = scheduler.due(first.deadline + 0.35, 0.5)
    assert late.start > first.deadline + 0.25
    assert late.start <= first.deadline + 0.35 < late.deadline
