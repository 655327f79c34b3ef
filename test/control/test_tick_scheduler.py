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
"""The tick scheduler: what is due when, asked on time and late."""

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.control.tick_scheduler import TickScheduler
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move
import pytest

LIMITS = Limits(0.3, 1.57)
MOVES = st.lists(
    st.builds(Move, st.floats(-0.3, 0.3), st.floats(-1.5, 1.5), st.floats(0.0, 3.0)), max_size=8)
RATES = st.floats(5.0, 200.0)


def scheduler_of(*moves: Move, rate: float = 10.0) -> TickScheduler:
    """Return a scheduler at the start of some moves."""
    return TickScheduler(plan(Motion('test', moves), LIMITS, rate))


def walk(scheduler: TickScheduler) -> list:
    """Ask exactly at each deadline; return (time asked, answer)."""
    answers, now = [], 0.0
    while (due := scheduler.due(now)) is not None:
        answers.append((now, due))
        now = due.deadline
    return answers


def test_a_second_at_ten_hertz_is_ten_messages():
    answers = walk(scheduler_of(Move(0.1, 0.0, 1.0)))
    assert [round(0.1 * k, 9) for k in range(10)] == [round(at, 9) for at, _ in answers]
    assert answers[-1][1].deadline == 1.0


def test_a_step_ends_on_its_boundary_not_on_the_grid():
    """0.25 s at 10 Hz: the third tick is cut short, and the next step begins there."""
    times = [at for at, _ in walk(scheduler_of(Move(0.1, 0.0, 0.25), Move(0.2, 0.0, 0.1)))]
    assert times == pytest.approx([0.0, 0.1, 0.2, 0.25])


@given(moves=MOVES, rate=RATES)
def test_asked_on_time_each_step_lasts_exactly_its_duration(moves, rate):
    answers = walk(scheduler_of(*moves, rate=rate))
    sent = sum((due.deadline - at) * due.velocity.linear_x for at, due in answers)
    assert sent == pytest.approx(sum(m.linear_x * m.duration for m in moves), abs=1e-9)
    assert all(due.deadline - at <= 1.0 / rate * (1 + 1e-5) for at, due in answers)


@given(moves=MOVES, rate=RATES, lateness=st.lists(st.floats(0.0, 0.5), max_size=200))
def test_a_late_query_moves_no_deadline(moves, rate, lateness):
    """Whatever the lateness, each deadline is one that a punctual walk has too."""
    punctual = {due.deadline for _, due in walk(scheduler_of(*moves, rate=rate))}
    scheduler, now = scheduler_of(*moves, rate=rate), 0.0
    for late in lateness:
        due = scheduler.due(now)
        if due is None:
            break
        assert due.deadline in punctual
        assert due.deadline > now
        now = due.deadline + late


def test_after_a_gap_the_current_velocity_is_due():
    scheduler = scheduler_of(Move(0.1, 0.0, 1.0), Move(0.2, 0.0, 1.0))
    scheduler.due(0.0)
    due = scheduler.due(1.05)
    assert due.velocity == Velocity(0.2, 0.0)
    assert due.deadline == pytest.approx(1.1)


def test_the_remaining_rest_is_returned():
    """Manual control is renewed where there is time for an answer."""
    scheduler = scheduler_of(Move(0.0, 0.0, 1.0), Move(0.1, 0.0, 1.0))
    assert [due.rest for _, due in walk(scheduler)] == pytest.approx(
        [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, *[0.0] * 10])


#: With these, a brake from 0.3 m/s takes 0.85 s.
GENTLE = Limits(0.3, 1.57, 0.5, 2.5, 2.0, 10.0)


def sent(moves, factors):
    """Return the forward velocities of moves under a factor that changes at these ticks."""
    scheduler, velocities, now, factor = (
        TickScheduler(plan(Motion('test', moves), GENTLE, 10.0)), [], 0.0, 1.0)
    for number in range(40):
        factor = factors.get(number, factor)
        if (due := scheduler.due(now, factor)) is None:
            break
        velocities.append(due.velocity.linear_x)
        now = due.deadline
    return velocities


def test_what_is_paused_before_its_first_velocity_does_not_move():
    assert sent([Move(0.3, 0.0, 1.0)], {0: 0.0}) == [0.0] * 40


def test_a_step_after_a_rest_that_is_paused_as_it_begins_does_not_move():
    moves = [Move(0.0, 0.0, 0.5), Move(0.3, 0.0, 1.0)]
    assert sent(moves, {5: 0.0}) == [0.0] * 40
    assert sent(moves, {2: 0.5, 5: 0.0}) == [0.0] * 40
    assert sent(moves, {2: 0.0, 4: 0.5, 7: 0.0}) == [0.0] * 40


def test_a_factor_that_ends_before_the_first_velocity_changes_nothing():
    moves = [Move(0.0, 0.0, 0.5), Move(0.2, 0.0, 1.0)]
    assert sent(moves, {1: 0.5, 5: 1.0}) == [0.0] * 5 + [0.2] * 10


def test_a_step_after_one_in_motion_that_is_paused_as_it_begins_brakes():
    velocities = sent([Move(0.3, 0.0, 0.5), Move(0.3, 0.0, 1.0)], {5: 0.0})
    assert velocities[:5] == [0.3] * 5
    assert 0.2 < velocities[5] < 0.3
    # 0.85 s in nine ticks of equal length.
    assert sum(velocities[5:]) * 0.85 / 9.0 == pytest.approx(0.1275)
