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
"""Compute movements, displacement and timing from the messages that a receiver got."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.analysis.message_timing import LATE, LOST


class Row(NamedTuple):
    """A message: the time at which it was sent [s], and its forward velocity [m/s]."""

    time: float
    velocity: float


@dataclass(frozen=True)
class Ticks:
    """The number of ticks of a movement; a tick is due every period from the first message on."""

    due: int
    late: int
    lost: int


def movements(rows: Iterable[Row]) -> list[list[Row]]:
    """Split messages into movements; a movement has one nonzero velocity."""
    found: list[list[Row]] = []
    current: list[Row] | None = None
    for row in rows:
        if current is not None:
            current.append(row)
            if row.velocity == current[0].velocity:
                continue
        current = [row] if row.velocity else None
        if current is not None:
            found.append(current)
    return found


def displacement(rows: Sequence[Row]) -> float:
    """Return the displacement of who holds each velocity until the next message [m]."""
    return math.fsum(one.velocity * (two.time - one.time) for one, two in pairwise(rows))


def relative_error(rows: Sequence[Row], duration: float) -> float:
    """Return the relative error of the displacement of a movement; positive if too long."""
    return displacement(rows) / (rows[0].velocity * duration) - 1.0


def jitters(rows: Sequence[Row], period: float) -> list[float]:
    """Return the absolute differences between the message intervals and the period [s]."""
    return [abs(two.time - one.time - period) for one, two in pairwise(rows[:-1])]


def ticks(rows: Sequence[Row], period: float, duration: float) -> Ticks:
    """Count the ticks of a movement."""
    due = round(duration / period)
    nearest = [math.inf] * due
    for row in rows[:-1]:
        place = (row.time - rows[0].time) / period
        tick = round(place)
        if tick < due:
            nearest[tick] = min(nearest[tick], abs(place - tick))
    lost = sum(distance > LOST for distance in nearest)
    return Ticks(due, sum(distance >= LATE for distance in nearest) - lost, lost)
