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
"""Middle, tail and extremes of some numbers; pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantiles:
    """
    What some numbers come to.

    :param median: half of them are smaller
    :param p99: 99 of 100 are smaller
    :param worst: none is larger
    """

    median: float
    p99: float
    worst: float


def quantiles(values: Sequence[float]) -> Quantiles | None:
    """
    Return what some numbers come to.

    :param values: the numbers, in any order
    :returns: the smallest number that is not below the given part of them; None if there are none
    """
    if not values:
        return None
    ordered = sorted(values)

    def at(percent: int) -> float:
        return ordered[max(0, -(-percent * len(ordered) // 100) - 1)]
    return Quantiles(at(50), at(99), ordered[-1])
