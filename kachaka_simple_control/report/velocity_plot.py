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
"""Draw velocities over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
import math
from operator import attrgetter, itemgetter
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.plan import Plan
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.plan_view import PlanView
from kachaka_simple_control.report.plot_style import BLUE, GREY, ORANGE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: More corners than these are thinned out.
MAX_CORNERS = 3000
#: Columns in each of which the first, lowest, highest and last corner stay.
COLUMNS = 600

StepPoint = tuple[float, float]


def velocity_steps(plan: Plan, component: str) -> list[StepPoint]:
    """
    Return when a component of the velocity changes, and to what.

    :param plan: what is sent
    :param component: ``linear_x`` or ``angular_z``
    :returns: times [s] and values [m/s or rad/s], in order; the last is the zero at the end
    """
    value_of = attrgetter(component)
    changes = groupby(plan.segments, key=lambda segment: value_of(segment.velocity))
    corners = [(next(segments).start, value + 0.0) for value, segments in changes]
    corners.append((plan.duration, 0.0))
    return corners if len(corners) <= MAX_CORNERS else _thinned(corners)


def _thinned(corners: list[StepPoint]) -> list[StepPoint]:
    # What is drawn in a column of the picture reaches from its lowest value to its highest, and
    # joins its neighbours with the first and the last: the picture stays the same.
    width = corners[-1][0] / COLUMNS
    thinned: list[StepPoint] = []
    for _, column in groupby(corners, key=lambda corner: int(corner[0] / width)):
        found = list(column)
        height = itemgetter(1)
        thinned += sorted({
            found[0], min(found, key=height), max(found, key=height), found[-1]})
    return thinned


#: More boundaries between steps than these would be a grey wall.
MAX_BOUNDARIES = 60
#: Limits more than so many times above what is sent would press it flat: they are only named.
FAR = 5.0
#: Free part above the highest and below the lowest line, for the words on limits.
FREE = 0.25
#: The words on limits; no line goes through them.
WORDS: dict[str, Any] = {
    'color': '#444444', 'fontsize': 8.0, 'zorder': 4.0,
    'bbox': {'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.5}}
#: A line with more corners than these is an area; the limits shine through.
DENSE = 2000
#: From so long on [s], time is in minutes.
LONG = 600.0


@dataclass(frozen=True)
class Kind:
    """
    One of the two components of a velocity.

    :param component: its name in a velocity
    :param label: what stands at its axis
    :param unit: its unit
    :param colour: its line's colour
    :param limits: its lowest and its highest value under limits
    """

    component: str
    label: str
    unit: str
    colour: str
    limits: Callable[[Limits], tuple[float, float]]


LINEAR = Kind('linear_x', 'linear [m/s]', 'm/s', BLUE, lambda limits: (
    -limits.backward_velocity, limits.max_linear_velocity))
ANGULAR = Kind('angular_z', 'angular [rad/s]', 'rad/s', ORANGE, lambda limits: (
    -limits.max_angular_velocity, limits.max_angular_velocity))


@dataclass(frozen=True)
class Scale:
    """
    What all pictures of a kind of velocity show.

    :param kind: which
    :param lowest: the lowest velocity [its unit]
    :param highest: the highest velocity [its unit]
    :param duration: the longest time [s]
    """

    kind: Kind
    lowest: float
    highest: float
    duration: float


def scale(previews: Sequence[PlanView], kind: Kind) -> Scale:
    """
    Return a scale with room for what all plans send, and for the limits that are near.

    :param previews: the plans
    :param kind: which velocity
    :returns: the scale
    """
    values = [value for preview in previews
              for _, value in velocity_steps(preview.plan, kind.component)]
    duration = max(preview.plan.duration for preview in previews)
    return room(kind, values, [preview.limits for preview in previews], duration)


def room(
        kind: Kind, values: Sequence[float], limits: Sequence[Limits], duration: float) -> Scale:
    """
    Return a scale with room for some values, and for the limits that are near.

    :param kind: which velocity
    :param values: what is shown [its unit]
    :param limits: all limits
    :param duration: the longest time [s]
    :returns: the scale
    """
    lowest, highest = min(values), max(values)
    largest = max(highest, -lowest)
    for below, above in map(kind.limits, limits):
        far = FAR * largest if largest else math.inf
        if lowest < 0.0 and -below <= far:
            lowest = min(lowest, below)
        if above <= far and (highest > 0.0 or not largest):
            highest = max(highest, above)
    return _free(kind, lowest, highest, duration)


def _free(kind: Kind, lowest: float, highest: float, duration: float) -> Scale:
    # Without a limit and a velocity there is no size; any will do.
    span = highest - lowest if 0.0 < highest - lowest < math.inf else 1.0
    highest = highest if math.isfinite(highest) else 1.0
    return Scale(kind, lowest - span * (FREE if lowest < 0.0 else 0.06), highest + FREE * span,
                 duration or 1.0)


def draw_velocity(axes: Axes, preview: PlanView, scale_: Scale, with_time: bool) -> None:
    """
    Draw a velocity over time, with its limits dashed and a faint line where a step ends.

    :param axes: where
    :param preview: the plan
    :param scale_: what to show
    :param with_time: whether numbers stand at the time's axis
    """
    kind = scale_.kind
    unit, seconds = ('min', 60.0) if scale_.duration > LONG else ('s', 1.0)
    right = scale_.duration / seconds
    axes.set(xlim=(-0.01 * right, 1.01 * right), ylim=(scale_.lowest, scale_.highest),
             ylabel=kind.label)
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=1.0)
    ends = [stage.end / seconds for stage in preview.plan.steps]
    if len(ends) <= MAX_BOUNDARIES:
        axes.vlines(ends, 0.0, 1.0, transform=axes.get_xaxis_transform(), color=GREY,
                    linewidth=0.5, alpha=0.5, zorder=1.0, gid='boundaries')
    corners = velocity_steps(preview.plan, kind.component)
    axes.step([0.0, *(time / seconds for time, _ in corners)],
              [0.0, *(value for _, value in corners)], where='post', color=kind.colour,
              linewidth=1.2, alpha=1.0 if len(corners) <= DENSE else 0.5, zorder=1.5, gid='sent')
    draw_limits(axes, kind, preview.limits)
    axes.tick_params(labelbottom=with_time)
    if with_time:
        axes.set_xlabel(f'time [{unit}]')


def draw_limits(axes: Axes, kind: Kind, limits: Limits) -> None:
    """
    Draw limits as dashed lines, and say how large they are.

    :param axes: where; what it shows from bottom to top is set
    :param kind: which velocity
    :param limits: the limits
    """
    bottom, top = axes.get_ylim()
    below, above = kind.limits(limits)
    near = [(limit, side, lift) for limit, side, lift in (
        (above, 'bottom', 2.0), (below, 'top', -2.0)) if bottom < limit < top]
    for limit, side, lift in near:
        axes.axhline(limit, color=GREY, linewidth=1.0, linestyle='--', zorder=2.0, gid='limit')
        axes.annotate(
            f'limit {format_number(limit)} {kind.unit}', (1.0, limit), (-4.0, lift), ha='right',
            va=side,
            xycoords=axes.get_yaxis_transform(), textcoords='offset points', **WORDS)
    if not near and math.isfinite(above):
        axes.annotate(
            f'far above: limit {format_number(above)} {kind.unit}', (1.0, 1.0), (-4.0, 0.0),
            ha='right',
            va='top', xycoords='axes fraction', textcoords='offset points', **WORDS)
