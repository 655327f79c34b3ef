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
"""A velocity over time as it is sent: each value is held until the next."""

from __future__ import annotations

from itertools import groupby
from operator import attrgetter, itemgetter

from kachaka_simple_control.motion.plan import Plan

#: More corners than these are thinned out.
MAX_CORNERS = 3000
#: Columns in each of which the first, lowest, highest and last corner stay.
COLUMNS = 600

Corner = tuple[float, float]


def staircase(plan: Plan, component: str) -> list[Corner]:
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


def _thinned(corners: list[Corner]) -> list[Corner]:
    # What is drawn in a column of the picture reaches from its lowest value to its highest, and
    # joins its neighbours with the first and the last: the picture stays the same.
    width = corners[-1][0] / COLUMNS
    thinned: list[Corner] = []
    for _, column in groupby(corners, key=lambda corner: int(corner[0] / width)):
        found = list(column)
        height = itemgetter(1)
        thinned += sorted({
            found[0], min(found, key=height), max(found, key=height), found[-1]})
    return thinned
