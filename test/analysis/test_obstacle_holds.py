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
"""When, where and before what an obstacle watch has held the robot."""

import io
import math

from held_drives import AHEAD, held_drive, log_of, NEAR, POST
from kachaka_simple_control.analysis.summary import Summary
from kachaka_simple_control.control.events import (
    MotionPlanned,
    MotionStarted,
    ScanReceived,
    SpeedFactorChanged,
    WatchChanged,
    WatchState,
)
from kachaka_simple_control.motion.geometry import Velocity, ZERO
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.report.report_program import EventStore
from kachaka_simple_control.telemetry.subscriber_process import decode
from messages import of_plan
import pytest

CLOSER = WatchState.OBSTACLE, 0.06, 0.0
SILENT, BLIND = (WatchState.NO_SCAN,), (WatchState.BLIND,)


def holds_of(*holds, **options):
    """Return the holds of a drive."""
    return Summary(log_of(held_drive(*holds, **options))).holds


def test_a_hold_says_when_where_and_before_what():
    summary = Summary(log_of(held_drive((1.0, 4.0, (NEAR, CLOSER)))))
    (hold,) = summary.holds
    assert (hold.begin, hold.end) == (pytest.approx(1.0, abs=1e-6), pytest.approx(4.0, abs=1e-6))
    assert hold.plan_time == pytest.approx(1.0, abs=0.06)
    assert hold.reason == 'obstacle 0.06 m ahead'
    assert summary.step_number(hold) == 1
    # The robot brakes after the hold has begun.
    still = summary.aligned.dead_reckoning.at(summary.aligned.start_time + 3.9)
    assert hold.pose.x == pytest.approx(still.x, abs=0.002)
    assert 0.2 < hold.pose.x < 0.4
    # The obstacle is where it stands, not where it was seen from the robot at rest.
    assert hold.points[0] == pytest.approx(POST, abs=0.01)


def test_each_hold_is_told_once_and_what_does_not_hold_is_not():
    holds = holds_of((0.8, 3.0, (NEAR, CLOSER, NEAR)), (4.0, 5.0, (BLIND,)),
                     (5.4, 9.0, ((WatchState.OBSTACLE, 0.0, math.radians(24.0)), SILENT)))
    assert [hold.reason for hold in holds] == [
        'obstacle 0.06 m ahead', 'obstacle 24 deg ahead', 'no scan of the laser']
    assert [len(hold.points) for hold in holds] == [1, 1, 0]
    first, turn, silent = holds
    assert turn.end == silent.begin
    assert silent.end == pytest.approx(9.0, abs=1e-6)
    assert first.step is not turn.step
    assert holds_of() == []


def test_a_hold_ends_with_the_motion_and_is_there_from_its_start():
    (hold,) = holds_of((1.0, 9.0, (NEAR,)), until=2.5)
    assert hold.end == pytest.approx(2.5, abs=0.06)
    log = log_of([
        WatchChanged(8.0, *SILENT), MotionPlanned(AHEAD, Limits(0.25, 1.0), 10.0),
        ScanReceived(8.9, ((0.9, 0.0),)), WatchChanged(9.0, *NEAR),
        MotionStarted(10.0), SpeedFactorChanged(10.0, {'obstacle': 0.0}),
        of_plan(10.0, ZERO, 10.0), of_plan(10.1, ZERO, 10.0, plan_time=0.0),
        WatchChanged(10.15, WatchState.CLEAR), of_plan(10.2, Velocity(0.1), 10.0, plan_time=0.0),
        of_plan(10.3, Velocity(0.1), 10.0, plan_time=0.1)])
    (hold,) = Summary(log).holds
    assert (hold.begin, hold.end, hold.plan_time) == (0.0, pytest.approx(0.15), 0.0)
    assert hold.points == ((0.9, 0.0),)


def test_without_odometry_only_the_place_is_unknown():
    (hold,) = holds_of((1.0, 4.0, (NEAR,)), odometry_period=None)
    assert hold.pose is None
    assert hold.distance == 0.3
    assert len(hold.points) == 1


def test_of_all_scans_those_are_kept_that_the_report_needs():
    events = held_drive((1.0, 4.0, (NEAR, CLOSER)), (6.0, 8.0, (NEAR,)))
    began = next(event.time for event in events if isinstance(event, MotionStarted))
    place = events.index(next(event for event in events if isinstance(event, MotionStarted)))
    many = [*events[:place + 1], *(
        ScanReceived(began + number / 1000.0, ()) for number in range(100)), *events[place + 1:]]
    file = io.BytesIO()
    store = EventStore(file)
    for event in many:
        store.on_event(event)
    file.seek(0)
    kept = [*decode(file)]
    assert Summary(log_of(kept)).holds == Summary(log_of(events)).holds
    assert sum(isinstance(event, ScanReceived) for event in kept) <= 5
    assert [event for event in kept if not isinstance(event, ScanReceived)] == [
        event for event in events if not isinstance(event, ScanReceived)]
