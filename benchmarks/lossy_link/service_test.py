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
"""Ask for manual control on a link that loses packets: a service answers late there."""

from __future__ import annotations

from typing import Any

from benchmarks.lossy_link.fixture import Rig
from benchmarks.progress import show

RATE = 10


def measure_answers(rig: Rig, percent: int, count: int) -> dict[str, Any]:
    """
    Ask once, as a long run does that renews manual control, and as a node does at the start.

    :param rig: network and robot
    :param percent: how many of a hundred packets are lost
    :param count: how often in each way
    :returns: how long each answer took [s]; None where none came
    """
    times: dict[bool, list[float | None]] = {False: [], True: []}
    rig.network.lose(0)
    with rig.driver(RATE) as driver:
        rig.meet(driver)
        driver.ask('ask', True)
        rig.network.lose(percent)
        for number in range(1, count + 1):
            for repeatedly, taken in times.items():
                taken.append(driver.ask('ask', repeatedly))
            show(f'answers at {percent} % loss', number, count)
        rig.network.lose(0)
    return {'percent': percent, 'once': times[False], 'repeatedly': times[True]}
