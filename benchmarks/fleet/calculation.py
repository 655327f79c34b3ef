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
"""Calculate what fleets cost that this machine cannot carry, from those that were measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

from kachaka_simple_control.files.fleet_file import MAX_ROBOTS

#: The numbers of robots in the table.
SIZES = (1, 2, 5, 10, 20, 50, 100, 200, 255, 500, 1000)
#: Participants of a program: itself and its guardian.
OWN_PARTICIPANTS = 2
#: How the figures of the table that were not measured are calculated.
SENTENCE = (
    'Calculated (≈): CPU time and memory lie on the line through the two nearest sizes that were '
    f'measured; beyond {MAX_ROBOTS} robots, as many programs as are needed share them evenly; '
    'each program adds 2 participants, and each robot one, where its bridge runs on the robot; '
    'what is sent until all have found each other, and afterwards, grows with the square of the '
    'participants, from the largest number that was measured.')


@dataclass(frozen=True)
class Cost:
    """
    What a number of robots costs.

    :param cpu: of programs and guardians together [% of a core]
    :param memory: the same [MB]
    :param participants: of programs, guardians and robots, each with a bridge of its own
    :param finding: what is sent until all have found each other [MB]; None if none was measured
    :param traffic: afterwards, while all stand by [kB/s]; the same
    :param is_measured: whether CPU and memory were
    """

    robots: int
    programs: int
    cpu: float
    memory: float
    participants: int
    finding: float | None
    traffic: float | None
    is_measured: bool


def on_line(size: int, known: Sequence[tuple[int, float]]) -> float:
    """
    Return the value at a size on the line through the two nearest of those that are known.

    :param known: sizes and values in order of size, at least two
    """
    above = next((number for number, (known_size, _) in enumerate(known) if known_size >= size),
                 len(known) - 1)
    (first, low), (second, high) = known[max(0, above - 1)], known[max(1, above)]
    return low + (high - low) * (size - first) / (second - first)


def costs(
        drives: Sequence[dict[str, Any]], standing_by: Sequence[dict[str, Any]]) -> list[Cost]:
    """
    Return the cost of each size of the table; of none, if fewer than two were measured.

    :param drives: of fleets of several sizes that drive
    :param standing_by: what was counted while programs stood by
    """
    measured = sorted((entry for entry in drives if 'cpu' in entry),
                      key=lambda entry: int(entry['robots']))
    if len(measured) < 2:
        return []
    known = {key: [(entry['robots'], value(entry)) for entry in measured] for key, value in (
        ('cpu', lambda entry: entry['cpu'] + entry['guardian_cpu']),
        ('memory', lambda entry: entry['memory']))}
    sizes = {entry['robots'] for entry in measured}
    found = []
    for robots in sorted({*SIZES, *sizes}):
        programs = math.ceil(robots / MAX_ROBOTS)
        shares = [robots // programs + (number < robots % programs) for number in range(programs)]
        cpu, memory = (sum(on_line(share, known[key]) for share in shares)
                       for key in ('cpu', 'memory'))
        participants = OWN_PARTICIPANTS * programs + robots
        found.append(Cost(
            robots, programs, cpu, memory, participants, *discovery(participants, standing_by),
            robots in sizes))
    return found


def discovery(
        participants: int, standing_by: Sequence[dict[str, Any]]) -> tuple[
            float | None, float | None]:
    """Return the traffic to find each other [MB], and afterwards [kB/s]; None: not measured."""
    most = max(standing_by, key=lambda entry: int(entry['participants']), default=None)
    if most is None or not most['participants']:
        return None, None
    ratio = (participants / float(most['participants'])) ** 2
    return most['found_size'] / 1e6 * ratio, most['size'] / 1e3 * ratio
