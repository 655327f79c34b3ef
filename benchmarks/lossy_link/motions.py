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
"""Measure the distance that the robot drives in movements of 1 s with packet loss."""

from __future__ import annotations

import time
from typing import Any

from benchmarks.lossy_link.fixture import Fixture, REST_TIME
from benchmarks.progress import show

VELOCITY = 0.1
DURATION = 1.0
RATES = (10, 50)


def measure_motions(fixture: Fixture, percent: int, rate: int, count: int) -> dict[str, Any]:
    """
    Make movements with packet loss after discovery.

    :param fixture: the network and the robot
    :param percent: the packet loss [%]
    :param rate: the rate of velocity messages [Hz]
    :param count: the number of movements
    :returns: the driven distance of each movement relative to the requested distance, and the
        reasons of failed movements
    """
    driven: list[float] = []
    faults: list[str] = []
    fixture.network.set_loss(0)
    with fixture.start_driver(rate) as driver:
        fixture.connect(driver)
        fixture.network.set_loss(percent)
        while len(driven) < count and len(faults) < count:
            begin = time.monotonic()
            driver.write(['move', VELOCITY * (-1) ** len(driven), DURATION])
            ended_by = driver.ask('wait')['ended by']
            time.sleep(REST_TIME)
            if ended_by is None:
                driven.append(fixture.log.driven(begin)[0] / (VELOCITY * DURATION))
                show(f'movements at {percent} % loss and {rate} Hz', len(driven), count)
            else:
                faults.append(ended_by)
                driver.ask('renew_node')
        fixture.network.set_loss(0)
    return {'percent': percent, 'rate': rate, 'driven': driven, 'faults': faults}
