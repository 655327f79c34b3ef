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
"""Plot the floor of a fleet: the planned path of each robot, and where two come too near."""

from __future__ import annotations

from itertools import chain
import math
import os
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.analysis.clearance import FleetView, FloorRobot
from kachaka_simple_control.motion.geometry import compose, Point, Pose, transform_point
from kachaka_simple_control.motion.paths import (
    floor_area,
    PathPart,
    polyline,
    step_segments,
)
from kachaka_simple_control.report.map_plot import (
    draw_directions,
    draw_fleet_robots,
    draw_labels,
    extent,
    FLATTEST,
    HEADING_LENGTH,
    LABEL,
    MAP_GRAIN,
    PLACE_SIZE,
    set_map_limits,
    TALLEST,
)
from kachaka_simple_control.report.obstacle_plot import draw_floor, floor_points
from kachaka_simple_control.report.output_file import check_plot_file, save_figure
from kachaka_simple_control.report.plan_plot import RESOLUTION
from kachaka_simple_control.report.plot_style import add_axes, Colour, draw_figure, draw_line
from kachaka_simple_control.text import format_fixed, one_line, pluralize

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: The colours of the robots, one after the other.  Near passes have a colour of their own.
COLOURS = (Colour.BLUE, Colour.GREEN, Colour.PURPLE, Colour.SKY, '#E69F00', Colour.GREY)
NEAR: dict[str, Any] = {
    'linestyle': '', 'marker': 'X', 'markersize': 10.0, 'color': Colour.ORANGE,
    'markeredgecolor': 'white', 'zorder': 6.0}
#: With more robots than this, paths have no arrows.
MANY_ROBOTS = 12
#: The largest number of near passes with a text.
MAX_TEXTS = 12
# Sizes and positions [inch].
WIDTH = 9.0
LEFT, RIGHT, BOTTOM, TOP = 0.75, 0.15, 0.85, 0.4
LEGEND = 0.08
#: The approximate number of ticks on the longer axis.
TICKS = 10.0


def save_plot(file: str | os.PathLike[str], view: FleetView) -> None:
    """
    Plot the floor of a fleet, and save the plot as an image file.

    :param file: its suffix selects the image format: .png, .svg or .pdf
    :raises UsageError: if the file cannot be written, or matplotlib is missing
    """
    path = check_plot_file(file)
    save_figure(draw_fleet(view), path)


def draw_fleet(view: FleetView) -> Figure:
    """
    Plot the floor of a fleet in its first round; near passes of later rounds are marked as well.

    :raises UsageError: if matplotlib is missing
    """
    return draw_figure(lambda figure: _draw(figure, view), RESOLUTION)


def _draw(figure: Figure, view: FleetView) -> None:
    shown = [*_needed(view), *(near.place for near in view.passes)]
    area = extent([*shown, *floor_points(view.obstacles, shown)], FLATTEST, TALLEST)
    width = WIDTH - LEFT - RIGHT
    height = width * area.height / area.width
    figure.set_size_inches(WIDTH, BOTTOM + height + TOP)
    axes = add_axes(figure, LEFT, BOTTOM, width, height)
    size = max(area.width, area.height)
    set_map_limits(axes, area, size / TICKS)
    draw_floor(axes, view.obstacles)
    for number, robot in enumerate(view.robots):
        colour = COLOURS[number % len(COLOURS)]
        segments: list[PathPart] = [
            *chain.from_iterable(step_segments(robot.plan, robot.start))]
        points = polyline(segments, size * MAP_GRAIN) if segments else [_point(robot.start)]
        draw_line(axes, points, color=colour, linewidth=1.4, zorder=3.0, gid='path')
        if len(view.robots) <= MANY_ROBOTS:
            draw_directions(axes, segments, size * PLACE_SIZE, colour)
    draw_fleet_robots(
        axes, [(robot.footprint, robot.start, _end(robot)) for robot in view.robots],
        size * HEADING_LENGTH)
    names = [(robot.name.replace('$', r'\$'), _point(robot.start), robot.start.theta + math.pi)
             for robot in view.robots]
    draw_labels(axes, names, {**LABEL, 'gid': 'name'}, _draw_passes(axes, view))
    duration = max(robot.plan.duration for robot in view.robots)
    title = (f'{one_line(view.name, 50)}: {pluralize(len(view.robots), "robot")}, '
             f'{format_fixed(duration, 1)} s')
    # Matplotlib reads text between two dollar signs as a formula.
    figure.text(LEFT / WIDTH, 1.0 - 0.1 / figure.get_figheight(), title.replace('$', r'\$'),
                va='top', fontsize=12.0, fontweight='bold')
    figure.legend(
        loc='lower left', bbox_to_anchor=(LEFT / WIDTH, LEGEND / figure.get_figheight()),
        ncol=3, frameon=False, borderpad=0.0, borderaxespad=0.0, columnspacing=1.8)


def _needed(view: FleetView) -> list[Point]:
    """Return the corners of the floor that each robot needs [m]."""
    areas: dict[tuple[int, object], tuple[Point, Point]] = {}
    points = []
    for robot in view.robots:
        key = (id(robot.plan), robot.footprint)
        if key not in areas:
            areas[key] = floor_area(robot.plan, robot.footprint).corners
        (left, bottom), (right, top) = areas[key]
        points += [transform_point(corner, robot.start)
                   for corner in ((left, bottom), (right, bottom), (right, top), (left, top))]
    return points


def _draw_passes(axes: Axes, view: FleetView) -> list[Any]:
    """Mark the near passes, and return the boxes of their texts."""
    if not view.passes:
        return []
    axes.plot(*zip(*(near.place for near in view.passes)), **NEAR, gid='near',
              label=f'nearer than {100.0 * view.margin:g} cm')
    return draw_labels(
        axes, [(f'{100.0 * near.distance:.3g} cm, {format_fixed(near.time, 1)} s', near.place, 0.0)
               for near in view.passes[:MAX_TEXTS]],
        {**LABEL, 'color': Colour.ORANGE, 'gid': 'near text'})


def _end(robot: FloorRobot) -> Pose:
    return compose(robot.start, robot.plan.pose)


def _point(pose: Pose) -> Point:
    return pose.x, pose.y
