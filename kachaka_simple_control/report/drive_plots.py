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
"""Plots of a drive: path, velocities over time, periods."""

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
from kachaka_simple_control.report.odometry_alignment import (
    AlignedDrive,
    MotionStart,
    OdometrySample,
)
from kachaka_simple_control.report.paths import arc_segments, ArcSegment
from kachaka_simple_control.report.plan_plot import GRAIN, MARGIN, SMALLEST, TICK
from kachaka_simple_control.report.plot_style import (
    BLUE,
    default_style,
    FAINT,
    GREEN,
    GREY,
    ODOMETRY,
    ORANGE,
    PLANNED,
    round_step,
    SENT,
    style_axes,
)
from kachaka_simple_control.report.simplification import min_max_decimate, simplify
from kachaka_simple_control.report.summary import Summary
from kachaka_simple_control.report.velocity_plot import (
    ANGULAR,
    draw_limits,
    LINEAR,
    LONG,
    MAX_BOUNDARIES,
    Scale,
    scale_for,
    StepPoint,
    velocity_steps,
    VelocityComponent,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Sizes and places [inch].
PATH_WIDTH = 5.4
PATH_LEFT, PATH_RIGHT, PATH_TOP, PATH_BOTTOM = 0.72, 0.12, 0.1, 0.98
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
MAX_POINTS = 5000
#: From so many points on, dashes on dashes would be a wall; lines are thin and solid.
MANY = 1000
THIN: dict[str, Any] = {'linewidth': 0.6, 'linestyle': '-'}


def draw_drive_path(figure: Figure, path: AlignedDrive, footprint: Footprint | None) -> None:
    """
    Draw a drive's path in a picture of its own; sets the height of the picture.

    :param figure: the picture, empty
    :param path: the drive
    :param footprint: the robot's outline; None if nobody knows it
    """
    lines = _lines(path)
    end = path.odometry[-1].pose if path.odometry else (
        path.dead_reckoning.end if path.sent else path.planned_end)
    left, bottom, width, height = _extent(
        [*(point for points in lines.values() for point in points),
         *_corners(footprint, (ORIGIN, end))])
    inner = PATH_WIDTH - PATH_LEFT - PATH_RIGHT
    tall = inner * height / width
    whole = tall + PATH_TOP + PATH_BOTTOM
    figure.set_size_inches(PATH_WIDTH, whole)
    axes = figure.add_axes((
        PATH_LEFT / PATH_WIDTH, PATH_BOTTOM / whole, inner / PATH_WIDTH, tall / whole))
    _frame_path(axes, left, bottom, width, height)
    grain = max(width, height) * GRAIN
    for (name, points), look in zip(lines.items(), (PLANNED, SENT, ODOMETRY)):
        kept = simplify(points, grain, MAX_POINTS)
        thin = THIN if name == 'odometry' and len(kept) > MANY else {}
        axes.plot([x for x, _ in kept], [y for _, y in kept], **{**look, **thin}, label=name,
                  gid=name)
    _draw_robots(axes, footprint, end, max(width, height) * TICK)
    figure.legend(
        loc='lower left', bbox_to_anchor=(PATH_LEFT / PATH_WIDTH, 0.02 / whole), ncol=3,
        frameon=False,
        borderpad=0.2, borderaxespad=0.0, handlelength=2.6, columnspacing=1.8)


def _lines(path: AlignedDrive) -> dict[str, list[Point]]:
    planned = [(ORIGIN.x, ORIGIN.y)]
    for start in path.motion_starts:
        planned.append((start.pose.x, start.pose.y))
        for part in _moved(start):
            planned += part.points()
    lines = {'planned': planned}
    if path.sent:
        lines['sent'] = [(pose.x, pose.y) for pose in (*_flat(path), path.dead_reckoning.end)]
    if path.odometry:
        lines['odometry'] = [(seen.pose.x, seen.pose.y) for seen in path.odometry]
    return lines


def _flat(path: AlignedDrive) -> Iterator[Pose]:
    """Return the poses along what was sent, close enough to each other to show arcs."""
    reckoning = path.dead_reckoning
    for (begin, end), (one, two) in zip(pairwise(reckoning.times), pairwise(reckoning.poses)):
        yield one
        count = math.ceil(abs(two.theta - one.theta) / 0.1)
        if one.x == two.x and one.y == two.y:
            continue
        for part in range(1, min(count, 100)):
            yield reckoning.at(begin + (end - begin) * part / count)
    yield from reckoning.poses[-1:]


def _moved(start: MotionStart) -> list[ArcSegment]:
    return [replace(part, start=compose(start.pose, part.start))
            for part in arc_segments(start.motion.plan)]


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


def _frame_path(axes: Axes, left: float, bottom: float, width: float, height: float) -> None:
    from matplotlib.ticker import MultipleLocator

    axes.set(xlim=(left, left + width), ylim=(bottom, bottom + height), xlabel='x [m]',
             ylabel='y [m]')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(round_step(max(width, height) / MARKS)))
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
            front = front_point(footprint, ORIGIN)
            tip = front if front[0] > 0.0 else tip
        x, y = transform_point(tip, pose)
        axes.plot([pose.x, x], [pose.y, y], color=colour, linewidth=1.4, zorder=2.5)
        axes.plot(pose.x, pose.y, linestyle='', marker='o', markersize=4.0, color=colour,
                  markeredgecolor=GREY, markeredgewidth=0.0, zorder=5.0,
                  label=None if footprint is not None else name)


# Sizes and places [inch].
TIME_WIDTH = 5.4
TIME_LEFT, TIME_RIGHT = 0.78, 0.14
ROW, BETWEEN, TIME_TOP, TIME_BOTTOM = 1.45, 0.2, 0.1, 0.52
KEY = 0.28
#: Lines of what is held until the next message.
HELD = ('planned', 'sent')
#: With more corners than these a line is drawn as a band, in so many stretches of time.
CORNERS, STRETCHES = 6000, 180


def draw_drive_velocities(figure: Figure, path: AlignedDrive, limits: Sequence[Limits]) -> None:
    """
    Draw both components of the velocity over time, with limits dashed.

    :param figure: the picture, empty; its size is set
    :param path: the drive
    :param limits: what it was to keep to; the first is shown
    """
    above, below = _rows(figure, KEY)
    end = time_span(path)
    for axes, kind in ((above, LINEAR), (below, ANGULAR)):
        lines = _velocities(path, kind)
        values = [value for corners in lines.values() for _, value in corners]
        scale = scale_for(kind, values or [0.0], limits, end)
        _frame_time(axes, path, scale)
        for (name, corners), look in zip(lines.items(), (PLANNED, SENT, ODOMETRY)):
            draw = _draw_band if is_dense(path) else _draw_line
            draw(axes, corners, end, {**look, 'label': name, 'gid': name})
        if limits:
            draw_limits(axes, kind, limits[0])
    _finish(above, below, end)
    figure.legend(
        *above.get_legend_handles_labels(), loc='lower left', ncol=3, frameon=False,
        bbox_to_anchor=(TIME_LEFT / TIME_WIDTH, 0.02 / figure.get_figheight()), borderpad=0.2,
        borderaxespad=0.0, handlelength=2.6, columnspacing=1.8)


def draw_drive_errors(figure: Figure, path: AlignedDrive) -> None:
    """
    Draw how far odometry was from where the messages should have brought the robot.

    :param figure: the picture, empty; its size is set
    :param path: the drive, with odometry
    """
    above, below = _rows(figure, 0.0)
    end = time_span(path)
    parts: tuple[tuple[Axes, str, str, Callable[[OdometrySample], float], dict[str, Any]], ...] = (
        (above, 'distance [mm]', 'distance', lambda seen: 1e3 * seen.distance, {'color': BLUE}),
        (below, 'heading [°]', 'heading', lambda seen: math.degrees(seen.angle),
         {'color': ORANGE, 'linestyle': '-'}))
    for axes, label, name, value_of, look in parts:
        corners = [(seen.time, value_of(seen)) for seen in path.odometry]
        values = [0.0, *(value for _, value in corners)]
        span = max(max(values) - min(values), 1e-3)
        _frame_time(axes, path, Scale(
            LINEAR, min(values) - 0.08 * span * (min(values) < 0.0), max(values) + 0.08 * span,
            end))
        axes.set_ylabel(label)
        draw = _draw_band if is_dense(path) else _draw_line
        draw(axes, corners, end, {**look, 'linewidth': 1.4, 'gid': name})
    _finish(above, below, end)


def _velocities(path: AlignedDrive, kind: VelocityComponent) -> dict[str, list[StepPoint]]:
    value_of = attrgetter(kind.attribute)
    planned: list[StepPoint] = []
    for start in path.motion_starts:
        if start.time is not None or not path.sent:
            offset = start.time or (planned[-1][0] if planned else 0.0)
            planned += [(offset + time, value)
                        for time, value in velocity_steps(start.motion.plan, kind.attribute)]
    lines = {'planned': planned}
    if path.sent:
        lines['sent'] = [
            (sent.time - path.start_time, value_of(sent.velocity)) for sent in path.sent]
    if path.odometry:
        lines['odometry'] = [(seen.time, value_of(seen.received.velocity))
                             for seen in path.odometry]
    return lines


def _rows(figure: Figure, key: float) -> tuple[Axes, Axes]:
    height = TIME_TOP + 2.0 * ROW + BETWEEN + TIME_BOTTOM + key
    figure.set_size_inches(TIME_WIDTH, height)
    inner = TIME_WIDTH - TIME_LEFT - TIME_RIGHT
    above, below = (figure.add_axes((
        TIME_LEFT / TIME_WIDTH, bottom / height, inner / TIME_WIDTH, ROW / height))
        for bottom in (TIME_BOTTOM + key + ROW + BETWEEN, TIME_BOTTOM + key))
    return above, below


def _frame_time(axes: Axes, path: AlignedDrive, scale: Scale) -> None:
    unit = _unit(scale.duration)[1]
    right = scale.duration / unit
    style_axes(axes, TIME_WIDTH - TIME_LEFT - TIME_RIGHT)
    axes.set(xlim=(-0.01 * right, 1.01 * right), ylim=(scale.lowest, scale.highest),
             ylabel=scale.component.label)
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=1.0)
    ends = [((start.time or 0.0) + stage.end) / unit for start in path.motion_starts
            if start.time is not None for stage in start.motion.plan.steps]
    if len(ends) <= MAX_BOUNDARIES:
        axes.vlines(ends, 0.0, 1.0, transform=axes.get_xaxis_transform(), color=GREY,
                    linewidth=0.5, alpha=0.5, zorder=1.0, gid='boundaries')


def is_dense(path: AlignedDrive) -> bool:
    """
    Return whether so much was sent or seen that lines would be a wall of colour.

    :param path: the drive
    :returns: whether bands are drawn instead
    """
    return max(len(path.sent), len(path.odometry)) > CORNERS


def _draw_line(
        axes: Axes, corners: Sequence[StepPoint], end: float, look: dict[str, Any]) -> None:
    unit = _unit(end)[1]
    # What is told is held until the next; what is seen changes from one sample to the next.
    held = look['gid'] in HELD
    axes.plot([time / unit for time, _ in corners], [value for _, value in corners],
              drawstyle='steps-post' if held else 'default', **look)


def _draw_band(
        axes: Axes, corners: Sequence[StepPoint], end: float, look: dict[str, Any]) -> None:
    unit = _unit(end)[1]
    found = min_max_decimate(corners, end, STRETCHES)
    times = [(band.begin + 0.5 * end / STRETCHES) / unit for band in found]
    lows, highs = [band.lowest for band in found], [band.highest for band in found]
    if look['gid'] == 'planned':
        axes.fill_between(times, lows, highs, color=look['color'], alpha=0.35, linewidth=0.0,
                          label=look['label'], gid=look['gid'])
        return
    axes.plot(times, highs, **look)
    axes.plot(times, lows, **{**look, 'label': None})
    if look['gid'] not in HELD and look['gid'] != 'odometry':
        axes.fill_between(times, lows, highs, color=look['color'], alpha=0.3, linewidth=0.0)


def _finish(above: Axes, below: Axes, end: float) -> None:
    above.tick_params(labelbottom=False)
    below.set_xlabel(f'time since t = 0 [{_unit(end)[0]}]')


def _unit(end: float) -> tuple[str, float]:
    return ('min', 60.0) if end > LONG else ('s', 1.0)


def time_span(path: AlignedDrive) -> float:
    """
    Return how long the axis of time is.

    :param path: the drive
    :returns: its length [s]
    """
    return max(path.duration, path.odometry[-1].time if path.odometry else 0.0) or 1.0


# Sizes and places [inch].
PERIOD_WIDTH, PERIOD_HEIGHT = 5.4, 2.5
PERIOD_LEFT, PERIOD_RIGHT, PERIOD_TOP, PERIOD_BOTTOM = 0.78, 0.14, 0.1, 0.52
#: Bars on either side of the middle.
BARS = 25
#: The least that is shown on either side [ms].
LEAST = 0.5


def draw_periods(figure: Figure, uneven: Sequence[float]) -> None:
    """
    Draw a histogram of how much longer than due the intervals between messages were.

    :param figure: the picture, empty; its size is set
    :param uneven: the differences [s]
    """
    figure.set_size_inches(PERIOD_WIDTH, PERIOD_HEIGHT)
    inner = PERIOD_WIDTH - PERIOD_LEFT - PERIOD_RIGHT
    axes = figure.add_axes((
        PERIOD_LEFT / PERIOD_WIDTH, PERIOD_BOTTOM / PERIOD_HEIGHT, inner / PERIOD_WIDTH,
        (PERIOD_HEIGHT - PERIOD_TOP - PERIOD_BOTTOM) / PERIOD_HEIGHT))
    style_axes(axes, inner)
    reach, counts = histogram([1e3 * one for one in uneven])
    width = 2.0 * reach / len(counts)
    lefts = [-reach + number * width for number in range(len(counts))]
    # A bar of one must be seen beside one of thousands.
    axes.bar(lefts, counts, width, align='edge', color=BLUE, edgecolor='white', linewidth=0.4,
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
    known = [value for value in values if math.isfinite(value)]
    largest = max((abs(value) for value in known), default=0.0)
    bars = 2 * BARS + 1
    width = round_step(max(largest, LEAST) / (BARS + 0.5))
    counts = [0] * bars
    for value in known:
        counts[min(bars - 1, max(0, math.floor(value / width + BARS + 0.5)))] += 1
    side = next((number for number in range(bars) if counts[number] or counts[-1 - number]), BARS)
    side = min(side, BARS - 5)
    return width * (BARS + 0.5 - side), counts[side:bars - side]


#: Letters stay letters: they can be found, copied and read aloud.
SVG: Any = {'svg.fonttype': 'none'}
#: What a file says of itself is left out: the same drive gives the same bytes.
NOTHING = {'Date': None, 'Creator': None, 'Format': None, 'Type': None}
#: Pixels an inch of the PNG.
RESOLUTION = 200
#: Names of the pictures.
PATH, VELOCITIES, ERRORS, PERIODS = 'path', 'velocities', 'errors', 'periods'


@dataclass(frozen=True)
class DrivePlots:
    """
    The pictures that could be drawn.

    :param svg: the text of each by its name, ready to stand in a page
    :param png: the path
    """

    svg: dict[str, str]
    png: bytes


def draw_drive_plots(summary: Summary) -> DrivePlots:
    """
    Draw what there is to see of a drive.

    :param summary: the drive
    :returns: its pictures; what nobody sent or saw is not drawn
    :raises UsageError: if matplotlib is absent
    """
    with default_style(), warnings.catch_warnings():
        from matplotlib import rc_context
        # A letter that the font lacks becomes a box.
        warnings.filterwarnings('ignore', message='Glyph')
        drawn = {name: _figure(draw) for name, draw in _wanted(summary).items()}
        png = io.BytesIO()
        if PATH in drawn:
            drawn[PATH].savefig(png, format='png', dpi=RESOLUTION, metadata={'Software': None})
        with rc_context(SVG):
            return DrivePlots(
                {name: _svg(figure, name) for name, figure in drawn.items()}, png.getvalue())


def _wanted(summary: Summary) -> dict[str, Callable[[Figure], None]]:
    record, path = summary.log, summary.path
    if not record.motions:
        return {}
    opened = record.session_started
    limits = [motion.planned.limits for motion in record.motions] if opened is None else [
        opened.limits]
    footprint = None if opened is None else opened.footprint
    wanted: dict[str, Callable[[Figure], None]] = {
        PATH: lambda figure: draw_drive_path(figure, path, footprint),
        VELOCITIES: lambda figure: draw_drive_velocities(figure, path, limits[:1])}
    if path.odometry:
        wanted[ERRORS] = lambda figure: draw_drive_errors(figure, path)
    if summary.timing.interval_errors:
        wanted[PERIODS] = lambda figure: draw_periods(figure, summary.timing.interval_errors)
    return wanted


def _figure(draw: Callable[[Figure], None]) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure()
    FigureCanvasAgg(figure)
    draw(figure)
    return figure


def _svg(figure: Figure, name: str) -> str:
    data = io.BytesIO()
    figure.savefig(data, format='svg', metadata=NOTHING)
    return embed_svg(data.getvalue().decode(), name)


def embed_svg(svg: str, name: str) -> str:
    """
    Make an SVG file a part of a page.

    :param svg: the text of the file, from matplotlib
    :param name: put before each id that it refers to, so that pictures do not share any
    :returns: the element alone, as wide as there is room, without addresses and a style for all
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
