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
"""Plot the path of a drive: as planned, as sent, and from odometry."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, pairwise
import math
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive
from kachaka_simple_control.analysis.paths import ArcSegment, distinct, simplify, step_segments
from kachaka_simple_control.analysis.plan_view import Area
from kachaka_simple_control.motion.geometry import (
    Footprint,
    front_point,
    ORIGIN,
    outline,
    Point,
    Pose,
    transform_point,
)
from kachaka_simple_control.report.path_marks import draw_arrows, draw_step_numbers, step_places
from kachaka_simple_control.report.plot_style import (
    add_axes,
    GREEN,
    GREY,
    HEADING_LENGTH,
    MAP_GRAIN,
    MAP_MARGIN,
    MAX_MARKS,
    MIN_MAP_SIZE,
    ODOMETRY,
    PLACE_SIZE,
    PLANNED,
    SENT,
    set_map_limits,
    style_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Sizes and positions [inch].
#: The width of a plot: on a phone 400 pixels wide, 9-point text is larger than 10 pixels.
WIDTH = 4.2
#: The margin above all axes.
TOP = 0.1
#: The bottom of the legend.
LEGEND = 0.02
PATH_LEFT, PATH_RIGHT, PATH_BOTTOM = 0.72, 0.12, 1.12
#: The smallest and the largest ratio of height to width of a map.
FLATTEST, TALLEST = 0.42, 1.15
#: The approximate number of ticks on the longer axis of a map.
TICKS = 6.0
#: The style of the robot at the end and at the start.
AT_END: dict[str, Any] = {
    'edgecolor': '#222222', 'linewidth': 1.4, 'facecolor': (0, 0, 0, 0.06), 'zorder': 2.0}
AT_START: dict[str, Any] = {
    'edgecolor': GREEN, 'linewidth': 1.6, 'facecolor': 'none', 'linestyle': (0, (4, 2)),
    'zorder': 2.2}
#: The largest number of points of a line; more points would make the page large.
MAX_POINTS = 5000
#: A line with more points than this is thin and solid, because overlapping dashes would merge.
MANY = 1000
THIN: dict[str, Any] = {'linewidth': 0.6, 'linestyle': '-'}

#: The paths of the steps of a motion.
PlannedPath = list[list[ArcSegment]]


def draw_drive_path(figure: Figure, aligned: AlignedDrive, footprint: Footprint | None) -> None:
    """
    Draw the path of a drive, and set the size of the figure.

    :param figure: an empty figure
    :param aligned: the drive
    :param footprint: the robot's outline; None if it is not known
    """
    planned = _planned(aligned)
    lines = path_lines(aligned)
    end = aligned.odometry[-1].pose if aligned.odometry else (
        aligned.dead_reckoning.end if aligned.sent else aligned.planned_end)
    area = extent([
        *(point for points in lines.values() for point in points),
        *_corners(footprint, (ORIGIN, end))])
    width = WIDTH - PATH_LEFT - PATH_RIGHT
    height = width * area.height / area.width
    figure.set_size_inches(WIDTH, PATH_BOTTOM + height + TOP)
    axes = add_axes(figure, PATH_LEFT, PATH_BOTTOM, width, height)
    size = max(area.width, area.height)
    set_map_limits(axes, *area, tick_distance=size / TICKS)
    style_axes(axes)
    for (name, points), look in zip(lines.items(), (PLANNED, SENT, ODOMETRY)):
        kept = simplify(points, size * MAP_GRAIN, MAX_POINTS)
        thin = THIN if name == 'odometry' and len(kept) > MANY else {}
        axes.plot([x for x, _ in kept], [y for _, y in kept], **{**look, **thin}, label=name,
                  gid=name)
    _draw_robots(axes, footprint, end, size * HEADING_LENGTH)
    middles = (segment.middle for steps in planned for segment in chain(*steps)
               if segment.distance)
    draw_arrows(axes, distinct(middles, size * PLACE_SIZE, MAX_MARKS), SENT['color'])
    draw_step_numbers(axes, step_places(enumerate(_begun(aligned, planned), 1), size * PLACE_SIZE))
    draw_legend(figure, PATH_LEFT, 2)


def _planned(aligned: AlignedDrive) -> list[PlannedPath]:
    return [step_segments(start.motion.plan, start.pose) for start in aligned.motion_starts]


def path_lines(aligned: AlignedDrive) -> dict[str, list[Point]]:
    """Return the planned path and, if known, the sent path and the odometry path [m]."""
    lines = {'planned': [(ORIGIN.x, ORIGIN.y)]}
    for start, steps in zip(aligned.motion_starts, _planned(aligned)):
        lines['planned'].append((start.pose.x, start.pose.y))
        for segment in chain(*steps):
            lines['planned'] += segment.points()
    if aligned.sent:
        poses = (*_sent_poses(aligned), aligned.dead_reckoning.end)
        lines['sent'] = [(pose.x, pose.y) for pose in poses]
    if aligned.odometry:
        lines['odometry'] = [(sample.pose.x, sample.pose.y) for sample in aligned.odometry]
    return lines


def _begun(aligned: AlignedDrive, planned: Sequence[PlannedPath]) -> Iterator[list[ArcSegment]]:
    """Return the paths of the steps that began; of all steps if nothing was sent."""
    for start, steps in zip(aligned.motion_starts, planned):
        if not aligned.sent:
            yield from steps
            continue
        # If the motion was cut short, only its first steps began.
        for segments, step in zip(steps, start.motion.steps):
            if step.sent:
                yield segments


def _sent_poses(aligned: AlignedDrive) -> Iterator[Pose]:
    """Return the poses along the sent path, close enough together to show arcs."""
    reckoning = aligned.dead_reckoning
    for (begin, end), (one, two) in zip(pairwise(reckoning.times), pairwise(reckoning.poses)):
        yield one
        if one.x == two.x and one.y == two.y:
            continue
        count = min(math.ceil(abs(two.theta - one.theta) / 0.1), 100)
        for part in range(1, count):
            yield reckoning.at(begin + (end - begin) * part / count)
    yield from reckoning.poses[-1:]


def _corners(footprint: Footprint | None, poses: Sequence[Pose]) -> list[Point]:
    if footprint is None:
        return [(pose.x, pose.y) for pose in poses]
    return [corner for pose in poses for corner in outline(footprint, pose)]


def extent(points: Sequence[Point]) -> Area:
    """Return an area [m] around points, with a margin and a limited ratio of height to width."""
    finite = [point for point in points if math.isfinite(point[0] + point[1])]
    xs, ys = [x for x, _ in finite], [y for _, y in finite]
    free = 1.0 + 2.0 * MAP_MARGIN
    width = max((max(xs) - min(xs)) * free, MIN_MAP_SIZE)
    height = max((max(ys) - min(ys)) * free, MIN_MAP_SIZE)
    width, height = max(width, height / TALLEST), max(height, width * FLATTEST)
    return Area((min(xs) + max(xs) - width) / 2.0, (min(ys) + max(ys) - height) / 2.0,
                width, height)


def _draw_robots(axes: Axes, footprint: Footprint | None, end: Pose, reach: float) -> None:
    from matplotlib.collections import PolyCollection

    for pose, look, name in ((ORIGIN, AT_START, 'at the start'), (end, AT_END, 'at the end')):
        colour = look['edgecolor']
        tip = (reach, 0.0)
        if footprint is not None:
            axes.add_collection(PolyCollection(
                [outline(footprint, pose)], **look, label=f'robot {name}'))
            front = front_point(footprint, ORIGIN)
            tip = front if front[0] > 0.0 else tip
        x, y = transform_point(tip, pose)
        axes.plot([pose.x, x], [pose.y, y], color=colour, linewidth=1.4, zorder=2.5)
        axes.plot(pose.x, pose.y, linestyle='', marker='o', markersize=4.0, color=colour,
                  markeredgecolor=GREY, markeredgewidth=0.0, zorder=5.0,
                  label=None if footprint is not None else name)


def draw_legend(figure: Figure, left: float, ncol: int, *artists: Any) -> None:
    """
    Draw a legend below the axes of a drive's plot.

    :param left: its left edge [inch]
    :param ncol: the number of its columns
    :param artists: its handles and labels; by default the handles and labels of all axes
    """
    figure.legend(
        *artists, loc='lower left', ncol=ncol, frameon=False, borderpad=0.2, borderaxespad=0.0,
        bbox_to_anchor=(left / WIDTH, LEGEND / figure.get_figheight()), handlelength=2.6,
        columnspacing=1.8)
