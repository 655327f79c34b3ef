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
Draw on maps what stands on a floor, and where an obstacle watch held the robot.

Tested by test/report/test_obstacle_plot.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
import math
from typing import Any, TYPE_CHECKING

from kachaka_simple_control.analysis.obstacle_holds import Hold
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import (
    Area,
    compose,
    Disc,
    Footprint,
    ORIGIN,
    outline,
    outlines,
    Point,
    Pose,
    transform_point,
)
from kachaka_simple_control.report.plot_style import Colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: A map is large enough for what the laser has seen within this distance of a held robot [m].
NEAR = 0.8
#: A map is large enough for what stands within this distance of what else it shows [m].
AROUND = 0.5
#: The styles of walls, of posts, and of people, who are not always there.
WALLS: dict[str, Any] = {'colors': '#444444', 'linewidths': 2.6, 'zorder': 1.8}
POSTS: dict[str, Any] = {'facecolor': '#444444', 'edgecolor': 'none', 'zorder': 1.8}
PEOPLE: dict[str, Any] = {
    'facecolor': 'none', 'edgecolor': '#444444', 'linewidth': 1.2, 'linestyle': (0, (2, 2)),
    'zorder': 1.8}
#: The style of the outline where the robot was held.
HELD: dict[str, Any] = {
    'facecolor': 'none', 'edgecolor': Colour.PURPLE, 'linewidth': 1.8, 'zorder': 5.2}
#: The style of what the laser had seen.
SCAN: dict[str, Any] = {
    'linestyle': '', 'marker': 'o', 'markersize': 1.8, 'color': '#222222', 'markeredgewidth': 0.0,
    'zorder': 5.1}


def hold_points(
        holds: Sequence[Hold], footprint: Footprint | None, start: Pose = ORIGIN) -> list[Point]:
    """
    Return the points that a map with holds must show [m].

    :param start: the pose of the robot at t = 0 on this map
    """
    poses = [compose(start, hold.pose) for hold in holds if hold.pose is not None]
    near = [transform_point(point, start) for hold in holds for point in hold.points
            if hold.pose is not None and math.dist(point, (hold.pose.x, hold.pose.y)) < NEAR]
    return [*outlines(footprint, poses), *near]


def draw_holds(
        axes: Axes,
        robots: Sequence[tuple[Footprint | None, Sequence[Hold], Pose]]) -> None:
    """
    Draw where robots were held, and what the laser had seen; draw nothing without a hold.

    :param robots: the outline of each, None if it is unknown, its holds, and its pose at t = 0 on
        this map
    """
    from matplotlib.collections import PolyCollection

    points = [transform_point(point, start) for _, holds, start in robots
              for hold in holds for point in hold.points]
    if points:
        axes.plot([x for x, _ in points], [y for _, y in points], **SCAN, gid='scan',
                  label='laser, when held')
    poses = [(footprint, compose(start, hold.pose)) for footprint, holds, start in robots
             for hold in holds if hold.pose is not None]
    bodies = [outlines(footprint, [pose]) for footprint, pose in poses if footprint is not None]
    if bodies:
        axes.add_collection(PolyCollection(bodies, **HELD, label='held here', gid='held'))
    if places := [pose for footprint, pose in poses if footprint is None]:
        axes.plot([pose.x for pose in places], [pose.y for pose in places], linestyle='',
                  marker='s', markersize=7.0, markerfacecolor='none', color=Colour.PURPLE,
                  zorder=HELD['zorder'], gid='held', label=None if bodies else 'held here')


def floor_points(floor: Floor | None, points: Iterable[Point]) -> list[Point]:
    """
    Return the points of a floor that a map must show, besides what else it shows [m].

    Of what is farther away than AROUND (0.5 m), nothing: a room may be large.

    :param points: what else the map shows, at least one
    """
    if floor is None:
        return []
    xs, ys = zip(*(point for point in points if math.isfinite(sum(point))))
    left, bottom = min(xs) - AROUND, min(ys) - AROUND
    area = Area(left, bottom, max(xs) + AROUND - left, max(ys) + AROUND - bottom)
    lines = [point for ends in floor.segments for point in _clipped(*ends, area)]
    return [*lines, *(
        point for x, y, radius in (*_posts(floor), *_people(floor))
        for point in ((x - radius, y - radius), (x + radius, y + radius))
        if _clipped((x, y), (x, y), area))]


def _posts(floor: Floor) -> Iterator[tuple[float, float, float]]:
    """Yield x, y and radius of each post [m]."""
    for post in floor.posts:
        yield *post.at, post.radius


def _people(floor: Floor) -> Iterator[tuple[float, float, float]]:
    """Yield x, y and radius of each place where somebody stands, comes from or goes to [m]."""
    for person in floor.people:
        for place in (person.at, person.to):
            if place is not None:
                yield *place, person.radius


def _clipped(start: Point, end: Point, area: Area) -> list[Point]:
    """Return the ends of the part of a line that is in an area; empty if none is."""
    (left, bottom), (right, top) = area.corners
    first, last = 0.0, 1.0
    for one, two, low, high in ((start[0], end[0], left, right), (start[1], end[1], bottom, top)):
        if one == two:
            if not low <= one <= high:
                return []
            continue
        enter, leave = sorted(((low - one) / (two - one), (high - one) / (two - one)))
        first, last = max(first, enter), min(last, leave)
    return [] if first > last else [
        (start[0] + part * (end[0] - start[0]), start[1] + part * (end[1] - start[1]))
        for part in (first, last)]


def draw_floor(axes: Axes, floor: Floor | None) -> None:
    """
    Draw what stands on a floor; people dashed, with a line to where they walk.

    :param floor: in the frame of the map; None to draw nothing
    """
    from matplotlib.collections import LineCollection, PolyCollection

    if floor is None:
        return
    if floor.segments:
        axes.add_collection(LineCollection(floor.segments, **WALLS, gid='wall', label='wall'))
    for name, discs, look in (('post', _posts(floor), POSTS), ('person', _people(floor), PEOPLE)):
        if circles := [outline(Disc(radius), Pose(x, y)) for x, y, radius in discs]:
            axes.add_collection(PolyCollection(circles, **look, gid=name, label=name))
    if walks := [(person.at, person.to) for person in floor.people if person.to is not None]:
        axes.add_collection(LineCollection(
            walks, colors=PEOPLE['edgecolor'], linestyles='dotted', linewidths=1.0,
            zorder=PEOPLE['zorder'], gid='walk'))


def floor_rows(floor: Floor | None) -> int:
    """Return how many rows of two a legend needs for what stands on a floor."""
    return 0 if floor is None else math.ceil(
        sum(map(bool, (floor.walls, floor.posts, floor.people))) / 2)
