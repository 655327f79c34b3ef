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
Draw paths as maps that are true to scale, with marks such as arrow heads and step numbers.

Tested by test/report/test_path_marks.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, groupby, pairwise
import math
from typing import Any, NamedTuple, TYPE_CHECKING

from kachaka_simple_control.analysis.obstacle_holds import Hold
from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import (
    Area,
    Footprint,
    ORIGIN,
    outlines,
    Point,
    Pose,
    transform_point,
)
from kachaka_simple_control.motion.paths import distinct, PathPart, simplify, step_segments
from kachaka_simple_control.report.obstacle_plot import (
    draw_floor,
    draw_holds,
    floor_points,
    floor_rows,
    hold_points,
)
from kachaka_simple_control.report.plot_style import (
    add_axes,
    Colour,
    draw_line,
    LOOKS,
    round_step,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: The largest number of robots, and of arrows, that are drawn on a path.
MAX_MARKS = 16
#: The smallest visible length, as a part of the map's size.
MAP_GRAIN = 1.0 / 1500.0
#: The free margin on each side, as a part of the map's size.
MAP_MARGIN = 0.07
#: The size of the smallest map [m].
MIN_MAP_SIZE = 0.2
#: The distance below which step numbers share one label, as a part of the map's size.
PLACE_SIZE = 0.01
#: The length of the heading line of a robot without a footprint, as a part of the map's size.
HEADING_LENGTH = 0.06
# Sizes and positions [inch].
#: The width of a plot: on a phone 400 pixels wide, 9-point text is larger than 10 pixels.
WIDTH = 4.2
#: The margin above all axes.
TOP = 0.1
#: The lower edge of the legend.
LEGEND = 0.02
MAP_LEFT, MAP_RIGHT, MAP_BOTTOM = 0.72, 0.12, 1.12
#: The height of a row of the legend.
LEGEND_ROW = 0.17
#: The smallest and the largest ratio of height to width of a map.
FLATTEST, TALLEST = 0.42, 1.15
#: The approximate number of ticks on the longer axis of a map.
TICKS = 6.0
#: The style of the robot at the end and at the start.
AT_END: dict[str, Any] = {
    'edgecolor': '#222222', 'linewidth': 1.4, 'facecolor': (0, 0, 0, 0.06), 'zorder': 2.0}
AT_START: dict[str, Any] = {
    'edgecolor': Colour.GREEN, 'linewidth': 1.6, 'facecolor': 'none', 'linestyle': (0, (4, 2)),
    'zorder': 2.2}
#: The largest number of points of a line; more points would make the page large.
MAX_POINTS = 5000
#: A line with more points than this is thin and solid, because overlapping dashes would merge.
MANY = 1000
THIN: dict[str, Any] = {'linewidth': 0.6, 'linestyle': '-'}

#: The path of each step of a motion.
PlannedPath = list[list[PathPart]]


def add_map(figure: Figure, points: Iterable[Point],
            bottom: float = MAP_BOTTOM) -> tuple[Axes, float]:
    """
    Set the size of a figure, and add the axes of a map that shows all given points.

    :param figure: an empty figure
    :param points: the points to show [m]; points with an infinite or NaN coordinate are ignored
    :param bottom: the free space below the map, for example for a legend [inch]
    :returns: the axes, and the size of the map, which is the larger one of its width and height
        [m]
    """
    area = extent(points, FLATTEST, TALLEST)
    width = WIDTH - MAP_LEFT - MAP_RIGHT
    height = width * area.height / area.width
    figure.set_size_inches(WIDTH, bottom + height + TOP)
    axes = add_axes(figure, MAP_LEFT, bottom, width, height, aligns_label=False)
    size = max(area.width, area.height)
    set_map_limits(axes, area, size / TICKS)
    return axes, size


def extent(points: Iterable[Point], flattest: float, tallest: float) -> Area:
    """
    Return a rectangular area [m] that contains all given points, with a margin around them.

    :param points: the points [m]; points with an infinite or NaN coordinate are ignored
    """
    xs, ys = zip(*(point for point in points if math.isfinite(point[0] + point[1])))
    free = 1.0 + 2.0 * MAP_MARGIN
    width = max((max(xs) - min(xs)) * free, MIN_MAP_SIZE)
    height = max((max(ys) - min(ys)) * free, MIN_MAP_SIZE)
    width, height = max(width, height / tallest), max(height, width * flattest)
    return Area((min(xs) + max(xs) - width) / 2.0, (min(ys) + max(ys) - height) / 2.0,
                width, height)


def set_map_limits(axes: Axes, area: Area, tick_distance: float) -> None:
    """
    Set the area that a map shows, and use the same distance between grid lines in x and y.

    :param area: the area to show [m]
    :param tick_distance: the smallest allowed distance between two grid lines [m]; it is rounded
        up to 1, 2 or 5 times a power of ten
    """
    from matplotlib.ticker import MultipleLocator

    axes.set(xlim=(area.left, area.left + area.width), xlabel='x [m]',
             ylim=(area.bottom, area.bottom + area.height), ylabel='y [m]')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(round_step(tick_distance)))


def draw_legend(figure: Figure, left: float, ncol: int, *artists: Any) -> None:
    """
    Draw a legend at the lower edge of a figure.

    :param figure: the figure, which must have the standard width of a drive's plot
    :param left: the distance from the left edge of the figure to the legend [inch]
    :param ncol: the number of columns of the legend
    :param artists: the handles and the labels of the legend, as for ``Figure.legend`` of
        matplotlib; by default those of all axes
    """
    corner = (left / WIDTH, LEGEND / figure.get_figheight())
    figure.legend(*artists, loc='lower left', bbox_to_anchor=corner, ncol=ncol, frameon=False,
                  borderpad=0.2, borderaxespad=0.0, handlelength=2.6, columnspacing=1.8)


# Marks on a path.
#: The largest number of labels on a path; from more labels, only every n-th is drawn.
MAX_LABELS = 12
#: The largest number of parts of a label; a part is a step number or a range of them.  A longer
#: label is cut after two parts.
MAX_PARTS = 3
#: The distances between the path and a label, and between two labels [points].
AWAY, APART = 6.0, 2.0
#: The style of a label; its background is translucent.
LABEL: dict[str, Any] = {
    'color': '#222222', 'fontweight': 'bold', 'ha': 'center', 'va': 'center', 'zorder': 7.0,
    'textcoords': 'offset points', 'gid': 'step number',
    'bbox': {'facecolor': 'white', 'edgecolor': 'none', 'alpha': 0.7, 'pad': 0.5}}


class StepPlace(NamedTuple):
    """
    A point on a path beside which the numbers of one or more steps are written.

    The point is the middle of the longest segment of the step's path.  Steps with nearly the same
    middle share one point.

    :param numbers: the numbers of the steps, in order
    :param side: the direction from the point to the numbers [rad]: to the outside of a curve, or
        to the right of a straight line
    """

    numbers: list[int]
    x: float
    y: float
    side: float

    @property
    def label(self) -> str:
        """
        Return the step numbers as text, for example '1, 3-5'.

        If the text would have more than three parts, only the first two and '...' are returned.
        """
        parts: list[str] = []
        for _, group in groupby(enumerate(self.numbers), key=lambda item: item[1] - item[0]):
            run = [number for _, number in group]
            parts += [f'{run[0]}-{run[-1]}'] if len(run) > 2 else map(str, run)
        return ', '.join(parts if len(parts) <= MAX_PARTS else [*parts[:2], '...'])


def step_places(
        steps: Iterable[tuple[int, Sequence[PathPart]]], grain: float) -> list[StepPlace]:
    """
    Return the points on a path beside which the numbers of the steps are written.

    Its point is the middle of the longest segment of its path.  Steps with nearly the same point
    share one point.

    :param grain: the approximate distance [m]; two points that are closer become one point
    """
    places: dict[tuple[int, int], StepPlace] = {}
    for number, segments in steps:
        if not segments:
            continue
        longest = max(segments, key=lambda segment: (abs(segment.distance), abs(segment.angle)))
        middle = longest.middle
        side = middle.theta - math.copysign(math.pi / 2.0, longest.angle)
        cell = (round(middle.x / grain), round(middle.y / grain))
        places.setdefault(cell, StepPlace([], middle.x, middle.y, side)).numbers.append(number)
    return list(places.values())


def draw_step_numbers(
        axes: Axes, steps: Iterable[tuple[int, Sequence[PathPart]]], size: float) -> None:
    """
    Write the numbers of the steps of a motion beside their paths on a map.

    A number is left out if there is no free space for it.  If there are many numbers, only some of
    them are written.

    :param axes: the axes of the map; the area that they show must be set before
    :param steps: for each step, its number and the segments of its path; the steps that come first
        get the free space first
    :param size: the larger one of the map's width and height [m]
    """
    places = step_places(steps, size * PLACE_SIZE)
    some = places[::max(1, math.ceil(len(places) / MAX_LABELS))]
    draw_labels(axes, [(place.label, (place.x, place.y), place.side) for place in some], LABEL)


def draw_labels(
        axes: Axes, labels: Iterable[tuple[str, Point, float]], look: Mapping[str, Any],
        taken: Sequence[Any] = ()) -> list[Any]:
    """
    Write texts beside points of a map; those without free space are left out.

    :param axes: the axes of the map; the area that they show must be set before
    :param labels: each with its text, its point [m], and the direction from the point to the text
        [rad], which is turned if there is no space; the first ones get the space first
    :param taken: the boxes of earlier labels, as returned
    :returns: the boxes of all labels
    """
    canvas: Any = axes.figure.canvas  # a raster canvas, which can measure text
    pixels, renderer = axes.figure.dpi / 72.0, canvas.get_renderer()
    boxes = list(taken)
    for words, point, side in labels:
        label = axes.annotate(words, point, (0.0, 0.0), **look)
        text = label.get_window_extent(renderer)
        for turned in (0.0, math.pi, -math.pi / 2.0, math.pi / 2.0):
            right, up = math.cos(side + turned), math.sin(side + turned)
            reach = AWAY + (abs(right) * text.width + abs(up) * text.height) / 2.0 / pixels
            label.set_position((reach * right, reach * up))
            box = label.get_window_extent(renderer).padded(APART * pixels)
            is_inside = axes.bbox.contains(*box.min) and axes.bbox.contains(*box.max)
            if is_inside and not any(map(box.overlaps, boxes)):
                boxes.append(box)
                break
        else:
            label.remove()
    return boxes


def draw_directions(axes: Axes, segments: Iterable[PathPart], grain: float, colour: str) -> None:
    """
    Draw arrow heads that show the direction of travel at the middles of path segments.

    At most 16 arrow heads are drawn.  A segment in which the robot turns in place has none.

    :param grain: the approximate distance [m]; two arrow heads that are closer and have the same
        direction are drawn as one
    """
    middles = (segment.middle for segment in segments if segment.distance)
    draw_arrows(axes, distinct(middles, grain, MAX_MARKS), colour)


def draw_arrows(axes: Axes, poses: Sequence[Pose], colour: str) -> None:
    """Draw an arrow head at each of the given poses."""
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D

    head = Path([(-1.0, 0.8), (0.4, 0.0), (-1.0, -0.8), (-0.6, 0.0), (-1.0, 0.8)])
    for pose in poses:
        turned = Affine2D().rotate(pose.theta).transform_path(head)
        axes.plot(pose.x, pose.y, marker=turned, markersize=8.0, color=colour,
                  markeredgewidth=0.0, zorder=4.5, gid='arrow')


def draw_drive_path(
        figure: Figure, aligned: AlignedDrive, footprint: Footprint | None,
        holds: Sequence[Hold] = (), floor: Floor | None = None) -> None:
    """
    Draw a map of a drive's path, and set the size of the figure.

    The map shows the path as planned, as sent and from odometry.  It also shows the step numbers,
    the direction of travel, the robot at its start and at its end, and where it was held.

    :param figure: an empty figure
    :param footprint: the robot's outline, seen from above; None if it is not known
    :param holds: by an obstacle watch
    :param floor: what stands on it; None if unknown
    """
    planned = _planned(aligned)
    lines = path_lines(aligned)
    end = aligned.odometry[-1].pose if aligned.odometry else (
        aligned.dead_reckoning.end if aligned.sent else aligned.planned_end)
    shown = [*chain(*lines.values()), *outlines(footprint, (ORIGIN, end)),
             *hold_points(holds, footprint)]
    axes, size = add_map(
        figure, [*shown, *floor_points(floor, shown)],
        MAP_BOTTOM + LEGEND_ROW * (bool(holds) + floor_rows(floor)))
    draw_floor(axes, floor)
    for name, points in lines.items():
        kept = simplify(points, size * MAP_GRAIN, MAX_POINTS)
        thin = THIN if name == 'odometry' and len(kept) > MANY else {}
        draw_line(axes, kept, **{**LOOKS[name], **thin}, label=name, gid=name)
    _draw_robots(axes, footprint, end, size * HEADING_LENGTH)
    draw_holds(axes, [(footprint, holds, ORIGIN)])
    draw_directions(axes, chain(*chain(*planned)), size * PLACE_SIZE, LOOKS['sent']['color'])
    draw_step_numbers(axes, enumerate(_begun(aligned, planned), 1), size)
    draw_legend(figure, MAP_LEFT, 2)


def _planned(aligned: AlignedDrive) -> list[PlannedPath]:
    return [step_segments(start.motion.plan, start.pose) for start in aligned.motion_starts]


def path_lines(aligned: AlignedDrive) -> dict[str, list[Point]]:
    """
    Return the planned path, the sent path and the odometry path of a drive as points [m].

    The sent path is the path of a robot that follows the sent velocities exactly.

    :returns: the points of each path, with the keys ``planned``, ``sent`` and ``odometry``; the
        sent path and the odometry path are missing if they are not known
    """
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


def _begun(aligned: AlignedDrive, planned: Sequence[PlannedPath]) -> Iterator[list[PathPart]]:
    """
    Yield the planned path of each step that the robot started.

    If no velocity was sent at all, yield the path of each planned step.
    """
    for start, steps in zip(aligned.motion_starts, planned):
        if not aligned.sent:
            yield from steps
            continue
        # If the motion ended early, only its first steps started.
        for segments, step in zip(steps, start.motion.steps):
            if step.sent:
                yield segments


def _sent_poses(aligned: AlignedDrive) -> Iterator[Pose]:
    """
    Yield poses on the path of a robot that follows the sent velocities of a drive exactly.

    Where the robot drives a curve, extra poses are added, so that lines between the poses look
    round.
    """
    reckoning = aligned.dead_reckoning
    for (begin, end), (one, two) in zip(pairwise(reckoning.times), pairwise(reckoning.poses)):
        yield one
        if one.x == two.x and one.y == two.y:
            continue
        count = min(math.ceil(abs(two.theta - one.theta) / 0.1), 100)
        for part in range(1, count):
            yield reckoning.at(begin + (end - begin) * part / count)
    yield from reckoning.poses[-1:]


def draw_fleet_robots(
        axes: Axes, robots: Sequence[tuple[Footprint | None, Pose, Pose]], reach: float) -> None:
    """
    Draw robots at their starts and ends: outlines, and lines from their axles to their fronts.

    :param robots: the outline of each, None if it is unknown, and its poses at start and end
    :param reach: the length of the line of a robot without an outline [m]
    """
    from matplotlib.collections import LineCollection, PolyCollection

    for look, gid in ((AT_START, 'start'), (AT_END, 'end')):
        bodies = [(footprint, start if look is AT_START else end)
                  for footprint, start, end in robots]
        axes.add_collection(PolyCollection(
            [outlines(footprint, [pose]) for footprint, pose in bodies if footprint is not None],
            **look, label=f'at the {gid}', gid=gid))
        axes.add_collection(LineCollection(
            [[(pose.x, pose.y),
              transform_point((footprint.front if footprint else reach, 0.0), pose)]
             for footprint, pose in bodies],
            colors=look['edgecolor'], linewidths=1.4, zorder=2.5, gid=f'{gid} heading'))


def _draw_robots(axes: Axes, footprint: Footprint | None, end: Pose, reach: float) -> None:
    from matplotlib.collections import PolyCollection

    if footprint is not None and footprint.front > 0.0:
        reach = footprint.front
    for pose, look, name in ((ORIGIN, AT_START, 'at the start'), (end, AT_END, 'at the end')):
        colour = look['edgecolor']
        if footprint is not None:
            axes.add_collection(
                PolyCollection([outlines(footprint, [pose])], **look, label=f'robot {name}'))
        x, y = transform_point((reach, 0.0), pose)
        axes.plot([pose.x, x], [pose.y, y], color=colour, linewidth=1.4, zorder=2.5)
        axes.plot(pose.x, pose.y, linestyle='', marker='o', markersize=4.0, color=colour,
                  markeredgecolor=Colour.GREY, markeredgewidth=0.0, zorder=5.0,
                  label=None if footprint is not None else name)
