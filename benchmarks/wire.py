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
"""Movements, displacement and timing, from the messages that a receiver got; pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from typing import NamedTuple

from kachaka_simple_control.analysis.message_timing import LATE, LOST


class Row(NamedTuple):
    """A message: when it was sent [s], and its forward velocity [m/s]."""

    time: float
    velocity: float


@dataclass(frozen=True)
class Ticks:
    """
    The ticks of a movement, one every period from the first message on.

    :param due: number of ticks
    :param late: number with the nearest message a quarter of a period or more from its time
    :param lost: number without a message within half a period of its time
    """

    due: int
    late: int
    lost: int


def movements(rows: Iterable[Row]) -> list[list[Row]]:
    """
    Cut messages into movements of one velocity other than zero.

    :param rows: the messages, in order of time
    :returns: of each movement its messages and, if there is one, the next, which ended it
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
    Return the displacement of a receiver that holds each velocity until the next [m].

    :param rows: the messages, in order; the last one only ends the one before
    """
    return math.fsum(one.velocity * (two.time - one.time) for one, two in pairwise(rows))


def relative_error(rows: Sequence[Row], duration: float) -> float:
    """
    Return the relative error of the displacement of a movement; positive if it is too long.

    :param rows: its messages and the one that ended it
    :param duration: of the movement asked for [s]
    """
    return displacement(rows) / (rows[0].velocity * duration) - 1.0


def jitters(rows: Sequence[Row], period: float) -> list[float]:
    """
    Return the absolute differences between intervals and period [s].

    :param rows: the messages of a movement and the one that ended it, which is no tick
    :param period: the time between two ticks [s]
    """
    return [abs(two.time - one.time - period) for one, two in pairwise(rows[:-1])]


def ticks(rows: Sequence[Row], period: float, duration: float) -> Ticks:
    """
    Count the ticks of a movement.

    :param rows: the messages of the movement and the one that ended it
    :param period: the time between two ticks [s]
    :param duration: of the movement asked for [s]
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
