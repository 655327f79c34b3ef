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
"""The words for a hold by the obstacle watch."""

import math

from kachaka_simple_control.control.events import DriveState, WatchChanged, WatchState
from kachaka_simple_control.control.hold_text import (
    describe_hold,
    describe_obstacle,
    describe_watch,
    is_of_watch,
)
import pytest

AHEAD = WatchChanged(1.0, WatchState.OBSTACLE, 0.312, 0.0)
CLEAR = WatchChanged(1.0, WatchState.CLEAR)
SILENT = WatchChanged(1.0, WatchState.NO_SCAN)
PAUSED = DriveState.PAUSED


@pytest.mark.parametrize('distance, angle, text', [
    (0.312, 0.0, 'obstacle 0.31 m ahead'), (0.2, 1.0, 'obstacle 0.20 m ahead'),
    (0.0, 0.0, 'obstacle 0.00 m ahead'), (0.0, math.radians(24.2), 'obstacle 24 deg ahead'),
    (None, None, 'obstacle ahead')])
def test_how_far_an_obstacle_is_is_an_angle_only_in_a_turn_on_the_spot(distance, angle, text):
    assert describe_obstacle(distance, angle) == text


@pytest.mark.parametrize('state, factors, watch, text', [
    (PAUSED, {'obstacle': 0.0}, AHEAD, 'obstacle 0.31 m ahead, goes on by itself'),
    (PAUSED, {'obstacle': 0.0, 'override': 0.5}, AHEAD,
     'obstacle 0.31 m ahead, goes on by itself'),
    (PAUSED, {'obstacle': 0.0}, SILENT,
     'no scan of the laser, goes on with the next one; r goes on slowly'),
    # A watch that has ended says nothing, and its factor runs out.
    (PAUSED, {'obstacle': 0.0}, CLEAR, 'by the obstacle watch'),
    (PAUSED, {'obstacle': 0.0}, None, 'by the obstacle watch'),
    (PAUSED, {'obstacle of r1': 0.0}, CLEAR, 'obstacle of r1'),
    (PAUSED, {'obstacle': 0.0, 'obstacle of r1': 0.0}, AHEAD,
     'obstacle 0.31 m ahead, goes on by itself'),
    # Whoever else holds it does not let it go on by itself.
    (PAUSED, {'obstacle': 0.0, 'pause': 0.0}, AHEAD, ''),
    (PAUSED, {'obstacle': 0.0, 'moved': 0.0}, AHEAD, ''),
    (PAUSED, {'obstacle of r1': 0.0, 'remote control': 0.0}, CLEAR, ''),
    (PAUSED, {'override': 0.05, 'other': 0.1}, CLEAR, ''),
    (DriveState.STOPPING, {'obstacle': 0.0}, AHEAD, ''),
    (DriveState.DRIVING, {'obstacle': 0.3}, AHEAD, '')])
def test_a_robot_is_held_only_if_nobody_else_holds_it(state, factors, watch, text):
    assert describe_hold(state, factors, watch) == text


def test_without_a_scan_it_says_how_fast_it_goes_on():
    blind = WatchChanged(1.0, WatchState.BLIND)
    assert describe_watch(blind, {'obstacle': 0.3}) == (
        'no scan of the laser: at 30 % until one comes')
    assert describe_watch(CLEAR, {}) == describe_watch(None, {}) == ''


def test_factors_of_a_watch_are_known_by_their_names():
    assert [*map(is_of_watch, ('obstacle', 'obstacle of r1', 'obstacles', 'pause'))] == [
        True, True, False, False]
