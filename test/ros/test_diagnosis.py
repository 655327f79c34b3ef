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
"""A diagnosis names the worst there is, and tells all there is to know."""

from __future__ import annotations

import dataclasses

from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.telemetry.events import MotionEnded, MotionPlanned
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from kachaka_simple_control.ros.session_status import (  # noqa: I100
    diagnose,
    SessionStatus,
    TickStatistics,
)
from kachaka_simple_control.telemetry.diagnosis import Level  # noqa: I100
from plans import ABRUPT  # noqa: I100

WELL = SessionStatus(
    subscriber_count=1, other_publishers=(), guardian='matched', odometry_age=0.02,
    manual_control='asked for 3 s ago', halted_by=None)


def told(statistics=None, **changes):
    """Return the diagnosis of what is well but for some changes."""
    return diagnose(statistics or TickStatistics(), dataclasses.replace(WELL, **changes), 0.0)


@pytest.mark.parametrize('changes, level, text', [
    ({}, Level.OK, 'nothing to drive yet'),
    ({'odometry_age': None}, Level.OK, 'nothing to drive yet'),
    ({'subscriber_count': 0}, Level.WARN, 'nobody takes our velocities'),
    ({'other_publishers': ('joy', 'nav')}, Level.WARN,
     'others have publishers of velocities: joy, nav'),
    ({'odometry_age': 1.5}, Level.WARN, 'odometry is silent'),
    ({'guardian': 'stopped the robot because the node fell silent', 'subscriber_count': 0},
     Level.ERROR, 'the guardian stopped the robot because the node fell silent'),
    ({'halted_by': 'stopped by SIGINT', 'odometry_age': 9.0},
     Level.ERROR, 'halted for good: stopped by SIGINT'),
])
def test_the_worst_is_the_message(changes, level, text):
    assert told(**changes)[:2] == (level, text)


def test_skipped_velocities_and_an_early_end_are_worth_a_warning():
    statistics = TickStatistics()
    statistics.skipped = 2
    assert told(statistics)[:2] == (Level.WARN, 'velocities were skipped')
    statistics.on_event(MotionPlanned(Motion('on', (Move(0.1, 0.0, 1.0),)), ABRUPT, 10.0))
    statistics.on_event(MotionEnded(1.0, 'the robot left'))
    statistics.process()
    diagnosis = told(statistics)
    assert diagnosis[:2] == (
        Level.WARN, 'the last motion was over before its end: the robot left')
    assert diagnosis.values['state'] == 'stopped early'
    assert diagnosis.values['motion'] == 'on'


def test_what_nobody_knows_is_said_to_be_unknown():
    values = told(odometry_age=None).values
    assert values['odometry age'] == 'never heard'
    assert values['motion'] == values['other publishers'] == 'none'
    assert values['step'] == '0 of 0'
