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
The text table of a fleet's plan: a row a robot, and which come too near to each other.

Tested by test/fleet/test_fleet_plan.py.
"""

from __future__ import annotations

import math
import textwrap

from kachaka_simple_control.analysis.clearance import MAX_ROUNDS
from kachaka_simple_control.files.watch_check import watch_text
from kachaka_simple_control.fleet.fleet_plan import FleetPlan, PlannedRobot
from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.text_tables import (
    Column,
    columns,
    INDENT,
    MAX_NAME_WIDTH,
    Row,
    WIDEST,
)
from kachaka_simple_control.text import format_fixed, one_line, pluralize

#: The columns of the table; those that are equal for all robots may be in the title instead.
COLUMNS = (
    Column('robot'), Column('motion'), Column('profile', spare=3),
    Column('from x', '[m]'), Column('y', '[m]'), Column('heading', '[deg]', 5),
    Column('takes', '[s]'), Column('length', '[m]', 4),
    Column('to x', '[m]'), Column('y', '[m]'), Column('heading', '[deg]', 6),
    Column('rate', '[Hz]', 1), Column('delay', '[ms]', 2))
#: The places of the columns of motion, profile, rate and delay, and how the title says each.
SHARED = {1: '{}', 2: '{}', 11: '{} Hz', 12: 'delay {} ms'}
#: The largest number of lines about near passes, and of names in a line.
MAX_PASSES, MAX_NAMES = 12, 5
TRUST = ('Start poses are taken on trust: put each robot where the fleet says, for nothing '
         'measures it.')


def fleet_table(plan: FleetPlan, widest: int | None = None) -> str:
    """
    Return the text table of a fleet's plan, with a row for each robot.

    :param widest: the width of the terminal [characters]; None if there is no terminal
    """
    widest = min(widest or WIDEST, WIDEST)
    rows = [_row(robot) for robot in plan.robots]
    shared = {place: rows[0][place] for place in SHARED
              if len({row[place] for row in rows}) == 1}
    kept = [place for place in range(len(COLUMNS)) if place not in shared]
    title = ', '.join([
        f'{one_line(plan.file.name, MAX_NAME_WIDTH)}: {pluralize(len(rows), "robot")}',
        *(SHARED[place].format(text) for place, text in shared.items() if text)])
    lines = columns([COLUMNS[place] for place in kept],
                    [tuple(row[place] for place in kept) for row in rows], widest)
    return '\n'.join([
        one_line(title, widest), '', *lines, '',
        *(part for line in [_timing(plan), *_clearance(plan), *_watched(plan), TRUST]
          for part in textwrap.wrap(line, widest, subsequent_indent=INDENT))])


def _row(robot: PlannedRobot) -> Row:
    plan = robot.plan
    return (
        *(one_line(name, MAX_NAME_WIDTH)
          for name in (robot.name, robot.fleet_robot.motion_file.title, robot.profile.name)),
        *_pose(robot.fleet_robot.start),
        format_fixed(plan.duration, 2), format_fixed(plan.length, 2), *_pose(robot.end),
        format_number(robot.order.rate),
        format_number(1e3 * robot.profile.delay) if robot.profile.delay else '')


def _pose(pose: Pose) -> Row:
    heading = math.degrees(math.remainder(pose.theta, math.tau))
    return format_fixed(pose.x, 2), format_fixed(pose.y, 2), format_fixed(heading, 1)


def _timing(plan: FleetPlan) -> str:
    """Return how long the fleet drives, how often, and how fast, as text."""
    takes = f'{format_fixed(plan.duration, 2)} s'
    rounds = f'{plan.file.repeat} rounds of {takes} each' if plan.file.repeat > 1 else takes
    slow = '' if plan.speed == 1.0 else f', at {100.0 * plan.speed:g} % of the speed'
    fault = 'the others go on' if plan.file.goes_on else 'all stop'
    return f'Takes: {rounds}{slow}; after a fault of one {fault}.'


def _watched(plan: FleetPlan) -> list[str]:
    """Return a line for all robots with one kind of watch, with their names unless all have it."""
    kinds: dict[str, list[str]] = {}
    for robot in plan.robots:
        if robot.watch and robot.profile.laser is not None:
            kinds.setdefault(watch_text(robot.profile.laser), []).append(robot.name)
    return [text if len(names) == len(plan.robots) else f'{text}: {_some(names)}'
            for text, names in kinds.items()]


def _some(names: list[str]) -> str:
    """Return the first names of a list, and how many more there are, as text."""
    more = f' and {len(names) - MAX_NAMES} more' if len(names) > MAX_NAMES else ''
    return f'{", ".join(names[:MAX_NAMES])}{more}'


def _clearance(plan: FleetPlan) -> list[str]:
    """Return lines on robots that come too near, and on what is not known of it."""
    margin = f'{100.0 * plan.file.margin:g} cm'
    lines = [f'Near: {near.text}' for near in plan.nearest[:MAX_PASSES]]
    if len(plan.nearest) > MAX_PASSES:
        lines.append(f'Near: and {len(plan.nearest) - MAX_PASSES} more')
    lines.append(f'Margin: {margin}; the start is refused without --allow-near.' if lines else
                 f'Margin: no two outlines come nearer than {margin}.')
    if not plan.are_all_rounds_checked:
        lines[-1] += f' Only the first {MAX_ROUNDS} rounds were looked at.'
    if unknown := [robot.name for robot in plan.floor if robot.footprint is None]:
        lines.append(f'Outline not known, so taken as a point: {_some(unknown)}.')
    return lines
