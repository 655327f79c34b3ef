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
"""Values over time for drawing: those that a plan holds, and bands instead of very many."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import groupby
from operator import attrgetter
from typing import NamedTuple

from kachaka_simple_control.motion.plan import Plan

#: A time [s] and a value that is held from then on.
StepPoint = tuple[float, float]


def velocity_steps(plan: Plan, attribute: str) -> list[StepPoint]:
    """
    Return when a component of the velocity changes, and to what.

    :param plan: what is sent
    :param attribute: ``linear_x`` or ``angular_z``
    :returns: times [s] and values [m/s or rad/s], in order; the last is the zero at the end
    """
    value_of = attrgetter(attribute)
    changes = groupby(plan.segments, key=lambda segment: value_of(segment.velocity))
    points = [(next(segments).start, value + 0.0) for value, segments in changes]
    return [*points, (plan.duration, 0.0)]


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
