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
"""Plot the planned paths and the planned velocities of motions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
import math
import os
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.analysis.flows import cut_corners
from kachaka_simple_control.analysis.plan_view import PlanView
from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.motion.geometry import Area, ORIGIN, outline, Pose, transform_point
from kachaka_simple_control.motion.paths import (
    ArcSegment,
    distinct,
    PathPart,
    polyline,
    step_segments,
    uncut_path,
)
from kachaka_simple_control.motion.units import format_number
from kachaka_simple_control.report.map_plot import (
    draw_arrows,
    draw_directions,
    draw_step_numbers,
    extent,
    HEADING_LENGTH,
    MAP_GRAIN,
    MAX_MARKS,
    set_map_limits,
)
from kachaka_simple_control.report.obstacle_plot import (
    draw_floor,
    floor_points,
    PEOPLE,
    POSTS,
    WALLS,
)
from kachaka_simple_control.report.output_file import check_plot_file, save_figure
from kachaka_simple_control.report.plot_style import (
    add_axes,
    ANGULAR,
    Colour,
    draw_figure,
    draw_line,
    draw_velocity,
    LINEAR,
    scale_for,
    time_unit,
    velocity_steps,
)
from kachaka_simple_control.text import format_fixed, one_line, pluralize

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: The largest number of turns in place to draw; if there are more, none is drawn.
MAX_TURNS = 12
#: The styles of the start and the end of a plan; both are visible if they are at one place.
START: dict[str, Any] = {
    'linestyle': '', 'marker': 'o', 'markersize': 9.5, 'markerfacecolor': 'white',
    'markeredgecolor': Colour.GREEN, 'markeredgewidth': 1.8, 'zorder': 5.0}
END: dict[str, Any] = {
    'linestyle': '', 'marker': 'o', 'markersize': 4.5, 'color': Colour.ORANGE, 'zorder': 6.0}
#: The style of the robot at the end of a step.
ROBOT: dict[str, Any] = {
    'facecolor': (0.34, 0.71, 0.91, 0.10), 'edgecolor': Colour.GREY, 'linewidth': 0.8}
#: The style of the floor area that a plan needs.
FLOOR: dict[str, Any] = {
    'facecolor': 'none', 'edgecolor': Colour.GREY, 'linewidth': 1.0, 'linestyle': (0, (6, 3))}
#: The style of the legs, which are the path with a stop in each corner.
LEGS: dict[str, Any] = {'color': Colour.BLUE, 'linewidth': 0.6}
#: The radius of a drawn turn in place, as a part of the distance from the axle to the front.
TURN = 0.7


def draw_path(axes: Axes, view: PlanView, area: Area) -> None:
    """
    Draw a map of a planned path.

    The map also shows the step numbers, the robot after each step, and the floor area that the
    motion needs.  If corners are cut, it also shows the legs between the corners.

    :param area: the area to show [m]; its ratio of width to height must be the ratio of the axes
    """
    from matplotlib.patches import Rectangle

    axes.set_aspect('equal')
    set_map_limits(axes, area, area.height / 8.0)
    grain = area.height * MAP_GRAIN
    steps = step_segments(view.plan)
    segments = [segment for step in steps for segment in step]
    draw_floor(axes, view.obstacles)
    draw_line(axes, polyline(segments, grain), color=Colour.BLUE, linewidth=1.6,
              solid_joinstyle='round', zorder=3.0, gid='path')
    if has_cut_corners(view):
        draw_line(axes, polyline(uncut_path(view.plan), grain), **LEGS, zorder=2.8, gid='legs')
    reach = view.footprint.front if view.footprint else area.height * HEADING_LENGTH
    _draw_robots(axes, view, grain, reach)
    left, bottom, width, height = view.floor
    axes.add_patch(Rectangle((left, bottom), width, height, **FLOOR, zorder=1.5, gid='floor'))
    _draw_turns(axes, _turns(segments), reach * TURN)
    draw_directions(axes, segments, grain, Colour.BLUE)
    draw_step_numbers(axes, enumerate(steps, 1), area.height)
    end = view.plan.pose
    axes.plot(0.0, 0.0, **START, gid='start')
    axes.plot(end.x, end.y, **END, gid='end')


def has_cut_corners(view: PlanView) -> bool:
    """Return whether the robot passes a corner of a plan without a stop."""
    return any(corner.cut.deviation for corner in cut_corners(view.plan))


def _turns(segments: Sequence[PathPart]) -> list[ArcSegment]:
    """
    Return only those segments of a path that are turns in place.

    If several turns have the same place, the same start heading and the same angle, only the first
    one is returned.

    :returns: the turns; an empty list if there are more than MAX_TURNS, which are too many to draw
    """
    kinds: dict[tuple[float, ...], ArcSegment] = {}
    for segment in segments:
        if isinstance(segment, ArcSegment) and segment.angle and not segment.distance:
            start, angle = segment.start, round(segment.angle, 2)
            kinds.setdefault((round(start.x, 3), round(start.y, 3),
                              round(start.theta % math.tau, 2), angle), segment)
    return list(kinds.values()) if len(kinds) <= MAX_TURNS else []


def _draw_robots(axes: Axes, view: PlanView, grain: float, reach: float) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    stops = [ORIGIN, *(step.pose for step in view.plan.steps)]
    poses = distinct(stops, grain, MAX_MARKS)
    footprint = view.footprint
    if footprint is not None:
        axes.add_collection(
            PolyCollection([outline(footprint, pose) for pose in poses], **ROBOT, gid='robots'))
        for pose, colour, width in (
                (ORIGIN, Colour.GREEN, 2.2), (view.plan.pose, Colour.ORANGE, 1.1)):
            axes.add_collection(PolyCollection([outline(footprint, pose)], facecolor='none',
                                               edgecolor=colour, linewidth=width, zorder=2.0))
    axes.add_collection(LineCollection(
        [[(pose.x, pose.y), transform_point((reach, 0.0), pose)] for pose in poses],
        colors=Colour.GREY, linewidths=1.2, zorder=2.5, gid='headings'))


def _draw_turns(axes: Axes, turns: Sequence[ArcSegment], radius: float) -> None:
    from matplotlib.collections import LineCollection

    if not turns:
        return
    axes.add_collection(LineCollection([turn.sweep(radius) for turn in turns], linewidths=1.2,
                                       colors=Colour.ORANGE, zorder=2.6, gid='turns'))
    draw_arrows(axes, [
        Pose(*transform_point((radius, 0.0), turn.end),
             turn.end.theta + math.copysign(math.pi / 2.0, turn.angle))
        for turn in turns], Colour.ORANGE)


def _draw_legend(figure: Figure) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    marks = {
        'start': Line2D([], [], **START), 'end': Line2D([], [], **END),
        'robot after a step': Patch(**ROBOT),
        'its heading': Line2D([], [], color=Colour.GREY, linewidth=1.2),
        'path': Line2D([], [], color=Colour.BLUE, linewidth=1.6)}
    if figure.findobj(lambda artist: artist.get_gid() == 'legs'):
        marks['legs'] = Line2D([], [], **LEGS)
    marks['floor needed'] = Patch(**FLOOR)
    if figure.findobj(lambda artist: artist.get_gid() == 'turns'):
        marks['turn in place'] = Line2D([], [], color=Colour.ORANGE, linewidth=1.2)
    shown = {artist.get_gid() for artist in figure.findobj()}
    marks.update({name: mark for name, mark in (
        ('wall', Line2D([], [], color=WALLS['colors'], linewidth=WALLS['linewidths'])),
        ('post', Patch(**POSTS)), ('person', Patch(**PEOPLE))) if name in shown})
    corner = (PATH_LEFT / WIDTH, 0.1 / figure.get_figheight())
    figure.legend([*marks.values()], [*marks], loc='lower left', bbox_to_anchor=corner,
                  ncol=len(marks), frameon=False, borderpad=0.0, borderaxespad=0.0,
                  handlelength=1.6, columnspacing=1.6)


#: The resolution of a PNG file [pixels per inch].
RESOLUTION = 110
#: The largest number of motions in a plot; more would make the plot too high.
MAX_MOTIONS = 12

# Sizes and positions [inch].
WIDTH = 11.0
ROW, KEY = 4.35, 0.4
PATH_LEFT, PATH_WIDTH = 0.75, 4.35
VELOCITY_LEFT, VELOCITY_WIDTH = 6.1, 4.7
BOTTOM, HEIGHT, BETWEEN = 0.5, 3.2, 0.3
NAME_TOP, FIGURES_TOP = 0.17, 0.42


def save_plot(file: str | os.PathLike[str], views: Sequence[PlanView]) -> None:
    """
    Plot the planned paths and velocities of motions, and save the plot as an image file.

    Each motion has one row of the plot.  All rows have the same scales.  On the left is the path,
    with the robot at the start and at the end of each step.  On the right are the velocities that
    will be sent, with dashed lines for the limits.

    :param file: the path of the file; its suffix selects the image format: .png, .svg or .pdf
    :param views: the plans of 1 to 12 motions
    :raises UsageError: if the file cannot be written, matplotlib is missing, or there are too many
        plans
    """
    path = check_plot_file(file)
    save_figure(draw_plans(views), path)


def draw_plans(views: Sequence[PlanView]) -> Figure:
    """
    Plot the planned paths and velocities of motions, one motion below the other.

    All motions are drawn with the same scales.

    :param views: the plans of 1 to 12 motions
    :returns: the plot as a matplotlib figure
    :raises UsageError: if matplotlib is missing, or there are too many plans
    """
    if not 1 <= len(views) <= MAX_MOTIONS:
        raise UsageError(f'a plot shows 1 to {MAX_MOTIONS} motions, not {len(views)}; name fewer')
    return draw_figure(lambda figure: _draw(figure, views), RESOLUTION)


def _draw(figure: Figure, views: Sequence[PlanView]) -> None:
    figure.set_size_inches(WIDTH, len(views) * ROW + KEY)
    proportion = HEIGHT / PATH_WIDTH
    legs = (polyline(uncut_path(view.plan), MAP_GRAIN) for view in views if has_cut_corners(view))
    shown = [*chain(*(view.floor.corners for view in views), *legs)]
    area = extent(
        chain(shown, *(floor_points(view.obstacles, shown) for view in views)), proportion,
        proportion)
    limits, duration = [view.limits for view in views], max(view.plan.duration for view in views)
    scales = [
        scale_for(component, [value for view in views
                              for _, value in velocity_steps(view.plan, component.attribute)],
                  limits, duration) for component in (LINEAR, ANGULAR)]
    part = (HEIGHT - BETWEEN) / 2.0
    for row, view in zip(reversed(range(len(views))), views):
        base = KEY + row * ROW
        _draw_title(figure, view, base + ROW)
        draw_path(add_axes(figure, PATH_LEFT, base + BOTTOM, PATH_WIDTH, HEIGHT), view, area)
        above, below = (add_axes(figure, VELOCITY_LEFT, base + bottom, VELOCITY_WIDTH, part)
                        for bottom in (BOTTOM + part + BETWEEN, BOTTOM))
        draw_velocity(above, view, LINEAR, scales[0])
        draw_velocity(below, view, ANGULAR, scales[1])
        above.tick_params(labelbottom=False)
        below.set_xlabel(f'time [{time_unit(scales[1].duration)[0]}]')
    _draw_legend(figure)


def _draw_title(figure: Figure, view: PlanView, top: float) -> None:
    plan, end = view.plan, view.plan.pose
    name = f'{one_line(view.name, 50)} on {one_line(view.robot, 30)}'
    figures = (
        f'{plan.duration:.3f} s, {plan.length:.3f} m, {pluralize(len(plan.steps), "step")}; '
        f'ends at x {format_fixed(end.x, 3)} m, y {format_fixed(end.y, 3)} m, heading '
        f'{format_fixed(math.degrees(end.theta), 1)}°; '
        f'{pluralize(view.messages, "velocity", "velocities")} at {format_number(view.rate)} Hz; '
        f'needs {view.floor_size}{"" if view.footprint else " and the robot"}')
    # Matplotlib reads text between two dollar signs as a formula.
    for text, offset, look in (
            (name.replace('$', r'\$'), NAME_TOP, {'fontsize': 12.0, 'fontweight': 'bold'}),
            (figures, FIGURES_TOP, {'color': '#444444'})):
        figure.text(
            PATH_LEFT / WIDTH, (top - offset) / figure.get_figheight(), text, va='top', **look)
