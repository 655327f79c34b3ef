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
"""Plots of a drive: path, velocities and errors over time, periods."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
import io
from itertools import pairwise
import math
from operator import attrgetter
import re
from typing import Any, TYPE_CHECKING
import warnings

from kachaka_simple_control.motion.geometry import (
    compose,
    Footprint,
    front_point,
    ORIGIN,
    outline,
    Point,
    Pose,
    transform_point,
)
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.report.drive_log import DriveLog
from kachaka_simple_control.report.odometry_alignment import AlignedDrive, OdometrySample
from kachaka_simple_control.report.paths import arc_segments, min_max_decimate, simplify, StepPoint
from kachaka_simple_control.report.plan_plot import Area, GRAIN, MARGIN, SMALLEST, TICK
from kachaka_simple_control.report.plot_style import (
    add_axes,
    ANGULAR,
    BLUE,
    default_style,
    draw_limits,
    GREEN,
    GREY,
    LINEAR,
    ODOMETRY,
    ORANGE,
    PLANNED,
    round_step,
    Scale,
    scale_for,
    SENT,
    set_map_limits,
    set_time_limits,
    style_axes,
    time_unit,
    velocity_steps,
    VelocityComponent,
)
from kachaka_simple_control.report.summary import Summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Sizes and places [inch].
WIDTH = 5.4
#: Above all axes.
TOP = 0.1
#: The legend's bottom.
LEGEND = 0.02
PATH_LEFT, PATH_RIGHT, PATH_BOTTOM = 0.72, 0.12, 0.98
#: Beside and below plots over time, and plots of periods.
LEFT, RIGHT, BOTTOM = 0.78, 0.14, 0.52
#: The height of a row of a plot over time, the gap between two, and the room for a legend.
ROW, GAP, KEY = 1.45, 0.2, 0.28
PERIOD_HEIGHT = 2.5
#: The proportions of height to width that a map may have.
FLATTEST, TALLEST = 0.42, 1.15
#: About so many ticks on a map's longer axis.
TICKS = 7.0
#: The robot where it ended, and where it started.
AT_END: dict[str, Any] = {
    'edgecolor': '#222222', 'linewidth': 1.4, 'facecolor': (0, 0, 0, 0.06), 'zorder': 2.0}
AT_START: dict[str, Any] = {
    'edgecolor': GREEN, 'linewidth': 1.6, 'facecolor': 'none', 'linestyle': (0, (4, 2)),
    'zorder': 2.2}
#: More points than these on one line make a page large.
MAX_POINTS = 5000
#: A line with more points than these is thin and solid, for dashes on dashes would be a wall.
MANY = 1000
THIN: dict[str, Any] = {'linewidth': 0.6, 'linestyle': '-'}
#: Names of lines whose value is held until the next point.
HELD = ('planned', 'sent')
#: With more points than these a line over time is drawn as a band, of so many parts.
MAX_LINE_POINTS, BANDS = 6000, 180
#: The bars of a histogram on either side of the middle one.
BARS = 25
#: The least range of a histogram on either side [ms].
LEAST = 0.5
#: Texts stay texts: they can be found, copied and read aloud.
SVG: Any = {'svg.fonttype': 'none'}
#: Metadata that are left out: the same drive gives the same bytes.
NO_METADATA = {'Date': None, 'Creator': None, 'Format': None, 'Type': None}
#: Pixels an inch of the PNG.
RESOLUTION = 200
#: Names of the plots.
PATH, VELOCITIES, ERRORS, PERIODS = 'path', 'velocities', 'errors', 'periods'


@dataclass(frozen=True)
class DrivePlots:
    """
    The plots of a drive.

    :param svg: the SVG elements by name, ready to stand in a page
    :param png: the path
    """

    svg: dict[str, str]
    png: bytes


def draw_drive_plots(summary: Summary) -> DrivePlots:
    """
    Draw a drive; what was not sent or seen is not drawn.

    :raises UsageError: if matplotlib is missing
    """
    with default_style(), warnings.catch_warnings():
        from matplotlib import rc_context
        # A letter that the font lacks becomes a box.
        warnings.filterwarnings('ignore', message='Glyph')
        figures = {name: _figure(draw) for name, draw in _plots(summary).items()}
        png = io.BytesIO()
        if PATH in figures:
            figures[PATH].savefig(png, format='png', dpi=RESOLUTION, metadata={'Software': None})
        with rc_context(SVG):
            return DrivePlots(
                {name: _svg(figure, name) for name, figure in figures.items()}, png.getvalue())


def _plots(summary: Summary) -> dict[str, Callable[[Figure], None]]:
    log, path = summary.log, summary.path
    if not log.motions:
        return {}
    session = log.session_started
    limits = common_limits(log)
    footprint = None if session is None else session.footprint
    plots: dict[str, Callable[[Figure], None]] = {
        PATH: lambda figure: draw_drive_path(figure, path, footprint),
        VELOCITIES: lambda figure: draw_drive_velocities(figure, path, limits)}
    if path.odometry:
        plots[ERRORS] = lambda figure: draw_drive_errors(figure, path)
    if summary.timing.interval_errors:
        plots[PERIODS] = lambda figure: draw_periods(figure, summary.timing.interval_errors)
    return plots


def common_limits(log: DriveLog) -> Limits:
    """Return the limits that all motions were planned with; if they differ, those of the robot."""
    first, *others = [motion.planned.limits for motion in log.motions]
    session = log.session_started
    return first if session is None or all(limits == first for limits in others) else (
        session.limits)


def _figure(draw: Callable[[Figure], None]) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure()
    FigureCanvasAgg(figure)
    draw(figure)
    return figure


def _svg(figure: Figure, name: str) -> str:
    data = io.BytesIO()
    figure.savefig(data, format='svg', metadata=NO_METADATA)
    return embed_svg(data.getvalue().decode(), name)


def embed_svg(svg: str, name: str) -> str:
    """
    Return an SVG file of matplotlib's as an element of a page.

    It is as wide as there is room, and has no addresses and no style that applies to others.

    :param svg: the text of the file
    :param name: a prefix for each id that it refers to, so that plots do not share any
    """
    svg = svg[svg.index('<svg'):]
    svg = re.sub(r'<metadata>.*?</metadata>', '', svg, flags=re.DOTALL)
    svg = re.sub(r'<defs>\s*<style[^>]*>.*?</style>\s*</defs>', '', svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', '', svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r'\1', svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r'\1', svg, count=1)
    referred = set(re.findall(r'(?:href="|url\()#([^")]*)', svg))
    svg = re.sub(r' id="([^"]*)"', lambda found: (
        f' id="{name}-{found[1]}"' if found[1] in referred else ''), svg)
    svg = re.sub(r'(href="#|url\(#)', rf'\g<1>{name}-', svg)
    return re.sub(r'\n+\s*', '\n', svg)


def draw_drive_path(figure: Figure, path: AlignedDrive, footprint: Footprint | None) -> None:
    """
    Draw the path of a drive, and set the size of the figure.

    :param figure: the figure, empty
    :param path: the drive
    :param footprint: the robot's outline; None if it is not known
    """
    lines = _path_lines(path)
    end = path.odometry[-1].pose if path.odometry else (
        path.dead_reckoning.end if path.sent else path.planned_end)
    area = _extent([*(point for points in lines.values() for point in points),
                    *_corners(footprint, (ORIGIN, end))])
    width = WIDTH - PATH_LEFT - PATH_RIGHT
    height = width * area.height / area.width
    figure.set_size_inches(WIDTH, PATH_BOTTOM + height + TOP)
    axes = add_axes(figure, PATH_LEFT, PATH_BOTTOM, width, height)
    size = max(area.width, area.height)
    set_map_limits(axes, *area, tick_distance=size / TICKS)
    style_axes(axes)
    for (name, points), look in zip(lines.items(), (PLANNED, SENT, ODOMETRY)):
        kept = simplify(points, size * GRAIN, MAX_POINTS)
        thin = THIN if name == 'odometry' and len(kept) > MANY else {}
        axes.plot([x for x, _ in kept], [y for _, y in kept], **{**look, **thin}, label=name,
                  gid=name)
    _draw_robots(axes, footprint, end, size * TICK)
    _draw_legend(figure, PATH_LEFT)


def _draw_legend(figure: Figure, left: float, *artists: Any) -> None:
    figure.legend(
        *artists, loc='lower left', ncol=3, frameon=False, borderpad=0.2, borderaxespad=0.0,
        bbox_to_anchor=(left / WIDTH, LEGEND / figure.get_figheight()), handlelength=2.6,
        columnspacing=1.8)


def _path_lines(path: AlignedDrive) -> dict[str, list[Point]]:
    planned = [(ORIGIN.x, ORIGIN.y)]
    for start in path.motion_starts:
        planned.append((start.pose.x, start.pose.y))
        for segment in arc_segments(start.motion.plan):
            planned += replace(segment, start=compose(start.pose, segment.start)).points()
    lines = {'planned': planned}
    if path.sent:
        poses = (*_sent_poses(path), path.dead_reckoning.end)
        lines['sent'] = [(pose.x, pose.y) for pose in poses]
    if path.odometry:
        lines['odometry'] = [(sample.pose.x, sample.pose.y) for sample in path.odometry]
    return lines


def _sent_poses(path: AlignedDrive) -> Iterator[Pose]:
    """Return the poses along what was sent, close enough to each other to show arcs."""
    reckoning = path.dead_reckoning
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


def _extent(points: Sequence[Point]) -> Area:
    finite = [point for point in points if math.isfinite(point[0] + point[1])]
    xs, ys = [x for x, _ in finite], [y for _, y in finite]
    free = 1.0 + 2.0 * MARGIN
    width = max((max(xs) - min(xs)) * free, SMALLEST)
    height = max((max(ys) - min(ys)) * free, SMALLEST)
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


def draw_drive_velocities(figure: Figure, path: AlignedDrive, limits: Limits) -> None:
    """
    Draw both components of the velocity over time, with limits dashed.

    :param figure: the figure, empty; its size is set
    :param path: the drive
    :param limits: the limits to draw
    """
    rows = _rows(figure, KEY)
    duration = time_span(path)
    for axes, component in zip(rows, (LINEAR, ANGULAR)):
        lines = _velocity_lines(path, component)
        values = [value for points in lines.values() for _, value in points]
        scale = scale_for(component, values or [0.0], [limits], duration)
        _style_row(axes, path, scale, component.label)
        for (name, points), look in zip(lines.items(), (PLANNED, SENT, ODOMETRY)):
            _draw_line(axes, path, points, {**look, 'label': name, 'gid': name})
        draw_limits(axes, component, limits)
    _label_time(rows, duration)
    _draw_legend(figure, LEFT, *rows[0].get_legend_handles_labels())


def draw_drive_errors(figure: Figure, path: AlignedDrive) -> None:
    """
    Draw how far odometry was from where the messages should have brought the robot.

    :param figure: the figure, empty; its size is set
    :param path: the drive, with odometry
    """
    rows = _rows(figure, 0.0)
    duration = time_span(path)
    parts: tuple[tuple[str, str, Callable[[OdometrySample], float], dict[str, Any]], ...] = (
        ('distance [mm]', 'distance', lambda sample: 1e3 * sample.distance, {'color': BLUE}),
        ('heading [°]', 'heading', lambda sample: math.degrees(sample.angle),
         {'color': ORANGE, 'linestyle': '-'}))
    for axes, (label, name, value_of, look) in zip(rows, parts):
        points = [(sample.time, value_of(sample)) for sample in path.odometry]
        values = [0.0, *(value for _, value in points)]
        span = max(max(values) - min(values), 1e-3)
        lowest = min(values) - 0.08 * span * (min(values) < 0.0)
        _style_row(axes, path, Scale(lowest, max(values) + 0.08 * span, duration), label)
        _draw_line(axes, path, points, {**look, 'linewidth': 1.4, 'gid': name})
    _label_time(rows, duration)


def _velocity_lines(
        path: AlignedDrive, component: VelocityComponent) -> dict[str, list[StepPoint]]:
    value_of = attrgetter(component.attribute)
    planned: list[StepPoint] = []
    for start in path.motion_starts:
        if start.time is not None or not path.sent:
            offset = start.time or (planned[-1][0] if planned else 0.0)
            planned += [(offset + time, value) for time, value in velocity_steps(
                start.motion.plan, component.attribute)]
    lines = {'planned': planned}
    if path.sent:
        lines['sent'] = [(message.time - path.start_time, value_of(message.velocity))
                         for message in path.sent]
    if path.odometry:
        lines['odometry'] = [(sample.time, value_of(sample.received.velocity))
                             for sample in path.odometry]
    return lines


def _rows(figure: Figure, key: float) -> tuple[Axes, Axes]:
    """Set the size of a figure, and add two axes, one above the other and a legend's room."""
    bottom = BOTTOM + key
    figure.set_size_inches(WIDTH, bottom + 2.0 * ROW + GAP + TOP)
    above = add_axes(figure, LEFT, bottom + ROW + GAP, WIDTH - LEFT - RIGHT, ROW)
    return above, add_axes(figure, LEFT, bottom, WIDTH - LEFT - RIGHT, ROW)


def _style_row(axes: Axes, path: AlignedDrive, scale: Scale, label: str) -> None:
    style_axes(axes, WIDTH - LEFT - RIGHT)
    set_time_limits(axes, scale, label, [
        start.time + step.end for start in path.motion_starts if start.time is not None
        for step in start.motion.plan.steps])


def _label_time(rows: tuple[Axes, Axes], duration: float) -> None:
    rows[0].tick_params(labelbottom=False)
    rows[1].set_xlabel(f'time since t = 0 [{time_unit(duration)[0]}]')


def is_dense(path: AlignedDrive) -> bool:
    """Return whether bands are drawn, for lines of so many points would be a wall of colour."""
    return max(len(path.sent), len(path.odometry)) > MAX_LINE_POINTS


def time_span(path: AlignedDrive) -> float:
    """Return the length of the time axis [s]."""
    return max(path.duration, path.odometry[-1].time if path.odometry else 0.0) or 1.0


def _draw_line(
        axes: Axes, path: AlignedDrive, points: Sequence[StepPoint], look: dict[str, Any]) -> None:
    duration = time_span(path)
    if is_dense(path):
        _draw_band(axes, points, duration, look)
        return
    unit = time_unit(duration)[1]
    # What is sent is held until the next; what is seen changes from one sample to the next.
    axes.plot([time / unit for time, _ in points], [value for _, value in points],
              drawstyle='steps-post' if look['gid'] in HELD else 'default', **look)


def _draw_band(
        axes: Axes, points: Sequence[StepPoint], duration: float, look: dict[str, Any]) -> None:
    unit = time_unit(duration)[1]
    bands = min_max_decimate(points, duration, BANDS)
    times = [(band.begin + 0.5 * duration / BANDS) / unit for band in bands]
    lows, highs = [band.lowest for band in bands], [band.highest for band in bands]
    if look['gid'] == 'planned':
        axes.fill_between(times, lows, highs, color=look['color'], alpha=0.35, linewidth=0.0,
                          label=look['label'], gid=look['gid'])
        return
    axes.plot(times, highs, **look)
    axes.plot(times, lows, **{**look, 'label': None})
    if look['gid'] not in HELD and look['gid'] != 'odometry':
        axes.fill_between(times, lows, highs, color=look['color'], alpha=0.3, linewidth=0.0)


def draw_periods(figure: Figure, interval_errors: Sequence[float]) -> None:
    """
    Draw a histogram of how much longer than due the intervals between messages were.

    :param figure: the figure, empty; its size is set
    :param interval_errors: the differences [s]
    """
    figure.set_size_inches(WIDTH, PERIOD_HEIGHT)
    width = WIDTH - LEFT - RIGHT
    axes = add_axes(figure, LEFT, BOTTOM, width, PERIOD_HEIGHT - TOP - BOTTOM)
    style_axes(axes, width)
    reach, counts = histogram([1e3 * error for error in interval_errors])
    bar = 2.0 * reach / len(counts)
    lefts = [-reach + number * bar for number in range(len(counts))]
    # A bar of one must be visible beside one of thousands.
    axes.bar(lefts, counts, bar, align='edge', color=BLUE, edgecolor='white', linewidth=0.4,
             gid='periods')
    axes.set_yscale('log')
    axes.set(xlim=(-reach, reach), ylim=(0.6, 2.0 * max(10, *counts)),
             xlabel='interval, longer than due by [ms]', ylabel='intervals')
    axes.yaxis.set_major_formatter('{x:.0f}')
    axes.minorticks_off()
    axes.axvline(0.0, color=GREY, linewidth=1.0, linestyle='--')


def histogram(values: Sequence[float]) -> tuple[float, list[int]]:
    """
    Count values in bars of equal width, with zero in the middle of one.

    :param values: the values [ms]
    :returns: how far the bars reach on either side [ms], and the counts from left to right
    """
    finite = [value for value in values if math.isfinite(value)]
    largest = max((abs(value) for value in finite), default=0.0)
    bars = 2 * BARS + 1
    width = round_step(max(largest, LEAST) / (BARS + 0.5))
    counts = [0] * bars
    for value in finite:
        counts[min(bars - 1, max(0, math.floor(value / width + BARS + 0.5)))] += 1
    side = next((number for number in range(bars) if counts[number] or counts[-1 - number]), BARS)
    side = min(side, BARS - 5)
    return width * (BARS + 0.5 - side), counts[side:bars - side]
