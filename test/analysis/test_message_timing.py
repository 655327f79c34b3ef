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
"""The times of the messages of a drive, compared with those at which they were due."""

import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.message_timing import due_times, timing
from kachaka_simple_control.analysis.plan_view import estimate_sleep_loop, LOOP_OVERHEAD
from kachaka_simple_control.control.events import (
    MotionEnded,
    MotionPlanned,
    MotionStarted,
)
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move
from messages import of_plan, of_stop
from plans import LESSON
import pytest
from strategies import MOTIONS

LIMITS = Limits(1.0, 2.0)
SECOND = Motion('second', [Move(0.1, 0.0, 1.0)])


def sent_at(*times, motion=SECOND, reason=None):
    """Return a motion at 10 Hz of which messages were sent at these times, and its end."""
    record = DriveLog()
    record.on_event(MotionPlanned(motion, LIMITS, 10.0))
    record.on_event(MotionStarted(100.0))
    for moment in times:
        due = math.floor(moment * 10 + 1e-6) / 10
        record.on_event(of_plan(100.0 + moment, Velocity(0.1, 0.0), due=due))
    record.on_event(of_plan(101.0, ZERO, 100.0) if reason is None
                    else of_stop(100.0 + max(times) + 0.5))
    record.on_event(MotionEnded(101.1, reason))
    return record.motions


def test_late_and_lost_are_counted_as_the_benchmarks_do():
    """A quarter of a period is late; more than a half, and the tick is lost."""
    found = timing(sent_at(0.0, 0.1, 0.224, 0.326, 0.445, 0.6, 0.7, 0.8, 0.9))
    assert (found.due, found.late, found.lost) == (10, 2, 1)
    assert found.lateness.worst == pytest.approx(0.045)
    assert max(found.interval_errors) == pytest.approx(0.055)


@given(MOTIONS, st.sampled_from([5.0, 20.0, 37.0]))
def test_due_times_are_those_of_the_tick_scheduler(motion, rate):
    from kachaka_simple_control.control.tick_scheduler import TickScheduler
    planned = plan(motion, Limits(5.0, 10.0), rate)
    scheduler, now, asked = TickScheduler(planned), 0.0, []
    while (due := scheduler.due(now)) is not None:
        asked.append(now)
        now = due.deadline
    assert due_times(planned, math.inf) == pytest.approx(asked)


def test_the_loop_of_the_lesson_holds_a_second_too_long():
    """At 10 Hz ten turns take 1.008 s; at 100 Hz 93 turns fill the second."""
    for rate, turns in ((10.0, 10), (100.0, 93)):
        found = estimate_sleep_loop([plan(SECOND, LIMITS, rate)])
        assert found.extra_time == pytest.approx(turns * (1.0 / rate + LOOP_OVERHEAD) - 1.0)
        assert found.missing_messages == rate - turns
        assert found.distance == pytest.approx(0.1 * found.extra_time)


def test_the_loop_of_the_lesson_turns_too_far():
    found = estimate_sleep_loop([plan(Motion('turn', [Move(0.0, 0.5, 2.0)]), LIMITS, 10.0)])
    assert found.angle == pytest.approx(0.5 * 20 * LOOP_OVERHEAD)
    assert estimate_sleep_loop([plan(LESSON, LIMITS, 10.0)]).extra_time == pytest.approx(
        90 * LOOP_OVERHEAD)
