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
"""
Say in words why the obstacle watch holds a robot, the same in displays, diagnoses and reports.

Tested by test/control/test_hold_text.py.
"""

from __future__ import annotations

from collections.abc import Mapping
import math

from kachaka_simple_control.control.events import DriveState, WatchChanged, WatchState
from kachaka_simple_control.control.speed_factor import is_hold, OBSTACLE
from kachaka_simple_control.text import format_fixed

#: The state that is shown in place of ``paused`` if only the obstacle watch holds the robot.
HELD = 'held'
#: How the factors begin that hold robots of a fleet while the watch of another holds that one.
OF_OTHERS = f'{OBSTACLE} of '
#: A shorter way is shown as an angle, if the robot still can turn [m].
SHORTEST = 0.005


def is_of_watch(name: str) -> bool:
    """Return whether a speed factor is that of an obstacle watch, by the name of its source."""
    return name == OBSTACLE or name.startswith(OF_OTHERS)


def describe_hold(
        state: DriveState, factors: Mapping[str, float], watch: WatchChanged | None) -> str:
    """
    Return why a robot is paused, if only obstacle watches hold it; empty otherwise.

    :param factors: the speed factors, by the name of their source
    :param watch: the newest of the robot; None without a watch
    """
    holders = [name for name, factor in factors.items() if is_hold(factor)]
    if state is not DriveState.PAUSED or not all(map(is_of_watch, holders)):
        return ''
    if OBSTACLE in holders:
        # A watch that says nothing any more holds as well.
        return describe_watch(watch, factors) or 'by the obstacle watch'
    return next(iter(holders), '')


def describe_watch(watch: WatchChanged | None, factors: Mapping[str, float]) -> str:
    """Return what the obstacle watch of a robot says; empty without a watch, or if all is free."""
    match watch:
        case WatchChanged(state=WatchState.OBSTACLE):
            return f'{describe_obstacle(watch.distance, watch.angle)}, goes on by itself'
        case WatchChanged(state=WatchState.NO_SCAN):
            return 'no scan of the laser, goes on with the next one; r goes on slowly'
        case WatchChanged(state=WatchState.BLIND):
            speed = 100.0 * factors.get(OBSTACLE, 1.0)
            return f'no scan of the laser: at {speed:.3g} % until one comes'
    return ''


def describe_obstacle(distance: float | None, angle: float | None) -> str:
    """
    Return where on the way of a robot an obstacle is, such as ``obstacle 0.31 m ahead``.

    :param distance: how far the robot can still drive [m]; None if unknown
    :param angle: how far it can still turn on this way [rad]; None if unknown
    """
    if distance is not None and (distance >= SHORTEST or not angle):
        return f'obstacle {format_fixed(distance, 2)} m ahead'
    if angle is not None:
        return f'obstacle {format_fixed(math.degrees(angle), 0)} deg ahead'
    return 'obstacle ahead'
