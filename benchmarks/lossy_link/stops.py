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
"""Measure the arrival of a stop during a motion with packet loss; one process sends all stops."""

from __future__ import annotations

import random
import time
from typing import Any

from benchmarks.lossy_link.fixture import Fixture, LOG_LATENCY
from benchmarks.lossy_link.observed import evaluate_stop
from benchmarks.lossy_link.process import NetworkProcess
from benchmarks.progress import show

RATE = 10
VELOCITY = 0.1
#: The duration of a movement that the stop ends [s].
DURATION = 20.0
#: The longest time until the robot is found and moved [s].
MOTION_TIMEOUT = 25.0


def measure_stops(fixture: Fixture, percent: int, count: int) -> dict[str, Any]:
    """
    Stop the robot several times with packet loss after discovery.

    :param fixture: the network and the robot
    :param percent: the packet loss [%]
    :param count: the number of stops
    :returns: the packet counts, an entry for each stop, and the reasons of movements that ended
        before their stop
    """
    entries: list[dict[str, Any]] = []
    faults: list[str] = []
    fixture.network.set_loss(0)
    with fixture.start_driver(RATE) as driver:
        fixture.connect(driver)
        fixture.network.set_loss(percent)
        while len(entries) < count and len(faults) < count:
            entry = stop_once(fixture, driver)
            if 'zeros' in entry:
                entries.append(entry)
                show(f'stops at {percent} % loss', len(entries), count)
            else:
                faults.append(entry['fault'])
                driver.ask('renew_node')
        lost, arrived = fixture.network.packet_counts()
        fixture.network.set_loss(0)
    return {'percent': percent, 'lost': lost, 'arrived': arrived, 'stops': entries,
            'faults': faults}


def stop_once(fixture: Fixture, driver: NetworkProcess) -> dict[str, Any]:
    """
    Move the robot, and stop it at a random time between two messages.

    :param fixture: the network and the robot
    :param driver: the driving program
    :returns: the results of the stop, or the ``fault`` if the movement ended before the stop
    """
    begin = time.monotonic()
    driver.write(['move', VELOCITY, DURATION])
    first = fixture.wait_for_motion(begin, MOTION_TIMEOUT)
    if first is None:
        return {'fault': driver.ask('stop')['ended by'] or 'nothing moved'}
    time.sleep(random.uniform(0.05, 0.25))
    stopped = driver.ask('stop')
    time.sleep(LOG_LATENCY)
    if 'stop_robot()' not in (stopped['ended by'] or ''):
        return {'fault': stopped['ended by'] or 'the movement ended early'}
    return {'until moved': first.time - begin, 'confirmed': stopped['confirmed'],
            **evaluate_stop(fixture.log, stopped['began'])}
