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
"""Draw where a drive went: as planned, as sent and as odometry saw it, to scale."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
import math
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.motion.kinematics import ORIGIN, Pose
from kachaka_simple_control.report.driven_path import DrivenPath, Start
from kachaka_simple_control.report.frames import composed
from kachaka_simple_control.report.outline import Footprint, nose, outline, place, Point
from kachaka_simple_control.report.pictures.looks import (
    FAINT,
    GREEN,
    GREY,
    nice,
    ODOMETRY,
    PLANNED,
    SENT,
)
from kachaka_simple_control.report.pictures.path_picture import GRAIN, MARGIN, SMALLEST, TICK
from kachaka_simple_control.report.thinning import straightened
from kachaka_simple_control.report.track import Stretch, stretches

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Sizes and places [inch].
WIDTH = 5.4
LEFT, RIGHT, TOP, BOTTOM = 0.72, 0.12, 0.1, 0.98
#: The proportions of height to width that the picture itself may have.
FLATTEST, TALLEST = 0.42, 1.15
#: About so many numbers stand at the longer axis.
MARKS = 7.0
#: The robot where it stands in the end, and where it stood.
AT_END: dict[str, Any] = {
    'edgecolor': '#222222', 'linewidth': 1.4, 'facecolor': (0, 0, 0, 0.06), 'zorder': 2.0}
AT_START: dict[str, Any] = {
    'edgecolor': GREEN, 'linewidth': 1.6, 'facecolor': 'none', 'linestyle': (0, (4, 2)),
    'zorder': 2.2}
#: More points than these on one line make a page large.
MOST = 5000
#: From so many points on, dashes on dashes would be a wall; lines are thin and solid.
MANY = 1000
THIN: dict[str, Any] = {'linewidth': 0.6, 'linestyle': '-'}


def draw_drive_path(figure: Figure, path: DrivenPath, footprint: Footprint | None) -> None:
    """
    Draw a drive's path in a picture of its own; sets the height of the picture.

    :param figure: the picture, empty
    :param path: the drive
    :param footprint: the robot's outline; None if nobody knows it
    """
    lines = _lines(path)
    end = path.odometry[-1].pose if path.odometry else (
        path.reckoning.end if path.sent else path.planned_end)
    left, bottom, width, height = _extent(
        [*(point for points in lines.values() for point in points),
         *_corners(footprint, (ORIGIN, end))])
    inner = WIDTH - LEFT - RIGHT
    tall = inner * height / width
    whole = tall + TOP + BOTTOM
    figure.set_size_inches(WIDTH, whole)
    axes = figure.add_axes((LEFT / WIDTH, BOTTOM / whole, inner / WIDTH, tall / whole))
    _frame(axes, left, bottom, width, height)
    grain = max(width, height) * GRAIN
    for (name, points), look in zip(lines.items(), (PLANNED, SENT, ODOMETRY)):
        kept = straightened(points, grain, MOST)
        thin = THIN if name == 'odometry' and len(kept) > MANY else {}
        axes.plot([x for x, _ in kept], [y for _, y in kept], **{**look, **thin}, label=name,
                  gid=name)
    _draw_robots(axes, footprint, end, max(width, height) * TICK)
    figure.legend(
        loc='lower left', bbox_to_anchor=(LEFT / WIDTH, 0.02 / whole), ncol=3, frameon=False,
        borderpad=0.2, borderaxespad=0.0, handlelength=2.6, columnspacing=1.8)


def _lines(path: DrivenPath) -> dict[str, list[Point]]:
    planned = [(ORIGIN.x, ORIGIN.y)]
    for start in path.starts:
        planned.append((start.pose.x, start.pose.y))
        for part in _moved(start):
            planned += part.points()
    lines = {'planned': planned}
    if path.sent:
        lines['sent'] = [(pose.x, pose.y) for pose in (*_flat(path), path.reckoning.end)]
    if path.odometry:
        lines['odometry'] = [(seen.pose.x, seen.pose.y) for seen in path.odometry]
    return lines


def _flat(path: DrivenPath) -> Iterator[Pose]:
    """Return the poses along what was sent, close enough to each other to show arcs."""
    reckoning = path.reckoning
    for (begin, end), (one, two) in zip(pairwise(reckoning.times), pairwise(reckoning.poses)):
        yield one
        count = math.ceil(abs(two.theta - one.theta) / 0.1)
        if one.x == two.x and one.y == two.y:
            continue
        for part in range(1, min(count, 100)):
            yield reckoning.at(begin + (end - begin) * part / count)
    yield from reckoning.poses[-1:]


def _moved(start: Start) -> list[Stretch]:
    return [replace(part, start=composed(start.pose, part.start))
            for part in stretches(start.motion.plan)]


def _corners(footprint: Footprint | None, poses: Sequence[Pose]) -> list[Point]:
    if footprint is None:
        return [(pose.x, pose.y) for pose in poses]
    return [corner for pose in poses for corner in outline(footprint, pose)]


def _extent(points: Sequence[Point]) -> tuple[float, float, float, float]:
    known = [point for point in points if math.isfinite(point[0] + point[1])]
    xs, ys = [x for x, _ in known], [y for _, y in known]
    free = 1.0 + 2.0 * MARGIN
    width = max((max(xs) - min(xs)) * free, SMALLEST)
    height = max((max(ys) - min(ys)) * free, SMALLEST)
    width, height = max(width, height / TALLEST), max(height, width * FLATTEST)
    return ((min(xs) + max(xs) - width) / 2.0, (min(ys) + max(ys) - height) / 2.0, width, height)


def _frame(axes: Axes, left: float, bottom: float, width: float, height: float) -> None:
    from matplotlib.ticker import MultipleLocator

    axes.set(xlim=(left, left + width), ylim=(bottom, bottom + height), xlabel='x [m]',
             ylabel='y [m]')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(nice(max(width, height) / MARKS)))
    axes.grid(visible=True, color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)


def _draw_robots(
        axes: Axes, footprint: Footprint | None, end: Pose, reach: float) -> None:
    from matplotlib.collections import PolyCollection

    for pose, look, name in ((ORIGIN, AT_START, 'at the start'), (end, AT_END, 'at the end')):
        colour = look['edgecolor']
        tip = (reach, 0.0)
        if footprint is not None:
            axes.add_collection(PolyCollection(
                [outline(footprint, pose)], **look, label=f'robot {name}'))
            front = nose(footprint, ORIGIN)
            tip = front if front[0] > 0.0 else tip
        x, y = place(tip, pose)
        axes.plot([pose.x, x], [pose.y, y], color=colour, linewidth=1.4, zorder=2.5)
        axes.plot(pose.x, pose.y, linestyle='', marker='o', markersize=4.0, color=colour,
                  markeredgecolor=GREY, markeredgewidth=0.0, zorder=5.0,
                  label=None if footprint is not None else name)
