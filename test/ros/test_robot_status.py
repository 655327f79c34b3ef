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
"""Statistics of ticks and steps, and the diagnosis made of them and of a robot's status."""

from __future__ import annotations

import dataclasses

from kachaka_simple_control.control.diagnosis import Level
from kachaka_simple_control.control.events import DriveState, WatchChanged, WatchState
from kachaka_simple_control.control.robot_drive import DriveProgress
from kachaka_simple_control.motion.plan import plan
from kachaka_simple_control.motion.steps import Motion, Move
from optional_libraries import MISSING, optional_imports
from plans import ABRUPT
import pytest

RobotStatus = MISSING
with optional_imports():
    from kachaka_simple_control.ros.robot_status import diagnose, RobotStatus

pytestmark = pytest.mark.needs('rclpy')

IN_ORDER = RobotStatus(
    subscriber_count=1, other_publishers=(), guardian='matched', odometry_age=0.02,
    manual_control='requested 3 s ago', speed='full speed', stopped_by=None)


PLAN = plan(Motion('on', (Move(0.1, 0.0, 1.0), Move(0.0, 0.5, 1.0))), ABRUPT, 10.0)
NONE = DriveProgress()
DRIVING = DriveProgress('on', PLAN, began=100.0, plan_time=0.5, state=DriveState.DRIVING)


def diagnosis_of(progress=NONE, **changes):
    """Return the diagnosis of a robot in order but for some changes."""
    return diagnose(progress, dataclasses.replace(IN_ORDER, **changes))


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


@pytest.mark.parametrize('state, text', [*zip(DriveState, (
    'nothing started yet', 'connecting to the robot', 'connecting to the robot', 'driving',
    'paused', 'stopping', 'at rest', 'stopped early'))])
def test_each_state_has_its_documented_text(state, text):
    assert diagnosis_of(dataclasses.replace(DRIVING, state=state)).values['state'] == text


@pytest.mark.parametrize('watch, factors, state, level, message, text', [
    (None, {}, 'driving', Level.OK, 'driving', 'off'),
    ((WatchState.CLEAR,), {}, 'driving', Level.OK, 'driving', 'clear'),
    ((WatchState.OBSTACLE, 0.312, 0.0), {'obstacle': 0.0},
     'held obstacle 0.31 m ahead, goes on by itself', Level.OK,
     'held obstacle 0.31 m ahead, goes on by itself', 'obstacle 0.31 m ahead, goes on by itself'),
    ((WatchState.NO_SCAN,), {'obstacle': 0.0, 'pause': 0.0}, 'paused', Level.WARN,
     'no scan of the laser, goes on with the next one; r goes on slowly',
     'no scan of the laser, goes on with the next one; r goes on slowly'),
    ((WatchState.BLIND,), {'obstacle': 0.3}, 'driving', Level.WARN,
     'no scan of the laser: at 30 % until one comes',
     'no scan of the laser: at 30 % until one comes')])
def test_a_hold_by_the_obstacle_watch_is_told(watch, factors, state, level, message, text):
    is_held = 0.0 in factors.values()
    found = diagnosis_of(dataclasses.replace(
        DRIVING, state=DriveState.PAUSED if is_held else DriveState.DRIVING, factors=factors,
        watch=None if watch is None else WatchChanged(100.4, *watch)))
    assert found[:2] == (level, message)
    assert found.values['state'] == state
    assert found.values['obstacle watch'] == text


@pytest.mark.parametrize('plan_time, step', [
    (None, '0 of 2'), (0.0, '1 of 2'), (0.99, '1 of 2'), (1.01, '2 of 2'), (2.0, '2 of 2')])
def test_steps_are_numbered(plan_time, step):
    progress = dataclasses.replace(DRIVING, plan_time=plan_time)
    assert diagnosis_of(progress).values['step'] == step


def test_skipped_velocities_and_an_early_end_are_a_warning():
    assert diagnosis_of(DriveProgress(skipped=2))[:2] == (Level.WARN, 'velocities were skipped')
    diagnosis = diagnosis_of(dataclasses.replace(
        DRIVING, state=DriveState.CUT_SHORT, ended_by='the robot left', skipped=2))
    assert diagnosis[:2] == (
        Level.WARN, 'the last motion was over before its end: the robot left')
    assert diagnosis.values['state'] == 'stopped early'
    assert diagnosis.values['motion'] == 'on'


def test_unknown_values_are_said_to_be_unknown():
    values = diagnosis_of(odometry_age=None).values
    assert values['odometry age'] == 'none received'
    assert values['motion'] == values['other publishers'] == 'none'
    assert values['step'] == '0 of 0'
