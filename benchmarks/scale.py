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
"""How much is measured."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scale:
    """
    The extent of a run.

    :param moves: for each rate [Hz], how many movements of one second each loop makes
    :param loaded: the same, while the machine is busy
    :param busy: how many busy processes make it so
    :param turn: how many movements a loop makes before it is the next one's turn
    :param starts: how many times our program is started and then stopped by a signal
    :param killed: how many times it is killed, and how many times it is frozen
    :param others: how many times each of the other programs gets a signal
    :param signals: how many signals one process gets
    :param firsts: how often the beginning of the lesson is played to a robot that is there
    :param late: how often to a robot that comes late
    :param plans: how long the motions are that are planned [s]
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
#: For a first look, and for continuous integration.
QUICK = Scale(
    moves={10: 4, 100: 4, 1000: 1},
    loaded={100: 2}, busy=2, turn=2, starts=3, killed=2, others=1, signals=10,
    firsts=1, late=1, plans=(360, 3600))
