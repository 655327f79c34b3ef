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
The common parts of all plots: colours, axes, scales, and velocities over time.

Tested by test/report/test_plan_plot.py.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import io
from itertools import groupby
import math
from operator import attrgetter
from typing import Any, NamedTuple, TYPE_CHECKING
import warnings

from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.units import format_number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: A time [s] and a value that is valid from this time until the next one.
StepPoint = tuple[float, float]


def velocity_steps(plan: Plan, attribute: str) -> list[StepPoint]:
    """
    Return the times at which a component of the planned velocity changes, and its new values.

    :returns: pairs of a time [s] and a new value [m/s or rad/s], in order; the last pair is the
        end of the plan and the value 0
    """
    value_of = attrgetter(attribute)
    changes = groupby(plan.segments, key=lambda segment: value_of(segment.velocity))
    points = [(next(segments).start, value + 0.0) for value, segments in changes]
    return [*points, (plan.duration, 0.0)]


class Band(NamedTuple):
    """
    The lowest and the highest value of a plotted line in one time interval.

    A line with very many points is drawn as a row of such bands.

    :param begin: the start of the interval [s]
    """

    begin: float
    lowest: float
    highest: float


def min_max_decimate(points: Sequence[StepPoint], end: float, count: int) -> list[Band]:
    """
    Return the lowest and the highest value of a line in each of several time intervals.

    All intervals have the same length.  The first one starts at 0.

    :param points: the line as pairs of a time [s] and a value, in order of time; each value is
        valid until the time of the next pair
    :param end: the end of the last interval [s]
    :returns: a band for each interval; intervals before the first point and after the last point
        have none
    """
    bands = []
    held: list[float] = []
    first = 0
    for number in range(count):
        last = bisect_left(points, (end * (number + 1) / count,), first)
        values = held + [value for _, value in points[first:last]]
        if first >= len(points):
            break
        if values:
            bands.append(Band(end * number / count, min(values), max(values)))
            held = values[-1:]
        first = last
    return bands


class Colour:
    """
    The colours of all plots.

    Most of them are from the palette of Okabe and Ito, which colour-blind people can distinguish.
    """

    BLUE, ORANGE, GREEN = '#0072B2', '#D55E00', '#009E73'
    SKY, PURPLE = '#56B4E9', '#CC79A7'
    GREY, FAINT = '#666666', '#dddddd'


#: The styles of three lines that often overlap; they differ in width, colour and dashes.
LOOKS: dict[str, dict[str, Any]] = {
    'planned': {'color': Colour.SKY, 'linewidth': 5.0, 'alpha': 0.6, 'zorder': 3.0,
                'solid_capstyle': 'round'},
    'sent': {'color': '#003f63', 'linewidth': 1.5, 'zorder': 3.5},
    'odometry': {'color': Colour.ORANGE, 'linewidth': 1.5, 'linestyle': (0, (3, 1.6)),
                 'zorder': 4.0},
}

#: Settings on top of matplotlib's default style.  Lines are simplified with a tolerance of
#: 0.3 pixels.  The minus sign is the ASCII hyphen, as in the tables.
SETTINGS: Any = {
    'font.size': 9.0, 'svg.hashsalt': 'kachaka_simple_control', 'path.simplify': True,
    'path.simplify_threshold': 0.3, 'axes.unicode_minus': False}
#: The distance between an axis and its label [inch]: numbers of six characters fit between them.
LABEL = 0.56


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float,
             aligns_label: bool = True) -> Axes:
    """
    Add axes with a grid to a figure.

    The frame around the axes has only its left and its lower line.

    :param figure: the figure; its size must be set before
    :param left: the distance from the left edge of the figure [inch]
    :param bottom: the distance from the lower edge of the figure [inch]
    :param width: the width of the axes [inch]
    :param height: the height of the axes [inch]
    :param aligns_label: whether the label of the y axis has a fixed distance from the axis, so
        that the labels of several plots are aligned; if False, matplotlib chooses the distance
    :returns: the axes
    """
    total_width, total_height = figure.get_size_inches()
    axes = figure.add_axes((
        left / total_width, bottom / total_height, width / total_width, height / total_height))
    if aligns_label:
        axes.yaxis.set_label_coords(-LABEL / width, 0.5)
    axes.grid(visible=True, color=Colour.FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)
    return axes


def draw_line(axes: Axes, points: Sequence[tuple[float, float]], **look: Any) -> None:
    """
    Draw a line through points.

    :param look: the style of the line, such as its colour, as for ``Axes.plot`` of matplotlib
    """
    axes.plot([x for x, _ in points], [y for _, y in points], **look)


def round_step(size: float) -> float:
    """
    Round the distance between two ticks of an axis up to 1, 2 or 5 times a power of ten.

    For example, 0.3 is rounded up to 0.5.

    :param size: the smallest allowed tick distance, above 0
    """
    from matplotlib.ticker import MaxNLocator

    # A map needs the same tick distance on the x axis and on the y axis.  It is computed here,
    # because matplotlib would choose a distance for each axis separately.
    # The size is reduced slightly, because a rounding error may have made it too large.
    locator = MaxNLocator(1, steps=(1, 2, 5, 10), min_n_ticks=1)
    first, second, *_ = locator.tick_values(0.0, size * (1.0 - 1e-9))
    return float(second - first)


@contextmanager
def default_style(svg_fonttype: str = 'path') -> Iterator[None]:
    """
    Use the default style of matplotlib in a ``with`` block, and ignore the user's own settings.

    :raises UsageError: if matplotlib is missing
    """
    try:
        from matplotlib import style as styles
    except ModuleNotFoundError as error:
        if error.name != 'matplotlib':
            raise
        raise UsageError(
            'a plot needs matplotlib: pip install matplotlib, or sudo apt install '
            'python3-matplotlib') from None
    settings = {**SETTINGS, 'svg.fonttype': svg_fonttype}
    with styles.context(['default', settings]), warnings.catch_warnings():
        # A character that the font lacks is drawn as a box; tables show the full name.
        warnings.filterwarnings('ignore', message='Glyph')
        yield


def draw_figure(draw: Callable[[Figure], None], resolution: float | None = None) -> Figure:
    """
    Create a figure in the default style of matplotlib, and draw on it.

    The figure has an Agg canvas, so that the drawing function can measure the size of text.

    :param draw: a function that draws on the empty figure, and sets its size
    :param resolution: the resolution [pixels per inch]; None for the default of matplotlib
    :raises UsageError: if matplotlib is missing
    """
    with default_style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(dpi=resolution)
        FigureCanvasAgg(figure)
        draw(figure)
    return figure


#: The metadata that each file format leaves out, so that two drives give the same bytes.
METADATA = {'.png': ('Software',), '.svg': ('Date', 'Creator'),
            '.pdf': ('CreationDate', 'Creator', 'Producer')}


def file_of(figure: Figure, suffix: str, resolution: float | None = None,
            svg_fonttype: str = 'path') -> bytes:
    """
    Convert a figure to the content of an image file.

    :param resolution: the resolution of a PNG file [pixels per inch]; None for the resolution of
        the figure
    """
    data = io.BytesIO()
    with default_style(svg_fonttype):
        figure.savefig(data, format=suffix[1:], dpi=resolution or 'figure',
                       metadata=dict.fromkeys(METADATA[suffix]))
    return data.getvalue()


#: The largest number of boundaries between steps to draw; more would merge into one area.
MAX_BOUNDARIES = 60
#: The largest ratio of a drawn limit to the sent velocities.  A larger limit would flatten the
#: curve, so it is only written as text.
MAX_LIMIT_RATIO = 5.0
#: The room for the labels of limits above and below the lines, as a part of the range of values.
LABEL_SHARE = 0.25
#: The style of the labels of limits, with a background that hides lines.
WORDS: dict[str, Any] = {
    'color': '#444444', 'zorder': 4.0, 'ha': 'right', 'textcoords': 'offset points',
    'bbox': {'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.5}}
#: A line with more points than this is translucent, so that the limits stay visible.
DENSE = 2000
#: The duration above which the time axis is in minutes [s].
MINUTES_FROM = 600.0


@dataclass(frozen=True)
class VelocityComponent:
    """How plots show one component of the velocity: the linear or the angular one."""

    attribute: str
    label: str
    unit: str
    colour: str
    limits: Callable[[Limits], tuple[float, float]]


LINEAR = VelocityComponent('linear_x', 'linear [m/s]', 'm/s', Colour.BLUE, lambda limits: (
    -limits.backward_velocity, limits.max_linear_velocity))
ANGULAR = VelocityComponent(
    'angular_z', 'angular [rad/s]', 'rad/s', Colour.ORANGE,
    lambda limits: (-limits.max_angular_velocity, limits.max_angular_velocity))


@dataclass(frozen=True)
class Scale:
    """
    The range of the values and the range of time that a plot over time shows.

    :param lowest: the lower end of the value axis, in the unit of the values
    :param highest: the upper end of the value axis, in the unit of the values
    :param duration: the end of the time axis [s]; the axis starts at 0
    """

    lowest: float
    highest: float
    duration: float


def scale_for(component: VelocityComponent, values: Sequence[float], limits: Sequence[Limits],
              duration: float) -> Scale:
    """
    Choose the range of values and the range of time for a plot of a velocity component.

    The range includes all values.  It includes a limit only if the limit is at most
    MAX_LIMIT_RATIO times the largest value, because a far limit would make the curve flat.
    """
    lowest, highest = min(values), max(values)
    largest = max(highest, -lowest)
    for below, above in map(component.limits, limits):
        far = MAX_LIMIT_RATIO * largest if largest else math.inf
        if lowest < 0.0 and -below <= far:
            lowest = min(lowest, below)
        if above <= far and (highest > 0.0 or not largest):
            highest = max(highest, above)
    # If there is neither a limit nor a velocity, the span may have any value.
    span = highest - lowest if 0.0 < highest - lowest < math.inf else 1.0
    highest = highest if math.isfinite(highest) else 1.0
    return Scale(lowest - span * (LABEL_SHARE if lowest < 0.0 else 0.06),
                 highest + LABEL_SHARE * span, duration or 1.0)


def time_unit(duration: float) -> tuple[str, float]:
    """
    Choose the unit of a time axis: minutes if the axis is longer than 600 s, otherwise seconds.

    :returns: the name of the unit, and the number of seconds in one unit
    """
    return ('min', 60.0) if duration > MINUTES_FROM else ('s', 1.0)


def draw_velocity(axes: Axes, view: PlanView, component: VelocityComponent, scale: Scale) -> None:
    """
    Draw one component of the planned velocity over time.

    The plot also shows the limits of the component, and the times at which steps of the motion
    end.
    """
    seconds = time_unit(scale.duration)[1]
    set_time_limits(axes, scale, component.label, [step.end for step in view.plan.steps])
    points = velocity_steps(view.plan, component.attribute)
    axes.step([0.0, *(time / seconds for time, _ in points)],
              [0.0, *(value for _, value in points)], where='post', color=component.colour,
              linewidth=1.2, alpha=1.0 if len(points) <= DENSE else 0.5, zorder=1.5, gid='sent')
    draw_limits(axes, component, view.limits)


def set_time_limits(axes: Axes, scale: Scale, label: str, ends: Sequence[float]) -> None:
    """
    Set the ranges of a plot over time, and draw lines at value zero and at the ends of steps.

    :param ends: the times at which steps of a motion end [s]; if there are more than 60, no lines
        are drawn at these times
    """
    unit = time_unit(scale.duration)[1]
    right = scale.duration / unit
    axes.set(xlim=(-0.01 * right, 1.01 * right), ylim=(scale.lowest, scale.highest), ylabel=label)
    axes.axhline(0.0, color=Colour.GREY, linewidth=0.6, zorder=1.0)
    if len(ends) <= MAX_BOUNDARIES:
        axes.vlines(
            [end / unit for end in ends], 0.0, 1.0, color=Colour.GREY, linewidth=0.5, alpha=0.5,
            transform=axes.get_xaxis_transform(), zorder=1.0, gid='boundaries')


def draw_limits(axes: Axes, component: VelocityComponent, limits: Limits) -> None:
    """
    Draw the limits of a velocity component as dashed lines, with their values as text.

    If no limit is inside the range of the plot, no line is drawn, and a text gives the upper limit
    if it is finite.

    :param axes: the axes of the plot; the range of values must be set before
    """
    bottom, top = axes.get_ylim()
    below, above = component.limits(limits)
    near = [(limit, side, offset) for limit, side, offset in (
        (above, 'bottom', 2.0), (below, 'top', -2.0)) if bottom < limit < top]
    for limit, side, offset in near:
        axes.axhline(
            limit, color=Colour.GREY, linewidth=1.0, linestyle='--', zorder=2.0, gid='limit')
        axes.annotate(
            f'limit {format_number(limit)} {component.unit}', (1.0, limit), (-4.0, offset),
            va=side, xycoords=axes.get_yaxis_transform(), **WORDS)
    if not near and math.isfinite(above):
        axes.annotate(
            f'far above: limit {format_number(above)} {component.unit}', (1.0, 1.0), (-4.0, 0.0),
            va='top', xycoords='axes fraction', **WORDS)
