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
"""How much a run of the fleet benchmark measures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scale:
    """
    How much is measured.

    :param in_step: the robots that drive the square
    :param odometry: the rates of odometry of these drives [Hz]; 0: without
    :param cut: after how long these drives are interrupted [s]; None to let them end
    :param fleets: the sizes of the fleets whose cost is measured; the last is judged for time
    :param moves: how many movements of a second they drive
    :param programs: the numbers of programs of one robot to compare with
    :param stopped: the robots of fleets that something stops
    :param signals: how often each signal stops one
    :param guardians: how often its guardian is killed
    :param bridges: how often the bridge of one robot is killed, with ``stop_all``
    :param go_on: the same with ``go_on``
    :param pauses: how many drives are paused
    :param has_square: whether these drive the square, and not only one of its corners
    :param pause: for how long [s]
    :param halves: the robots of each of the two fleets in namespaces
    """

    in_step: int
    odometry: tuple[float, ...]
    cut: float | None
    fleets: tuple[int, ...]
    moves: int
    programs: tuple[int, ...]
    stopped: int
    signals: int
    guardians: int
    bridges: int
    go_on: int
    pauses: int
    has_square: bool
    pause: float
    halves: int


FULL = Scale(
    in_step=50, odometry=(10.0, 0.0, 50.0), cut=None, fleets=(1, 10, 50, 200), moves=10,
    programs=(1, 10, 20), stopped=50, signals=20, guardians=5, bridges=5, go_on=2, pauses=3,
    has_square=True, pause=3.0, halves=10)
#: For a short run, and for continuous integration.
QUICK = Scale(
    in_step=20, odometry=(10.0,), cut=5.0, fleets=(20,), moves=3, programs=(), stopped=10,
    signals=1, guardians=1, bridges=1, go_on=0, pauses=1,
    has_square=False, pause=2.0, halves=3)
