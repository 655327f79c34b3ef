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
"""Draw where a plan goes: the path to scale, and the robot on it."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, NamedTuple, TYPE_CHECKING

from kachaka_simple_control.motion.kinematics import advance, ORIGIN, Pose
from kachaka_simple_control.report.outline import nose, outline, place, Point
from kachaka_simple_control.report.pictures.looks import BLUE, GREEN, GREY, nice, ORANGE
from kachaka_simple_control.report.preview import Preview
from kachaka_simple_control.report.track import distinct, line, Stretch, stretches

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: So many robots and arrows at most stand on a path.
MOST = 16
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


def extent(previews: Sequence[Preview], proportion: float) -> Area:
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


def _reached(preview: Preview) -> list[Point]:
    points = line(stretches(preview.plan), 0.001)
    if preview.footprint is not None:
        for pose in distinct(_stops(preview), 0.001, len(points) + len(preview.plan.stages)):
            points += outline(preview.footprint, pose)
        radius = nose(preview.footprint, ORIGIN)[0] * TURN
        for turn in _turns(preview):
            points += turn.sweep(radius)
    return [point for point in points if not math.isnan(point[0])]


def _stops(preview: Preview) -> list[Pose]:
    return [ORIGIN, *(stage.pose for stage in preview.plan.stages)]


def draw_path(axes: Axes, preview: Preview, area: Area) -> None:
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
    paths = stretches(preview.plan)
    points = line(paths, grain)
    axes.plot([x for x, _ in points], [y for _, y in points], color=BLUE, linewidth=1.6,
              solid_joinstyle='round', zorder=3.0, gid='path')
    _draw_robots(axes, preview, grain, _reach(preview, area))
    _draw_turns(axes, _turns(preview),
                _reach(preview, area) * TURN)
    middles = distinct((path.middle for path in paths if path.distance), grain, MOST)
    _draw_arrows(axes, middles, BLUE)
    end = preview.plan.pose
    axes.plot(0.0, 0.0, **START, gid='start')
    axes.plot(end.x, end.y, **END, gid='end')




def _reach(preview: Preview, area: Area) -> float:
    shape = preview.footprint
    return area.height * TICK if shape is None else nose(shape, ORIGIN)[0]


def _turns(preview: Preview) -> list[Stretch]:
    # One of each kind, however often it is repeated.
    kinds: dict[tuple[float, ...], Stretch] = {}
    for path in stretches(preview.plan):
        start = path.start
        kind = (round(start.x, 3), round(start.y, 3), round(start.theta % math.tau, 2),
                round(path.angle, 2))
        if path.angle and not path.distance:
            kinds.setdefault(kind, path)
    return list(kinds.values()) if len(kinds) <= MOST_TURNS else []


def _draw_robots(axes: Axes, preview: Preview, grain: float, reach: float) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    poses = distinct(_stops(preview), grain, MOST)
    shape = preview.footprint
    if shape is not None:
        axes.add_collection(
            PolyCollection([outline(shape, pose) for pose in poses], **ROBOT, gid='robots'))
        for pose, colour, width in ((ORIGIN, GREEN, 2.2), (preview.plan.pose, ORANGE, 1.1)):
            axes.add_collection(PolyCollection(
                [outline(shape, pose)], facecolor='none', edgecolor=colour, linewidth=width,
                zorder=2.0))
    axes.add_collection(LineCollection(
        [[(pose.x, pose.y), place((reach, 0.0), pose)] for pose in poses], colors=GREY,
        linewidths=1.2, zorder=2.5, gid='headings'))


def _draw_turns(axes: Axes, turns: Sequence[Stretch], radius: float) -> None:
    from matplotlib.collections import LineCollection

    if not turns:
        return
    axes.add_collection(LineCollection(
        [turn.sweep(radius) for turn in turns], colors=ORANGE, linewidths=1.2, zorder=2.6,
        gid='turns'))
    ends = [advance(turn.start, 0.0, turn.angle) for turn in turns]
    _draw_arrows(axes, [
        Pose(*place((radius, 0.0), end), end.theta + math.copysign(math.pi / 2.0, turn.angle))
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
