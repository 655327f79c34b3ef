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
"""Robots in step: when each is called, what it sends, and how far they are apart."""

from __future__ import annotations

import heapq
from itertools import count

from hypothesis import example, given, settings
from hypothesis import strategies as st
from kachaka_simple_control.control.in_step import InStep
from kachaka_simple_control.motion.geometry import integrate, ORIGIN
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Forward, Motion, Move, Repeat, Turn, Wait
import pytest

SQUARE = Motion('square', (Repeat(4, (Forward(0.5), Turn(1.5707963267948966))),))
RATES = (10.0, 20.0, 12.5)


def robots(number, motion=SQUARE):
    """Return the plans of one motion for robots of which each accelerates in its own way."""
    return [plan(motion, Limits(0.2 + 0.02 * index, 1.0 + 0.1 * index, 0.3 + 0.1 * index, 1.5),
                 RATES[index % 3]) for index in range(number)]


def drive(plans, factor=lambda number, now: 1.0, late=lambda: 0.0):
    """Call each source when it is due; return the ticks of each, and what was published."""
    events = []
    sources = InStep(plans, events.append).sources
    order, ticks = count(), [[] for _ in plans]
    queue = [(0.0, next(order), number) for number in range(len(plans))]
    while queue:
        now, _, number = heapq.heappop(queue)
        assert now < 1000.0, 'somebody waits for ever'
        tick = sources[number].due(now, factor(number, now))
        if tick is not None:
            assert tick.start <= now + 1e-9
            assert now < tick.deadline
            ticks[number].append(tick)
            heapq.heappush(queue, (tick.deadline + late(), next(order), number))
    return ticks, events


def end_pose(ticks):
    """Return where a robot ends that holds each velocity until the next."""
    pose = ORIGIN
    for tick, following in zip(ticks, [*ticks[1:], None]):
        end = tick.deadline if following is None else following.start
        pose = integrate(pose, tick.velocity, end - tick.start)
    return pose


def paused(begin, end, *numbers):
    """Return a speed factor that is 0 for a time, for all robots or only for some."""
    return lambda number, now: 0.0 if begin <= now < end and (
        not numbers or number in numbers) else 1.0


def test_without_a_pause_each_plan_is_sent_as_it_is():
    plans = robots(5)
    ticks, events = drive(plans)
    for planned, sent in zip(plans, ticks):
        assert sent[-1].deadline == planned.duration
        assert [tick.velocity for tick in sent if tick.start == tick.plan_time] == [
            tick.velocity for tick in sent]
    assert events == []


@settings(max_examples=20, deadline=None)
@given(begin=st.floats(0.0, 20.0), duration=st.floats(0.05, 5.0), number=st.integers(2, 5))
@example(begin=1.0, duration=3.0, number=10)
def test_after_a_pause_all_plans_are_equally_late(begin, duration, number):
    """From the next rest of each on; and each ends where its plan does."""
    plans = robots(number)
    ticks, events = drive(plans, paused(begin, begin + duration))
    latest = max(planned.duration for planned in plans)
    delays = [sent[-1].deadline - planned.duration for planned, sent in zip(plans, ticks)
              if planned.duration > begin + 8.0]
    if begin + 12.0 < latest and delays:
        assert max(delays) - min(delays) < 1e-6
        assert len(events) <= 1  # none if the pause was at a rest of all
    for planned, sent in zip(plans, ticks):
        pose, wanted = end_pose(sent), planned.steps[-1].pose
        assert abs(pose.x - wanted.x) + abs(pose.y - wanted.y) < 1e-9


def test_it_says_by_how_much_they_were_apart():
    """The second is not paused, so the first is late by the pause and more."""
    plans = robots(2)
    _, events = drive(plans, paused(1.0, 2.0, 0))
    assert [event.robots for event in events] == [2]
    assert 0.9 < events[0].apart < 3.0


def test_one_that_was_not_paused_waits_at_its_next_rest():
    plans = robots(2)
    ticks, _ = drive(plans, paused(1.0, 3.0, 0))
    assert any(tick.velocity.is_zero and tick.start != tick.plan_time for tick in ticks[1])
    late = [sent[-1].deadline - planned.duration for planned, sent in zip(plans, ticks)]
    assert late[0] == pytest.approx(late[1], abs=1e-6)


def test_a_pause_during_a_wait_for_others_holds_all():
    plans = robots(3)
    ticks, _ = drive(plans, lambda number, now: 0.0 if (
        (number == 0 and 1.0 <= now < 4.0) or 3.5 <= now < 6.0) else 1.0)
    late = [sent[-1].deadline - planned.duration for planned, sent in zip(plans, ticks)]
    assert max(late) - min(late) < 1e-6
    assert min(late) > 4.9
    assert not any(
        not tick.velocity.is_zero for sent in ticks for tick in sent if 5.0 < tick.start < 5.9)


def test_nobody_waits_for_a_robot_that_has_come_to_its_end():
    plans = [*robots(1), *robots(1, Motion('short', (Forward(0.1),)))]
    ticks, events = drive(plans, paused(3.0, 4.0))
    assert end_pose(ticks[0]).x == pytest.approx(plans[0].steps[-1].pose.x, abs=1e-9)
    assert events == []


def test_nobody_waits_for_a_robot_whose_drive_has_ended_early():
    group = InStep(robots(2))
    first, second = group.sources
    now = 0.0
    while now < 1.0:
        now = first.due(now).deadline
        second.due(now)
    first.is_over = True
    while (tick := second.due(now, 0.0 if now < 2.0 else 1.0)) is not None:
        now = tick.deadline
        assert now < 60.0


def test_moves_without_rests_between_them_wait_at_the_next_one():
    """The lesson's: only a wait is a rest."""
    moves = Motion('moves', (Move(0.1, 0.0, 1.0), Move(0.2, 0.0, 1.0), Wait(0.5),
                             Move(0.1, 0.0, 1.0)))
    plans = [plan(moves, Limits(0.3, 1.57, 0.2 + 0.2 * index, 2.0), 10.0) for index in range(3)]
    ticks, _ = drive(plans, paused(0.5, 1.5))
    late = [sent[-1].deadline - planned.duration for planned, sent in zip(plans, ticks)]
    assert max(late) - min(late) < 1e-6


@settings(max_examples=20, deadline=None)
@given(lateness=st.lists(st.floats(0.0, 0.045), min_size=50, max_size=50))
def test_late_calls_keep_them_in_step(lateness):
    """By less than a period: later, a rest may be passed unseen, and the next one is kept."""
    plans = robots(3)
    late = iter(lateness * 100)
    ticks, _ = drive(plans, paused(1.0, 2.0), lambda: next(late, 0.0))
    # The last tick of all may have been skipped.
    ends = [sent[-1].start - sent[-1].plan_time for sent in ticks]
    assert max(ends) - min(ends) < 1e-6
