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
"""Flows under pauses and changing speed factors: the same path, within all limits."""

from flows import apart, end_of, excesses, FLOW_LIMITS, FLOW_RATES, flows, KACHAKA, Message
from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.motion.geometry import distance_between, integrate, ORIGIN
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan, plan
from kachaka_simple_control.motion.steps import Forward, Motion, Turn
import pytest

QUARTER = 1.5707963267948966
SQUARE = Motion('square', [Forward(0.5), Turn(QUARTER)] * 3 + [Forward(0.5)], corners=0.05)
#: Times between two changes [s], and the factors; every sequence ends with the planned speed.
CHANGES = st.lists(
    st.tuples(st.floats(0.0, 3.0), st.sampled_from((0.0, 0.0, 1.0, 0.9, 0.75))
              | st.floats(0.02, 1.0)), max_size=6)


def drive(planned: Plan, changes) -> tuple[list[Message], list[tuple[float, str, float]]]:
    """
    Drive a plan under a changing factor.

    :returns: what is sent, and for each pause: where it began, and how long until rest [s]
    """
    scheduler, sent, pauses = TickScheduler(planned), [], []
    now, factor, pending = 0.0, 1.0, [*changes, (4.0, 1.0)]
    change = pending[0][0]
    held = None
    while (tick := scheduler.due(now, factor)) is not None:
        sent.append(Message(tick.velocity, tick.deadline - tick.start))
        if held is not None and tick.rest > 1e9:
            pauses.append((held[0], held[1], tick.start - held[2]))
            held = None
        now = tick.deadline
        while pending and now >= change:
            before, factor = factor, pending.pop(0)[1]
            change = now + (pending[0][0] if pending else 0.0)
            if factor == 0.0 < before and not tick.velocity.is_zero:
                step = planned.steps[planned.step_index(tick.plan_time)]
                held = (now, step.step.keyword, now)
            elif factor:
                held = None
    return sent, pauses


@settings(max_examples=50, deadline=None)
@given(flows(), FLOW_LIMITS, FLOW_RATES, CHANGES)
def test_any_factor_keeps_path_and_limits(motion, limits, rate, changes):
    planned = plan(motion, limits, rate)
    sent, _ = drive(planned, changes)
    assert apart(end_of(sent), planned.pose) < 1e-9
    # A last message shorter than 1e-6 of a period is shared among the others.
    assert max(one.duration for one in sent) <= (1.0 + 1e-6) / rate
    for excess in excesses(sent, limits, 1.0 / rate).values():
        assert excess.velocity <= 1e-9
        assert excess.acceleration <= 2e-9


@settings(max_examples=20, deadline=None)
@given(flows(forwards=True), FLOW_RATES, CHANGES)
def test_a_pause_comes_to_rest_in_time(motion, rate, changes):
    """With a Kachaka's limits: 1.7 s on a leg, 2.5 s in a corner."""
    _, pauses = drive(plan(motion, KACHAKA, rate), changes)
    for _, where, duration in pauses:
        # A message that is under way when the pause begins still ends.
        assert duration <= (1.7 if where == 'forward' else 2.5) + 1.0 / rate


@pytest.mark.parametrize('factor', [0.02, 0.3, 0.7, 0.75, 0.9, 0.99])
def test_a_lower_speed_drives_the_same_path(factor):
    planned = plan(SQUARE, KACHAKA, 20.0)
    scheduler, now, pose = TickScheduler(planned), 0.0, ORIGIN
    poses = planned.path()
    furthest = 0.0
    while (tick := scheduler.due(now, factor)) is not None:
        assert abs(tick.velocity.linear_x) <= factor * 0.3 * (1.0 + 1e-9)
        furthest = max(furthest, min(distance_between(pose, one)[0] for one in poses))
        pose = integrate(pose, tick.velocity, tick.deadline - tick.start)
        now = tick.deadline
    # A point between two planned poses is at most half a message away from one of them.
    assert furthest <= 0.3 * 0.05 / 2.0 + 1e-6
    assert apart(pose, planned.pose) < 1e-9
    assert now == pytest.approx(planned.duration / factor, rel=0.25)


def test_after_a_pause_in_a_corner_the_rest_is_sent_as_planned():
    planned = plan(SQUARE, KACHAKA, 20.0)
    corner = planned.steps[1]
    middle = (corner.start + corner.end) / 2.0
    sent, pauses = drive(planned, [(middle, 0.0), (3.0, 1.0)])
    assert [where for _, where, _ in pauses] == ['turn']
    last = [one.velocity for one in planned.segments[-20:]]
    assert [one.velocity for one in sent[-20:]] == last


def test_a_robot_does_not_speed_up_in_the_little_that_is_left_of_an_arc():
    """Its next arc would come too soon, and the change of the curvature exceed a limit."""
    limits = Limits(0.3, 1.57, 0.2, 5.0)
    planned = plan(SQUARE, limits, 10.0)
    sent, _ = drive(planned, [
        (0.7416689356145733, 0.8526431065177724), (4.110557703849723, 0.0), (3.0, 1.0)])
    for excess in excesses(sent, limits, 0.1).values():
        assert excess.acceleration <= 2e-9
