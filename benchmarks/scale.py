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
"""The number of measurements of a run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scale:
    """
    The number of measurements of each kind.

    :param moves: the number of 1 s movements of each loop, by rate [Hz]
    :param loaded: the number of 1 s movements of each loop on a loaded machine, by rate [Hz]
    :param busy: the number of busy processes that load the machine
    :param turn: the number of movements of a loop in each turn
    :param starts: the number of starts of this package's program, each ended by a signal
    :param killed: the number of starts that SIGKILL ends, and the number that SIGSTOP freezes
    :param others: the number of starts of each other program, each ended by a signal
    :param signals: the number of signals to one process
    :param firsts: the number of starts of the lesson with a robot that is ready
    :param late: the number of starts of the lesson with a robot that starts later
    :param plans: the durations of the planned motions [s]
    """

    moves: dict[int, int]
    loaded: dict[int, int]
    busy: int
    turn: int
    starts: int
    killed: int
    others: int
    signals: int
    firsts: int
    late: int
    plans: tuple[int, ...]


FULL = Scale(
    moves={10: 50, 20: 50, 50: 50, 100: 50, 200: 5, 500: 5, 1000: 5},
    loaded={10: 5, 100: 5}, busy=2, turn=10, starts=20, killed=20, others=6, signals=200,
    firsts=6, late=3, plans=(360, 3600, 36000))
#: The scale for a short run, and for continuous integration.
QUICK = Scale(
    moves={10: 4, 100: 4, 1000: 1},
    loaded={100: 2}, busy=2, turn=2, starts=3, killed=2, others=1, signals=10,
    firsts=1, late=1, plans=(360, 3600))
