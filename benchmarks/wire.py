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
"""What a receiver was told, worked out from the messages it saw; pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.report.metrics import LATE, LOST


class Row(NamedTuple):
    """
    One message.

    :param time: when it was sent [s]
    :param velocity: what it carried [m/s]
    """

    time: float
    velocity: float


@dataclass(frozen=True)
class Ticks:
    """
    How the messages of a movement stand to the times at which they were due.

    :param due: how many there should be, one every period from the first on
    :param late: how many came, but a quarter of a period or more from their time
    :param lost: for how many nothing came within half a period of their time
    """

    due: int
    late: int
    lost: int


def movements(rows: Iterable[Row]) -> list[list[Row]]:
    """
    Cut messages into movements.

    :param rows: the messages, in order of time
    :returns: for each stretch of one velocity other than zero its messages, and the one after
        them that ended it; a stretch that nothing ended is left as it is
    """
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
    """
    Return how far a receiver goes that holds each velocity until the next.

    :param rows: the messages, in order; the last one only ends the one before
    :returns: the sum of velocity times interval [m]
    """
    return math.fsum(one.velocity * (two.time - one.time) for one, two in pairwise(rows))


def relative_error(rows: Sequence[Row], duration: float) -> float:
    """
    Return by how much a movement is too long (positive) or too short.

    :param rows: its messages and the one that ended it
    :param duration: how long it should be held [s]
    :returns: the error of the displacement, as a part of the displacement asked for
    """
    return displacement(rows) / (rows[0].velocity * duration) - 1.0


def jitters(rows: Sequence[Row], period: float) -> list[float]:
    """
    Return how far each interval is from the period.

    :param rows: the messages of a movement and the one that ended it, which is no tick
    :param period: how long an interval should be [s]
    :returns: the differences, all positive [s]
    """
    return [abs(two.time - one.time - period) for one, two in pairwise(rows[:-1])]


def ticks(rows: Sequence[Row], period: float, duration: float) -> Ticks:
    """
    Count what came when it was due.

    :param rows: the messages of a movement and the one that ended it
    :param period: the time between two ticks [s]
    :param duration: how long the movement should be held [s]
    :returns: the counts
    """
    due = round(duration / period)
    nearest = [math.inf] * due
    for row in rows[:-1]:
        place = (row.time - rows[0].time) / period
        tick = round(place)
        if tick < due:
            nearest[tick] = min(nearest[tick], abs(place - tick))
    lost = sum(distance > LOST for distance in nearest)
    return Ticks(due, sum(distance >= LATE for distance in nearest) - lost, lost)
