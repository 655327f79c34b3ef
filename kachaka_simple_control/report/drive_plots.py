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
Plots of a drive.

The plots show the path, the velocities, the errors of odometry, and the time intervals between
velocity messages.  Another plot shows the result of a calibration.

Tested by test/report/test_report_files.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from operator import attrgetter
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.analysis.calibration_fit import CalibrationFit
from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.analysis.odometry_alignment import AlignedDrive, DeadReckoning
from kachaka_simple_control.analysis.summary import SpeedInterval, Summary
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.report.map_plot import draw_drive_path, draw_legend, TOP, WIDTH
from kachaka_simple_control.report.output_file import save_figure
from kachaka_simple_control.report.plot_style import (
    add_axes,
    ANGULAR,
    Colour,
    draw_figure,
    draw_limits,
    draw_line,
    file_of,
    LINEAR,
    LOOKS,
    min_max_decimate,
    round_step,
    Scale,
    scale_for,
    set_time_limits,
    StepPoint,
    time_unit,
    velocity_steps,
    VelocityComponent,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Sizes and positions [inch].
#: The margins of plots over time and of histograms.
LEFT, RIGHT, BOTTOM = 0.78, 0.14, 0.52
#: The height of a row of a plot over time, the gap between rows, and the room for a legend.
ROW, GAP, KEY = 1.2, 0.18, 0.28
PERIOD_HEIGHT = 2.0
#: If a line has more points than MAX_LINE_POINTS, all lines over time are drawn as bands.  A band
#: shows the lowest and the highest value in each of BANDS time intervals of equal length.
MAX_LINE_POINTS, BANDS = 6000, 180
#: The number of bars of a histogram on each side of the middle bar.
BARS = 25
#: The smallest range of a histogram on each side of zero [ms].
LEAST = 0.5
#: The style of the shaded areas that show when the robot was paused.
PAUSE: dict[str, Any] = {
    'color': '#9a8f7a', 'alpha': 0.22, 'linewidth': 0.0, 'zorder': 0.5, 'gid': 'pause'}
#: The resolution of a PNG file [pixels per inch].
RESOLUTION = 260
#: The names of the plots.
PATH, VELOCITIES, ERRORS, PERIODS = 'path', 'velocities', 'errors', 'periods'


@dataclass(frozen=True)
class DrivePlots:
    """
    The plots of a drive.

    :param svg: the plots as SVG elements for an HTML page; the key is the name of the plot
    :param png: the plot of the path as the content of a PNG file; empty if there is no such plot
    """

    svg: dict[str, str]
    png: bytes


def draw_drive_plots(summary: Summary) -> DrivePlots:
    """
    Draw the plots of a drive, and leave out each plot that has no data.

    For example, the plot of odometry errors is left out if no odometry was received.

    :returns: the plots as SVG elements, and the plot of the path also as a PNG file
    :raises UsageError: if matplotlib is missing
    """
    figures = {name: draw_figure(draw) for name, draw in _plots(summary).items()}
    # Text in the SVG stays text, so that a reader can search and copy it.
    return DrivePlots(
        {name: embed_svg(file_of(figure, '.svg', svg_fonttype='none').decode(), name)
         for name, figure in figures.items()},
        file_of(figures[PATH], '.png', RESOLUTION) if PATH in figures else b'')


def _plots(summary: Summary) -> dict[str, Callable[[Figure], None]]:
    log, aligned = summary.log, summary.aligned
    if not log.motions:
        return {}
    session = log.session_started
    limits = common_limits(log)
    footprint = None if session is None else session.footprint
    plots: dict[str, Callable[[Figure], None]] = {
        PATH: lambda figure: draw_drive_path(
            figure, aligned, footprint, summary.holds, None if session is None else session.floor),
        VELOCITIES: lambda figure: draw_drive_velocities(
            figure, aligned, limits, [part for part in summary.speed if part.is_pause])}
    if aligned.odometry:
        plots[ERRORS] = lambda figure: draw_drive_errors(figure, aligned)
    if summary.timing.interval_errors:
        plots[PERIODS] = lambda figure: draw_periods(figure, summary.timing.interval_errors)
    return plots


def common_limits(log: DriveLog) -> Limits:
    """
    Return the velocity and acceleration limits with which the motions of a drive were planned.

    If the motions were planned with different limits, return the limits of the robot.

    :param log: the record of the drive, with at least one planned motion
    """
    first, *others = [motion.planned.limits for motion in log.motions]
    session = log.session_started
    return first if session is None or all(limits == first for limits in others) else (
        session.limits)


def embed_svg(svg: str, name: str) -> str:
    """
    Convert an SVG file from matplotlib to an SVG element inside an HTML page.

    The element fills the available width.  It has no XML namespaces, no metadata and no style
    sheet.  Its colours are CSS variables, so that the page can change them.
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
    # The style sheet of the page may replace each colour on a dark background.
    svg = re.sub(r'(: )#([0-9a-f]{6})\b', r'\1var(--plot-\2, #\2)', svg)
    return re.sub(r'\n+\s*', '\n', svg)


def draw_drive_velocities(figure: Figure, aligned: AlignedDrive, limits: Limits,
                          pauses: Sequence[SpeedInterval] = ()) -> None:
    """
    Draw the linear and the angular velocity of a drive over time, in two plots.

    The lines show the planned velocity, the sent velocity and the velocity from odometry.  Dashed
    lines show the limits, and shaded areas show pauses.

    :param figure: an empty figure; the function sets its size
    :param pauses: the time intervals in which the robot was paused
    """
    rows = _rows(figure, BOTTOM + KEY)
    duration = aligned.time_span
    for axes, component in zip(rows, (LINEAR, ANGULAR)):
        lines = _velocity_lines(aligned, component)
        values = [value for points in lines.values() for _, value in points]
        scale = scale_for(component, values or [0.0], [limits], duration)
        _set_time(axes, aligned, scale, component.label)
        for name, points in lines.items():
            _draw_line(axes, aligned, points, {**LOOKS[name], 'label': name, 'gid': name})
        draw_limits(axes, component, limits)
        unit = time_unit(duration)[1]
        for pause in pauses:
            axes.axvspan((pause.begin - aligned.start_time) / unit,
                         (pause.end - aligned.start_time) / unit, **PAUSE)
    rows[1].set_xlabel(f'time since t = 0 [{time_unit(duration)[0]}]')
    draw_legend(figure, LEFT, 3, *rows[0].get_legend_handles_labels())


def draw_drive_errors(figure: Figure, aligned: AlignedDrive) -> None:
    """
    Draw the position error and the heading error of odometry over time, in two plots.

    The error is the difference between the pose from odometry and the pose that is expected from
    the sent velocities.

    :param figure: an empty figure; the function sets its size
    :param aligned: the sent velocities and the odometry of the drive; odometry must not be empty
    """
    rows = _rows(figure, BOTTOM)
    duration = aligned.time_span
    parts = (
        ('distance', 'mm', Colour.BLUE, [1e3 * sample.distance for sample in aligned.odometry]),
        ('heading', '°', Colour.ORANGE, [math.degrees(one.angle) for one in aligned.odometry]))
    for axes, (name, unit, colour, errors) in zip(rows, parts):
        points = [(sample.time, error) for sample, error in zip(aligned.odometry, errors)]
        values = [0.0, *errors]
        span = max(max(values) - min(values), 1e-3)
        lowest = min(values) - 0.08 * span * (min(values) < 0.0)
        scale = Scale(lowest, max(values) + 0.08 * span, duration)
        _set_time(axes, aligned, scale, f'{name} [{unit}]')
        _draw_line(axes, aligned, points, {'color': colour, 'linewidth': 1.4, 'gid': name})
    rows[1].set_xlabel(f'time since t = 0 [{time_unit(duration)[0]}]')


def _velocity_lines(
        aligned: AlignedDrive, component: VelocityComponent) -> dict[str, list[StepPoint]]:
    value_of = attrgetter(component.attribute)
    planned: list[StepPoint] = []
    for start in aligned.motion_starts:
        if start.time is not None or not aligned.sent:
            offset = 0.0 if start.time is not None or not planned else planned[-1][0]
            times, values = zip(*velocity_steps(start.motion.plan, component.attribute))
            planned += [(offset + time, value) for time, value in zip(
                aligned.planned_times(start, times), values)]
    lines = {'planned': planned}
    if aligned.sent:
        lines['sent'] = [(message.time - aligned.start_time, value_of(message.velocity))
                         for message in aligned.sent]
    if aligned.odometry:
        lines['odometry'] = [(sample.time, value_of(sample.received.velocity))
                             for sample in aligned.odometry]
    return lines


def _rows(figure: Figure, bottom: float, width: float = WIDTH, row: float = ROW,
          gap: float = GAP) -> tuple[Axes, Axes]:
    """
    Set the size of a figure, and add the axes of two plots over time, one above the other.

    :returns: the axes of the upper plot and of the lower plot
    """
    figure.set_size_inches(width, bottom + 2.0 * row + gap + TOP)
    above, below = (add_axes(figure, LEFT, edge, width - LEFT - RIGHT, row)
                    for edge in (bottom + row + gap, bottom))
    above.tick_params(labelbottom=False)
    return above, below


def _set_time(axes: Axes, aligned: AlignedDrive, scale: Scale, label: str) -> None:
    set_time_limits(axes, scale, label, [
        time for start in aligned.motion_starts if start.time is not None
        for time in aligned.planned_times(start, [step.end for step in start.motion.plan.steps])])


def is_dense(aligned: AlignedDrive) -> bool:
    """
    Return whether a drive has too many messages or odometry samples to draw each one in a plot.

    The limit is MAX_LINE_POINTS.  With more points, a plot over time shows bands instead of lines.
    A band shows the lowest and the highest value in each of many short time intervals.
    """
    return max(len(aligned.sent), len(aligned.odometry)) > MAX_LINE_POINTS


def _draw_line(axes: Axes, aligned: AlignedDrive, points: Sequence[StepPoint],
               look: dict[str, Any]) -> None:
    duration, name = aligned.time_span, look['gid']
    unit = time_unit(duration)[1]
    if not is_dense(aligned):
        # A sent velocity is valid until the next message; odometry is interpolated.
        draw_line(axes, [(time / unit, value) for time, value in points],
                  drawstyle='steps-post' if name in {'planned', 'sent'} else 'default', **look)
        return
    bands = min_max_decimate(points, duration, BANDS)
    times = [(band.begin + 0.5 * duration / BANDS) / unit for band in bands]
    lows, highs = [band.lowest for band in bands], [band.highest for band in bands]
    if name == 'planned':
        axes.fill_between(times, lows, highs, color=look['color'], alpha=0.35, linewidth=0.0,
                          label=look['label'], gid=name)
        return
    axes.plot(times, highs, **look)
    axes.plot(times, lows, **{**look, 'label': None})
    if name not in {'sent', 'odometry'}:
        axes.fill_between(times, lows, highs, color=look['color'], alpha=0.3, linewidth=0.0)


def draw_periods(figure: Figure, interval_errors: Sequence[float]) -> None:
    """
    Draw a histogram of the errors of the time intervals between velocity messages.

    :param figure: an empty figure; the function sets its size
    :param interval_errors: for each interval, its measured length minus its planned length [s]
    """
    figure.set_size_inches(WIDTH, PERIOD_HEIGHT)
    axes = add_axes(figure, LEFT, BOTTOM, WIDTH - LEFT - RIGHT, PERIOD_HEIGHT - TOP - BOTTOM)
    reach, counts = histogram([1e3 * error for error in interval_errors])
    bar = 2.0 * reach / len(counts)
    lefts = [-reach + number * bar for number in range(len(counts))]
    # The log scale keeps a count of one visible beside a count of thousands.
    axes.bar(lefts, counts, bar, align='edge', color=Colour.BLUE, edgecolor='white',
             linewidth=0.4, gid='periods')
    axes.set_yscale('log')
    axes.set(xlim=(-reach, reach), ylim=(0.6, 2.0 * max(10, *counts)),
             xlabel='interval, longer than due by [ms]', ylabel='intervals')
    axes.yaxis.set_major_formatter('{x:.0f}')
    axes.minorticks_off()
    axes.axvline(0.0, color=Colour.GREY, linewidth=1.0, linestyle='--')


def histogram(values: Sequence[float]) -> tuple[float, list[int]]:
    """
    Count how many values belong to each bar of a histogram.

    All bars have the same width, and the middle bar has its centre at zero.  Empty bars at the
    left and the right end are removed in pairs, so that the middle bar stays in the middle.  At
    least 11 bars are kept.  Values that are infinite or NaN are not counted.

    :param values: the values [ms]
    :returns: the distance from zero to each end of the histogram [ms], and the count of each bar
        from left to right
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


def save_calibration_plot(log: DriveLog, fit: CalibrationFit, path: Path) -> None:
    """
    Save a plot that shows how well a calibration fits the drive from which it was computed.

    The plot shows the x coordinate and the heading over time.  Each has three lines: expected from
    the sent velocities, expected from the fitted calibration, and reported by odometry.  If the
    fit is good, the line of odometry lies on the line of the fitted calibration.

    :param path: the path of the image file, as checked by ``check_plot_file``
    :raises UsageError: if matplotlib is missing, or the file cannot be written
    """
    save_figure(draw_figure(lambda figure: _draw_calibration(figure, log, fit)), path)


def _draw_calibration(figure: Figure, log: DriveLog, fit: CalibrationFit) -> None:
    width = 7.5
    drive, calibration = AlignedDrive(log), fit.calibration('', '')
    # The lag is drawn as a dead time of the same length, which has the same average delay.
    fitted = DeadReckoning([
        replace(message, time=message.time + fit.delay.value,
                velocity=calibration.response(message.velocity))
        for message in drive.sent], log.command_timeout)
    times = [sample.time for sample in drive.odometry]
    poses = {
        'sent': [drive.dead_reckoning.at(sample.received.time) for sample in drive.odometry],
        'fit': [fitted.at(sample.received.time) for sample in drive.odometry],
        'odometry': [sample.pose for sample in drive.odometry]}
    above, below = _rows(figure, 0.85, width, row=1.9, gap=0.2)
    above.set(ylabel='x [m]', xlim=(0.0, times[-1]))
    below.set(ylabel='heading [°]', xlim=(0.0, times[-1]), xlabel='time [s]')
    for name, line in poses.items():
        look = LOOKS['planned' if name == 'fit' else name]
        above.plot(times, [pose.x for pose in line], **look, gid=name)
        below.plot(times, [math.degrees(pose.theta) for pose in line], **look, label=name,
                   gid=name)
    figure.legend(*below.get_legend_handles_labels(), loc='lower left', ncol=3, frameon=False,
                  bbox_to_anchor=(LEFT / width, 0.0))
