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
"""Plots of plans: paths and velocities."""

from __future__ import annotations

from collections.abc import Sequence
import io
import math
import os
from pathlib import Path
from typing import Any, NamedTuple, TYPE_CHECKING
import warnings

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.geometry import (
    advance,
    front_point,
    ORIGIN,
    outline,
    Point,
    Pose,
    transform_point,
)
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.paths import arc_segments, ArcSegment, distinct, polyline
from kachaka_simple_control.report.plan_view import (
    format_fixed,
    PlanView,
    pluralize,
)
from kachaka_simple_control.report.plot_style import BLUE, framed, GREEN, GREY, nice, ORANGE, style
from kachaka_simple_control.report.text_tables import one_line
from kachaka_simple_control.report.velocity_plot import ANGULAR, draw_velocity, LINEAR, scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: So many robots and arrows at most stand on a path.
MAX_MARKS = 16
#: More turns in place than these are not drawn: the robots show where they end.
MOST_TURNS = 12
#: Drawn where a plan begins and ends; both can be seen where it ends at its start.
START: dict[str, Any] = {
    'linestyle': '', 'marker': 'o', 'markersize': 9.5, 'markerfacecolor': 'white',
    'markeredgecolor': GREEN, 'markeredgewidth': 1.8, 'zorder': 5.0}
END: dict[str, Any] = {
    'linestyle': '', 'marker': 'o', 'markersize': 4.5, 'color': ORANGE, 'zorder': 6.0}
#: A robot at the end of a step, with a line from its axle to its front.
ROBOT: dict[str, Any] = {
    'facecolor': (0.34, 0.71, 0.91, 0.10), 'edgecolor': GREY, 'linewidth': 0.8}
#: How much of the picture can hardly be seen.
GRAIN = 1.0 / 1500.0
#: Part of the picture that stays free around.
MARGIN = 0.07
#: The smallest picture [m].
SMALLEST = 0.2
#: A heading without a footprint is this part of the picture long.
TICK = 0.06
#: A turn in place is drawn at this part of the way from the axle to the front.
TURN = 0.7


class Area(NamedTuple):
    """
    What a picture of a path shows.

    :param left: the smallest x [m]
    :param bottom: the smallest y [m]
    :param width: from left to right [m]
    :param height: from bottom to top [m]
    """

    left: float
    bottom: float
    width: float
    height: float


def extent(previews: Sequence[PlanView], proportion: float) -> Area:
    """
    Return an area with room for all paths and the robots on them.

    :param previews: the plans
    :param proportion: its width as a part of its height
    :returns: the area
    """
    points = [point for preview in previews for point in _reached(preview)]
    xs, ys = [x for x, _ in points], [y for _, y in points]
    width, height = max(xs) - min(xs), max(ys) - min(ys)
    free = 1.0 + 2.0 * MARGIN
    height = max(height * free, width * free / proportion, SMALLEST)
    width = height * proportion
    return Area((min(xs) + max(xs) - width) / 2.0, (min(ys) + max(ys) - height) / 2.0,
                width, height)


def _reached(preview: PlanView) -> list[Point]:
    points = polyline(arc_segments(preview.plan), 0.001)
    if preview.footprint is not None:
        for pose in distinct(_stops(preview), 0.001, len(points) + len(preview.plan.steps)):
            points += outline(preview.footprint, pose)
        radius = front_point(preview.footprint, ORIGIN)[0] * TURN
        for turn in _turns(preview):
            points += turn.sweep(radius)
    return [point for point in points if not math.isnan(point[0])]


def _stops(preview: PlanView) -> list[Pose]:
    return [ORIGIN, *(stage.pose for stage in preview.plan.steps)]


def draw_path(axes: Axes, preview: PlanView, area: Area) -> None:
    """
    Draw the path of a plan, with the robot at its start and at the end of each step.

    :param axes: where, in the proportion of the area
    :param preview: the plan
    :param area: what to show
    """
    from matplotlib.ticker import MultipleLocator

    axes.set_aspect('equal')
    axes.set(xlim=(area.left, area.left + area.width), xlabel='x [m]',
             ylim=(area.bottom, area.bottom + area.height), ylabel='y [m]')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(nice(area.height / 8.0)))
    grain = area.height * GRAIN
    paths = arc_segments(preview.plan)
    points = polyline(paths, grain)
    axes.plot([x for x, _ in points], [y for _, y in points], color=BLUE, linewidth=1.6,
              solid_joinstyle='round', zorder=3.0, gid='path')
    _draw_robots(axes, preview, grain, _reach(preview, area))
    _draw_turns(axes, _turns(preview),
                _reach(preview, area) * TURN)
    middles = distinct((path.middle for path in paths if path.distance), grain, MAX_MARKS)
    _draw_arrows(axes, middles, BLUE)
    end = preview.plan.pose
    axes.plot(0.0, 0.0, **START, gid='start')
    axes.plot(end.x, end.y, **END, gid='end')




def _reach(preview: PlanView, area: Area) -> float:
    shape = preview.footprint
    return area.height * TICK if shape is None else front_point(shape, ORIGIN)[0]


def _turns(preview: PlanView) -> list[ArcSegment]:
    # One of each kind, however often it is repeated.
    kinds: dict[tuple[float, ...], ArcSegment] = {}
    for path in arc_segments(preview.plan):
        start = path.start
        kind = (round(start.x, 3), round(start.y, 3), round(start.theta % math.tau, 2),
                round(path.angle, 2))
        if path.angle and not path.distance:
            kinds.setdefault(kind, path)
    return list(kinds.values()) if len(kinds) <= MOST_TURNS else []


def _draw_robots(axes: Axes, preview: PlanView, grain: float, reach: float) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    poses = distinct(_stops(preview), grain, MAX_MARKS)
    shape = preview.footprint
    if shape is not None:
        axes.add_collection(
            PolyCollection([outline(shape, pose) for pose in poses], **ROBOT, gid='robots'))
        for pose, colour, width in ((ORIGIN, GREEN, 2.2), (preview.plan.pose, ORANGE, 1.1)):
            axes.add_collection(PolyCollection(
                [outline(shape, pose)], facecolor='none', edgecolor=colour, linewidth=width,
                zorder=2.0))
    axes.add_collection(LineCollection(
        [[(pose.x, pose.y), transform_point((reach, 0.0), pose)] for pose in poses], colors=GREY,
        linewidths=1.2, zorder=2.5, gid='headings'))


def _draw_turns(axes: Axes, turns: Sequence[ArcSegment], radius: float) -> None:
    from matplotlib.collections import LineCollection

    if not turns:
        return
    axes.add_collection(LineCollection(
        [turn.sweep(radius) for turn in turns], colors=ORANGE, linewidths=1.2, zorder=2.6,
        gid='turns'))
    ends = [advance(turn.start, 0.0, turn.angle) for turn in turns]
    _draw_arrows(axes, [
        Pose(*transform_point((radius, 0.0), end),
        end.theta + math.copysign(math.pi / 2.0, turn.angle))
        for turn, end in zip(turns, ends)], ORANGE)


def _draw_arrows(axes: Axes, poses: Sequence[Pose], colour: str) -> None:
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D

    head = Path([(-1.0, 0.8), (0.4, 0.0), (-1.0, -0.8), (-0.6, 0.0), (-1.0, 0.8)])
    for pose in poses:
        turned = Affine2D().rotate(pose.theta).transform_path(head)
        axes.plot(pose.x, pose.y, marker=turned, markersize=8.0, color=colour,
                  markeredgewidth=0.0, zorder=4.0, gid='arrow')


def draw_key(figure: Figure, place_: Point) -> None:
    """
    Draw what the marks on the paths mean.

    :param figure: the picture
    :param place_: its lower left corner, as parts of the picture
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    marks = [Line2D([], [], **START), Line2D([], [], **END), Patch(**ROBOT),
             Line2D([], [], color=GREY, linewidth=1.2), Line2D([], [], color=BLUE, linewidth=1.6)]
    names = ['start', 'end', 'robot after a step', 'its heading', 'path']
    if figure.findobj(lambda artist: artist.get_gid() == 'turns'):
        marks.append(Line2D([], [], color=ORANGE, linewidth=1.2))
        names.append('turn in place')
    figure.legend(marks, names, loc='lower left', bbox_to_anchor=place_, ncol=len(marks),
                  frameon=False, borderpad=0.0, borderaxespad=0.0, handlelength=1.6,
                  columnspacing=1.6)


#: What each kind of file says of itself is left out: two runs give the same bytes.
METADATA: dict[str, dict[str, None]] = {
    '.png': {'Software': None},
    '.svg': {'Date': None, 'Creator': None},
    '.pdf': {'CreationDate': None, 'Creator': None, 'Producer': None},
}
#: Pixels an inch, where there are pixels.
RESOLUTION = 110
#: A taller picture is more than people look at, and png has its limits.
MAX_MOTIONS = 12

# Sizes and places [inch].
WIDTH = 11.0
ROW, KEY = 4.35, 0.4
PATH_LEFT, PATH_WIDTH = 0.75, 4.35
VELOCITY_LEFT, VELOCITY_WIDTH = 6.1, 4.7
BOTTOM, HEIGHT, BETWEEN = 0.5, 3.2, 0.3
NAME_TOP, FIGURES_TOP = 0.17, 0.42


def save_plot(file: str | os.PathLike[str], previews: Sequence[PlanView]) -> None:
    """
    Draw plans, one below the other and to the same scales, and save the picture.

    On the left each path with the robot at the start and at the end of each step; on the right the
    velocities as they are sent, with the limits dashed.

    :param file: where to; its ending says what it becomes: .png, .svg or .pdf
    :param previews: the plans, 1 to 12
    :raises UsageError: if there is no such place, matplotlib is absent, or there are too many
    """
    path = check_plot_file(file)
    figure = draw(previews)
    data = io.BytesIO()
    suffix = path.suffix.lower()
    with style(), warnings.catch_warnings():
        # A letter that the font lacks becomes a box; the name is still in the table.
        warnings.filterwarnings('ignore', message='Glyph')
        figure.savefig(data, format=suffix[1:], metadata=METADATA[suffix])
    try:
        path.write_bytes(data.getvalue())
    except OSError as error:
        raise UsageError(f'{path}: it cannot be written: {error.strerror}') from None


def check_plot_file(file: str | os.PathLike[str]) -> Path:
    """
    Refuse a file that no picture can be saved to; nothing is drawn or imported for it.

    :param file: where to save it
    :returns: its path
    :raises UsageError: if it has no ending that we can draw, or no folder to be in
    """
    path = Path(file)
    if path.suffix.lower() not in METADATA:
        raise UsageError(f'{path}: a plot is .png, .svg or .pdf; take one of these as its ending')
    if not path.parent.is_dir():
        raise UsageError(f'{path}: there is no folder {path.parent}; make it first')
    if path.is_dir():
        raise UsageError(f'{path}: this is a folder; name a file in it')
    target = path if path.exists() else path.parent
    if not os.access(target, os.W_OK):
        raise UsageError(f'{path}: you are not allowed to write there')
    return path


def draw(previews: Sequence[PlanView]) -> Figure:
    """
    Draw plans, one below the other and to the same scales.

    :param previews: the plans, 1 to 12
    :returns: the picture
    :raises UsageError: if matplotlib is absent, or there are too many plans
    """
    if not 1 <= len(previews) <= MAX_MOTIONS:
        raise UsageError(
            f'a plot shows 1 to {MAX_MOTIONS} motions, not {len(previews)}; name fewer')
    with style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, len(previews) * ROW + KEY), dpi=RESOLUTION)
        FigureCanvasAgg(figure)
        area = extent(previews, PATH_WIDTH / HEIGHT)
        scales = [scale(previews, kind) for kind in (LINEAR, ANGULAR)]
        for number, preview in enumerate(previews):
            row = _Row(figure, len(previews), number)
            row.title(preview)
            draw_path(row.axes(PATH_LEFT, 0.0, PATH_WIDTH, HEIGHT), preview, area)
            part = (HEIGHT - BETWEEN) / 2.0
            above = row.axes(VELOCITY_LEFT, part + BETWEEN, VELOCITY_WIDTH, part)
            below = row.axes(VELOCITY_LEFT, 0.0, VELOCITY_WIDTH, part)
            draw_velocity(above, preview, scales[0], with_time=False)
            draw_velocity(below, preview, scales[1], with_time=True)
        draw_key(figure, (PATH_LEFT / WIDTH, 0.1 / figure.get_figheight()))
    return figure


class _Row:
    """The place of one plan in the picture."""

    def __init__(self, figure: Figure, count: int, number: int) -> None:
        self._figure = figure
        self._height = count * ROW + KEY
        self._base = KEY + (count - 1 - number) * ROW

    def axes(self, left: float, bottom: float, width: float, height: float) -> Axes:
        bottom += self._base + BOTTOM
        axes = self._figure.add_axes((
            left / WIDTH, bottom / self._height, width / WIDTH, height / self._height))
        framed(axes, width)
        return axes

    def title(self, preview: PlanView) -> None:
        for text, top, look in (
                (_name(preview), NAME_TOP, {'fontsize': 12.0, 'fontweight': 'bold'}),
                (_figures(preview), FIGURES_TOP, {'color': '#444444'})):
            self._figure.text(
                PATH_LEFT / WIDTH, (self._base + ROW - top) / self._height, text, va='top', **look)


def _name(preview: PlanView) -> str:
    return _plain(f'{one_line(preview.name, 50)} on {one_line(preview.robot, 30)}')


def _figures(preview: PlanView) -> str:
    plan = preview.plan
    end = plan.pose
    return (f'{plan.duration:.3f} s, {plan.length:.3f} m, {pluralize(len(plan.steps), "step")}; '
            f'ends at x {format_fixed(end.x, 3)} m, y {format_fixed(end.y, 3)} m, heading '
            f'{format_fixed(math.degrees(end.theta), 1)}°; '
            f'{pluralize(preview.messages, "velocity", "velocities")} at '
            f'{format_number(preview.rate)} Hz')


def _plain(text: str) -> str:
    # Between two dollars matplotlib reads a formula.
    return text.replace('$', r'\$')
