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
Draw the floor of a fleet's drive: the planned and the driven path of each robot.

Tested by test/report/test_fleet_page.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
import math
from typing import TYPE_CHECKING

from kachaka_simple_control.analysis.fleet_summary import RobotSummary
from kachaka_simple_control.analysis.obstacle_holds import Hold
from kachaka_simple_control.motion.geometry import (
    compose,
    Footprint,
    outlines,
    Point,
    Pose,
    transform_point,
)
from kachaka_simple_control.motion.paths import simplify
from kachaka_simple_control.report.drive_plots import DrivePlots, embed_svg, RESOLUTION
from kachaka_simple_control.report.map_plot import (
    add_map,
    draw_fleet_robots,
    draw_labels,
    draw_legend,
    HEADING_LENGTH,
    LABEL,
    LEGEND_ROW,
    MAP_GRAIN,
    MAP_LEFT,
    MAX_POINTS,
    path_lines,
)
from kachaka_simple_control.report.obstacle_plot import (
    draw_floor,
    draw_holds,
    floor_points,
    floor_rows,
    hold_points,
)
from kachaka_simple_control.report.plot_style import draw_figure, draw_line, file_of, LOOKS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: The name of the plot.
FLOOR = 'floor'
#: The room below the map for the axis and a legend of two rows [inch].
BOTTOM = 0.95
#: With more robots than this, lines are thin.
MANY_ROBOTS = 12
#: The width of the planned line of one of many robots [points].
THIN = 2.5


@dataclass(frozen=True)
class _RobotOnFloor:
    """A robot's paths and poses in the frame of the floor; ``end`` by odometry if there is any."""

    name: str
    footprint: Footprint | None
    start: Pose
    end: Pose
    lines: dict[str, list[Point]]
    holds: Sequence[Hold]


def draw_fleet_plots(robots: Sequence[RobotSummary]) -> DrivePlots:
    """
    Draw the floor of a fleet, as an SVG element and as a PNG file; nothing without a plan.

    :raises UsageError: if matplotlib is missing
    """
    if not any(robot.log.motions for robot in robots):
        return DrivePlots({}, b'')
    figure = draw_figure(lambda figure: draw_fleet_paths(figure, robots))
    svg = file_of(figure, '.svg', svg_fonttype='none').decode()
    return DrivePlots({FLOOR: embed_svg(svg, FLOOR)}, file_of(figure, '.png', RESOLUTION))


def draw_fleet_paths(figure: Figure, robots: Sequence[RobotSummary]) -> None:
    """
    Draw a map of the floor with all robots, and set the size of the figure.

    :param figure: an empty figure
    """
    placed = [_place(robot) for robot in robots]
    floor = next((session.floor for robot in robots if (
        session := robot.log.session_started) is not None and session.floor is not None), None)
    shown = [
        *chain.from_iterable(chain.from_iterable(robot.lines.values()) for robot in placed),
        *chain.from_iterable(
            outlines(robot.footprint, (robot.start, robot.end)) for robot in placed),
        *chain.from_iterable(
            hold_points(robot.holds, robot.footprint, robot.start) for robot in placed)]
    rows = any(robot.holds for robot in placed) + floor_rows(floor)
    axes, size = add_map(
        figure, [*shown, *floor_points(floor, shown)], BOTTOM + LEGEND_ROW * rows)
    draw_floor(axes, floor)
    is_crowded = len(placed) > MANY_ROBOTS
    for number, robot in enumerate(placed):
        for name, points in robot.lines.items():
            look = {**LOOKS[name], **({'linewidth': THIN / (1 + (name != 'planned'))}
                                      if is_crowded else {})}
            kept = simplify(points, size * MAP_GRAIN, max(MAX_POINTS // len(placed), 100))
            draw_line(axes, kept, **look, gid=name, label=None if number else name)
    draw_fleet_robots(
        axes, [(robot.footprint, robot.start, robot.end) for robot in placed],
        size * HEADING_LENGTH)
    draw_holds(axes, [(robot.footprint, robot.holds, robot.start) for robot in placed])
    draw_labels(
        axes, [(robot.name, (robot.start.x, robot.start.y), robot.start.theta + math.pi)
               for robot in placed], {**LABEL, 'gid': 'robot'})
    draw_legend(figure, MAP_LEFT, 2)


def _place(robot: RobotSummary) -> _RobotOnFloor:
    session, start = robot.log.session_started, robot.member.start
    end = robot.final_pose or (
        robot.aligned.dead_reckoning.end if robot.aligned.sent else robot.aligned.planned_end)
    lines = path_lines(robot.aligned)
    return _RobotOnFloor(
        robot.member.name, None if session is None else session.footprint, start,
        compose(start, end),
        {name: [transform_point(point, start) for point in lines[name]]
         for name in ('planned', 'odometry') if name in lines}, robot.holds)
