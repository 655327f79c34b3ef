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
Describe a fleet for the programs that command it.

Tested by test/commands/test_fleet_reports.py.
"""

from __future__ import annotations

from collections.abc import Iterable
import contextlib
from dataclasses import replace

from kachaka_simple_control.files import protocol
from kachaka_simple_control.fleet.fleet_plan import FleetPlan
from kachaka_simple_control.motion.geometry import (
    compose,
    distance_between,
    ORIGIN,
    Point,
    Pose,
    transform_point,
)
from kachaka_simple_control.motion.paths import sample_path, simplify
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.text import escaped

#: How many points a planned path may have: the first number with which the report is short enough.
MOST_POINTS = (300, 100, 30, 20, 10, 6, 2)
#: How far the shown path may be from the planned one, with few points more [m].
GRAIN = 0.005
#: How many rounds the path of a robot shows that ends elsewhere than it starts.
MOST_ROUNDS = 20
#: The longest name of a motion, with the values of its parameters [characters].
MAX_TITLE = 60
#: A round that ends so near to its start ends there [m].
SAME_PLACE = 1e-3


def fleet_report(plan: FleetPlan, floor: protocol.FloorMap | None = None) -> protocol.Fleet:
    """Return the first report of a fleet, with paths in as many points as one line can have."""
    file = plan.file
    outlines: dict[tuple[protocol.Point, ...], int] = {}
    robots = []
    for robot in plan.robots:
        footprint = robot.profile.footprint
        corners = None if footprint is None else _rounded_points(footprint.corners())
        robots.append(protocol.FloorRobot(
            robot.name, escaped(robot.fleet_robot.motion_file.title, MAX_TITLE),
            rounded(robot.fleet_robot.start),
            round(robot.plan.duration, 3), (),
            None if corners is None else outlines.setdefault(corners, len(outlines))))
    report = protocol.Fleet(
        file.name, file.source, file.margin, file.repeat,
        round(plan.duration, 3), tuple(outlines), tuple(robots), floor)
    # Robots that drive the same have one order; to compare orders would take long.
    plans = {id(robot.order): robot.plan for robot in plan.robots}
    paths = {order: _path(driven, file.repeat) for order, driven in plans.items()}
    for most in MOST_POINTS:
        paths = {order: simplify(path, GRAIN, most) for order, path in paths.items()}
        with_paths = replace(report, robots=tuple(
            replace(robot, path=_rounded_points(
                transform_point(point, planned.fleet_robot.start)
                for point in paths[id(planned.order)]))
            for robot, planned in zip(robots, plan.robots)))
        with contextlib.suppress(protocol.MessageError):  # too long
            protocol.write_line(with_paths)
            return with_paths
    return report


def _path(plan: Plan, rounds: int) -> list[Point]:
    """Return points on the path of all rounds, from 0, 0, 0."""
    start, points = ORIGIN, []
    for _ in range(min(rounds, MOST_ROUNDS)):
        points += [(pose.x, pose.y) for pose in sample_path(plan, start)]
        start = compose(start, plan.pose)
        if distance_between(start, ORIGIN)[0] < SAME_PLACE:
            break
    return points


def _rounded_points(points: Iterable[Point]) -> tuple[protocol.Point, ...]:
    return tuple((round(x, 3), round(y, 3)) for x, y in points)


def rounded(pose: Pose) -> protocol.Pose:
    """Return a pose in whole millimetres and milliradians."""
    return round(pose.x, 3), round(pose.y, 3), round(pose.theta, 3)
