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
"""The style of all plots: colours, axes, round scales, velocities over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import math
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.time_series import velocity_steps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colours of Okabe and Ito, which the colour-blind can tell apart.
BLUE, ORANGE, GREEN = '#0072B2', '#D55E00', '#009E73'
SKY, PURPLE = '#56B4E9', '#CC79A7'
GREY, FAINT = '#666666', '#dddddd'

# Three lines that often coincide: told apart by width, colour and dashes alike.
PLANNED: dict[str, Any] = {
    'color': SKY, 'linewidth': 5.0, 'alpha': 0.6, 'zorder': 3.0, 'solid_capstyle': 'round'}
SENT: dict[str, Any] = {'color': '#003f63', 'linewidth': 1.5, 'zorder': 3.5}
ODOMETRY: dict[str, Any] = {
    'color': ORANGE, 'linewidth': 1.5, 'linestyle': (0, (3, 1.6)), 'zorder': 4.0}

#: Settings on top of matplotlib's default style, whatever the user's own settings are.
#: Lines lose points that lie less than 0.3 pixels beside them.  The minus is that of all tables.
SETTINGS: Any = {
    'font.size': 9.0, 'svg.hashsalt': 'kachaka_simple_control', 'path.simplify': True,
    'path.simplify_threshold': 0.3, 'axes.unicode_minus': False}
#: Distance of an axis's label from the axis [inch]: six characters fit between.
LABEL = 0.56


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Add axes at a place of a figure [inch], whose size is set."""
    total_width, total_height = figure.get_size_inches()
    return figure.add_axes((
        left / total_width, bottom / total_height, width / total_width, height / total_height))


def style_axes(axes: Axes, width: float | None = None) -> None:
    """
    Add a grid to axes and hide the sides of their frame that have no numbers.

    :param axes: the axes
    :param width: their width [inch], to align the y labels of all axes; None: as matplotlib does
    """
    if width is not None:
        axes.yaxis.set_label_coords(-LABEL / width, 0.5)
    axes.grid(visible=True, color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)


# Maps.
#: At most this many robots and arrows are drawn on a path.
MAX_MARKS = 16
#: This part of a map's size can hardly be seen.
MAP_GRAIN = 1.0 / 1500.0
#: This part of a map's size stays free on each side.
MAP_MARGIN = 0.07
#: The smallest map [m].
MIN_MAP_SIZE = 0.2
#: Steps whose middles are nearer than this part of a map's size share their numbers' place.
PLACE_SIZE = 0.01
#: The length of a heading without a footprint, as a part of the map's size.
HEADING_LENGTH = 0.06


def set_map_limits(
        axes: Axes, left: float, bottom: float, width: float, height: float,
        tick_distance: float) -> None:
    """
    Make axes a map in metres with a square grid.

    :param tick_distance: at least this far apart are the lines of the grid [m]
    """
    from matplotlib.ticker import MultipleLocator

    axes.set(xlim=(left, left + width), ylim=(bottom, bottom + height), xlabel='x [m]',
             ylabel='y [m]')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(round_step(tick_distance)))


def round_step(size: float) -> float:
    """
    Return the step of a scale: 1, 2 or 5 times a power of ten, not below a size above 0.

    Both axes of a map share one step, so matplotlib's locator is asked once for both.
    """
    from matplotlib.ticker import MaxNLocator

    # Slightly less, because rounding may have made the size too large.
    locator = MaxNLocator(1, steps=(1, 2, 5, 10), min_n_ticks=1)
    first, second, *_ = locator.tick_values(0.0, size * (1.0 - 1e-9))
    return float(second - first)


@contextmanager
def default_style() -> Iterator[None]:
    """
    Draw in matplotlib's default style, whatever the user's own settings are.

    :raises UsageError: if matplotlib is missing
    """
    try:
        from matplotlib import rc_context
        from matplotlib import style as styles
    except ModuleNotFoundError as error:
        if error.name != 'matplotlib':
            raise
        raise UsageError(
            'a plot needs matplotlib: pip install matplotlib, or sudo apt install '
            'python3-matplotlib') from None
    with styles.context('default'), rc_context(SETTINGS):
        yield


#: More boundaries between steps than these would merge into one area.
MAX_BOUNDARIES = 60
#: A limit further above the sent velocities than this factor would flatten the curve: it is named,
#: not drawn.
MAX_LIMIT_RATIO = 5.0
#: Free part of the span above the highest and below the lowest line, for the labels of limits.
LABEL_SHARE = 0.25
#: The labels of limits; no line goes through them.
WORDS: dict[str, Any] = {
    'color': '#444444', 'zorder': 4.0, 'ha': 'right',
    'textcoords': 'offset points',
    'bbox': {'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.5}}
#: A line with more points than these is an area, which is translucent: the limits can be seen.
DENSE = 2000
#: Above this [s], time is in minutes.
MINUTES_FROM = 600.0


@dataclass(frozen=True)
class VelocityComponent:
    """
    One of the two components of a velocity.

    :param attribute: its name in a velocity
    :param label: the label of its axis
    :param unit: its unit
    :param colour: the colour of its line
    :param limits: returns its lowest and its highest value under limits
    """

    attribute: str
    label: str
    unit: str
    colour: str
    limits: Callable[[Limits], tuple[float, float]]


LINEAR = VelocityComponent('linear_x', 'linear [m/s]', 'm/s', BLUE, lambda limits: (
    -limits.backward_velocity, limits.max_linear_velocity))
ANGULAR = VelocityComponent('angular_z', 'angular [rad/s]', 'rad/s', ORANGE, lambda limits: (
    -limits.max_angular_velocity, limits.max_angular_velocity))


@dataclass(frozen=True)
class Scale:
    """
    The range of a plot of a value over time.

    :param lowest: the lowest value [its unit]
    :param highest: the highest value [its unit]
    :param duration: the longest time [s]
    """

    lowest: float
    highest: float
    duration: float


def shared_scale(views: Sequence[PlanView], component: VelocityComponent) -> Scale:
    """Return a scale for what all plans send, and for the limits that are near."""
    values = [value for view in views
              for _, value in velocity_steps(view.plan, component.attribute)]
    duration = max(view.plan.duration for view in views)
    return scale_for(component, values, [view.limits for view in views], duration)


def scale_for(component: VelocityComponent, values: Sequence[float], limits: Sequence[Limits],
              duration: float) -> Scale:
    """Return a scale for some values and a time [s], and for the limits that are near."""
    lowest, highest = min(values), max(values)
    largest = max(highest, -lowest)
    for below, above in map(component.limits, limits):
        far = MAX_LIMIT_RATIO * largest if largest else math.inf
        if lowest < 0.0 and -below <= far:
            lowest = min(lowest, below)
        if above <= far and (highest > 0.0 or not largest):
            highest = max(highest, above)
    # Without a limit and a velocity any span is as good.
    span = highest - lowest if 0.0 < highest - lowest < math.inf else 1.0
    highest = highest if math.isfinite(highest) else 1.0
    return Scale(lowest - span * (LABEL_SHARE if lowest < 0.0 else 0.06),
                 highest + LABEL_SHARE * span, duration or 1.0)


def time_unit(duration: float) -> tuple[str, float]:
    """Return the unit of a time axis by its length [s]: its name, and how long it is [s]."""
    return ('min', 60.0) if duration > MINUTES_FROM else ('s', 1.0)


def draw_velocity(axes: Axes, view: PlanView, component: VelocityComponent, scale: Scale) -> None:
    """Draw a plan's velocity over time, with its limits and the ends of its steps."""
    seconds = time_unit(scale.duration)[1]
    set_time_limits(axes, scale, component.label, [step.end for step in view.plan.steps])
    points = velocity_steps(view.plan, component.attribute)
    axes.step([0.0, *(time / seconds for time, _ in points)],
              [0.0, *(value for _, value in points)], where='post', color=component.colour,
              linewidth=1.2, alpha=1.0 if len(points) <= DENSE else 0.5, zorder=1.5, gid='sent')
    draw_limits(axes, component, view.limits)


def set_time_limits(axes: Axes, scale: Scale, label: str, ends: Sequence[float]) -> None:
    """
    Set the range of a plot over time, and draw its zero and faint lines where steps end.

    :param ends: when steps end [s]; too many are not drawn
    """
    unit = time_unit(scale.duration)[1]
    right = scale.duration / unit
    axes.set(xlim=(-0.01 * right, 1.01 * right), ylim=(scale.lowest, scale.highest), ylabel=label)
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=1.0)
    if len(ends) <= MAX_BOUNDARIES:
        axes.vlines([end / unit for end in ends], 0.0, 1.0, color=GREY, linewidth=0.5, alpha=0.5,
                    transform=axes.get_xaxis_transform(), zorder=1.0, gid='boundaries')


def draw_limits(axes: Axes, component: VelocityComponent, limits: Limits) -> None:
    """Draw limits as dashed lines with their values; the range of the axes is set."""
    bottom, top = axes.get_ylim()
    below, above = component.limits(limits)
    near = [(limit, side, offset) for limit, side, offset in (
        (above, 'bottom', 2.0), (below, 'top', -2.0)) if bottom < limit < top]
    for limit, side, offset in near:
        axes.axhline(limit, color=GREY, linewidth=1.0, linestyle='--', zorder=2.0, gid='limit')
        axes.annotate(
            f'limit {format_number(limit)} {component.unit}', (1.0, limit), (-4.0, offset),
            va=side, xycoords=axes.get_yaxis_transform(), **WORDS)
    if not near and math.isfinite(above):
        axes.annotate(
            f'far above: limit {format_number(above)} {component.unit}', (1.0, 1.0), (-4.0, 0.0),
            va='top', xycoords='axes fraction', **WORDS)
