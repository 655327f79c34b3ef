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
"""Measure the duration of a request for manual control with packet loss."""

from __future__ import annotations

from typing import Any

from benchmarks.lossy_link.fixture import Fixture
from benchmarks.progress import show

RATE = 10


def measure_requests(fixture: Fixture, percent: int, count: int) -> dict[str, Any]:
    """
    Request manual control once, like a long run, and repeatedly, like a node at its start.

    :param fixture: the network and the robot
    :param percent: the packet loss [%]
    :param count: the number of requests of each kind
    :returns: the time to each response [s]; None if there was no response
    """
    times: dict[bool, list[float | None]] = {False: [], True: []}
    fixture.network.set_loss(0)
    with fixture.start_driver(RATE) as driver:
        fixture.connect(driver)
        driver.ask('request_control', True)
        fixture.network.set_loss(percent)
        for number in range(1, count + 1):
            for repeatedly, taken in times.items():
                taken.append(driver.ask('request_control', repeatedly))
            show(f'answers at {percent} % loss', number, count)
        fixture.network.set_loss(0)
    return {'percent': percent, 'once': times[False], 'repeatedly': times[True]}
