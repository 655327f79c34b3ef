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
"""Median, percentile and largest of some numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantiles:
    """The median, the 99th percentile and the largest of some numbers."""

    median: float
    p99: float
    worst: float


def quantiles(values: Sequence[float]) -> Quantiles | None:
    """Return the quantiles of numbers in any order; None if there are none."""
    if not values:
        return None
    ordered = sorted(values)
    return Quantiles(median(ordered), quantile(ordered, 0.99), ordered[-1])


def quantile(values: Sequence[float], part: float) -> float:
    """
    Return the value below which a part of the values lies.

    :param values: at least one number, in any order; may contain infinity
    :param part: from 0, the least, to 1, the greatest
    :returns: the value, interpolated between the two nearest
    """
    ordered = sorted(values)
    place = part * (len(ordered) - 1)
    below = min(int(place), len(ordered) - 1)
    above = min(below + 1, len(ordered) - 1)
    if place <= below or ordered[above] == ordered[below]:
        return ordered[below]  # the difference of two infinities is no number
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def median(values: Sequence[float]) -> float:
    """Return the median of at least one number, in any order."""
    return quantile(values, 0.5)
