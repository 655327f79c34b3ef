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
"""Statistics of ticks and steps, and the diagnosis made of them and of a session's status."""

from __future__ import annotations

import dataclasses

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.motion.geometry import ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.telemetry.diagnosis import Level
from kachaka_simple_control.telemetry.events import (
    MotionEnded,
    MotionPlanned,
    MotionStarted,
    VelocitySent,
)
from optional_libraries import MISSING, optional_imports
from plans import ABRUPT
import pytest

SessionStatus = MISSING
with optional_imports():
    from kachaka_simple_control.ros.session_status import diagnose, SessionStatus, TickStatistics

pytestmark = pytest.mark.needs('rclpy')

LIMITS = Limits(0.3, 1.5)
MOTION = Motion('three', (Move(0.1, 0.0, 0.35), Move(0.0, 0.5, 0.3), Move(0.1, 0.0, 0.1)))
#: When its velocities are due at 10 Hz: a step's last tick may be short.
TICKS = [0.0, 0.1, 0.2, 0.3, 0.35, 0.45, 0.55, 0.65, 0.75]
START = 0.0


def started():
    """Return the statistics of a motion that has just started."""
    statistics = TickStatistics()
    statistics.on_plan(plan(MOTION, LIMITS, 10.0))
    statistics.on_event(MotionPlanned(MOTION, LIMITS, 10.0))
    statistics.on_event(VelocitySent(START - 0.1, ZERO))  # to a robot just met
    statistics.on_event(VelocitySent(START, ZERO))
    statistics.on_event(MotionStarted(START))
    statistics.process()
    return statistics


def send(statistics, *times):
    """Send velocities at these times after t = 0."""
    for time in times:
        statistics.on_event(VelocitySent(START + time, ZERO))
    statistics.process()
    return statistics.late, statistics.skipped


def test_what_comes_in_time_is_neither_late_nor_skipped():
    assert send(started(), *(tick + 0.02 for tick in TICKS[1:])) == (0, 0)


def test_a_little_early_by_rounding_is_in_time():
    assert send(started(), *(tick - 1e-9 for tick in TICKS[1:])) == (0, 0)


def test_a_quarter_of_a_period_is_late():
    assert send(started(), 0.1249) == (0, 0)
    assert send(started(), 0.1251, 0.2, 0.33, 0.35) == (2, 0)


def test_a_velocity_whose_time_passed_counts_as_skipped():
    # Due at 0.1 and 0.2 and never sent; the one of 0.3 comes in time.
    assert send(started(), 0.301) == (0, 2)
    # That of 0.3 comes late, the short one of 0.35 in time.
    assert send(started(), 0.33, 0.36) == (1, 2)


def test_the_last_zero_may_be_late_and_the_stop_after_it_may_not():
    statistics = started()
    assert send(statistics, *TICKS[1:-1], 0.78) == (1, 0)
    assert send(statistics, 0.79, 0.8, 1.3) == (1, 0)
    statistics.on_event(MotionEnded(START + 1.4))
    assert send(statistics, 1.5) == (1, 0)


def test_steps_are_numbered():
    statistics = TickStatistics()
    assert statistics.step(START) == (0, 0)
    statistics = started()
    numbers = [statistics.step(START + time) for time in (0.0, 0.34, 0.36, 0.64, 0.66, 0.8, 99.0)]
    assert numbers == [(1, 3), (1, 3), (2, 3), (2, 3), (3, 3), (3, 3), (3, 3)]


def test_a_motion_that_has_not_started_is_in_no_step():
    statistics = TickStatistics()
    statistics.on_plan(plan(MOTION, LIMITS, 10.0))
    statistics.on_event(MotionPlanned(MOTION, LIMITS, 10.0))
    statistics.process()
    assert statistics.is_active
    assert not statistics.has_started
    assert statistics.step(START) == (0, 3)


def test_an_end_has_its_reason():
    statistics = started()
    statistics.on_event(MotionEnded(START + 0.2, 'the robot left'))
    statistics.process()
    assert (statistics.is_active, statistics.failure) == (False, 'the robot left')
    statistics.on_event(MotionPlanned(MOTION, LIMITS, 10.0))
    statistics.process()
    assert (statistics.is_active, statistics.failure) == (True, None)


@given(st.lists(st.integers(0, 250), min_size=8, max_size=8))
def test_lateness_is_counted_tick_by_tick(delays):
    """However late the thread wakes after each deadline."""
    statistics, place, skipped, late = started(), 0, 0, 0
    for delay in delays:
        now = TICKS[place + 1] + (delay + 0.5) / 1e3  # never on a boundary
        reached = max(number for number, tick in enumerate(TICKS) if tick <= now)
        skipped += reached - place - 1
        late += now - TICKS[reached] >= 0.025
        place = reached
        statistics.on_event(VelocitySent(now, ZERO))
        if place == len(TICKS) - 1:
            break
    statistics.process()
    assert (statistics.late, statistics.skipped) == (late, skipped)


IN_ORDER = SessionStatus(
    subscriber_count=1, other_publishers=(), guardian='matched', odometry_age=0.02,
    manual_control='asked for 3 s ago', speed_factor=1.0, speed='full speed', stopped_by=None)


def diagnosis_of(statistics=None, **changes):
    """Return the diagnosis of a session in order but for some changes."""
    return diagnose(statistics or TickStatistics(), dataclasses.replace(IN_ORDER, **changes), 0.0)


@pytest.mark.parametrize('changes, level, text', [
    # Whether or not a motion waits to be started.
    ({}, Level.OK, 'nothing started yet'),
    ({'odometry_age': None}, Level.OK, 'nothing started yet'),
    ({'subscriber_count': 0}, Level.WARN, 'no subscriber for the velocities'),
    ({'other_publishers': ('joy', 'nav')}, Level.WARN,
     'others have publishers of velocities: joy, nav'),
    ({'odometry_age': 1.5}, Level.WARN, 'odometry is silent'),
    ({'guardian': 'stopped the robot because the node sent no heartbeat', 'subscriber_count': 0},
     Level.ERROR, 'the guardian stopped the robot because the node sent no heartbeat'),
    ({'stopped_by': 'stopped by SIGINT', 'odometry_age': 9.0},
     Level.ERROR, 'stopped permanently: stopped by SIGINT'),
])
def test_the_worst_is_the_message(changes, level, text):
    assert diagnosis_of(**changes)[:2] == (level, text)


@pytest.mark.parametrize('factor, state', [
    (1.0, 'driving'), (0.01, 'driving'), (0.005, 'paused'), (0.0, 'paused')])
def test_a_motion_that_is_held_is_paused(factor, state):
    statistics = TickStatistics()
    statistics.on_event(MotionPlanned(Motion('on', (Move(0.1, 0.0, 1.0),)), ABRUPT, 10.0))
    statistics.on_event(MotionStarted(1.0))
    statistics.process()
    assert diagnosis_of(statistics, speed_factor=factor).values['state'] == state


def test_skipped_velocities_and_an_early_end_are_a_warning():
    statistics = TickStatistics()
    statistics.skipped = 2
    assert diagnosis_of(statistics)[:2] == (Level.WARN, 'velocities were skipped')
    statistics.on_event(MotionPlanned(Motion('on', (Move(0.1, 0.0, 1.0),)), ABRUPT, 10.0))
    statistics.on_event(MotionEnded(1.0, 'the robot left'))
    statistics.process()
    diagnosis = diagnosis_of(statistics)
    assert diagnosis[:2] == (
        Level.WARN, 'the last motion was over before its end: the robot left')
    assert diagnosis.values['state'] == 'stopped early'
    assert diagnosis.values['motion'] == 'on'


def test_unknown_values_are_said_to_be_unknown():
    values = diagnosis_of(odometry_age=None).values
    assert values['odometry age'] == 'none received'
    assert values['motion'] == values['other publishers'] == 'none'
    assert values['step'] == '0 of 0'
