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
"""Move for a second, again and again: how far the robot drove."""

from __future__ import annotations

import time
from typing import Any

from benchmarks.lossy_link.fixture import Rig, STILL
from benchmarks.progress import show

VELOCITY = 0.1
DURATION = 1.0
RATES = (10, 50)


def measure_moves(rig: Rig, percent: int, rate: int, count: int) -> dict[str, Any]:
    """
    Make movements, on a link that began to lose packets after the match.

    :param rig: network and robot
    :param percent: how many of a hundred packets are lost
    :param rate: how often a velocity is sent [Hz]
    :param count: how many movements
    :returns: for each movement what was driven, as a part of what was asked for; and why
        movements were given up
    """
    driven: list[float] = []
    faults: list[str] = []
    rig.network.lose(0)
    with rig.driver(rate) as driver:
        rig.meet(driver)
        rig.network.lose(percent)
        while len(driven) < count and len(faults) < count:
            begin = time.monotonic()
            driver.tell('move', VELOCITY * (-1) ** len(driven), DURATION)
            ended_by = driver.ask('wait')['ended by']
            time.sleep(STILL)
            if ended_by is None:
                driven.append(rig.log.driven(begin)[0] / (VELOCITY * DURATION))
                show(f'movements at {percent} % loss and {rate} Hz', len(driven), count)
            else:
                faults.append(ended_by)
                driver.ask('renew')
        rig.network.lose(0)
    return {'percent': percent, 'rate': rate, 'driven': driven, 'faults': faults}
