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
"""Stop in mid-motion, again and again, from one process, and see what reaches the robot."""

from __future__ import annotations

import random
import time
from typing import Any

from benchmarks.lossy_link.fixture import Rig, SAID
from benchmarks.lossy_link.observed import after_stop
from benchmarks.lossy_link.process import Process
from benchmarks.progress import show

RATE = 10
VELOCITY = 0.1
#: Longer than anybody waits: the movement is to be ended by the stop [s].
LONG = 20.0
#: How long the robot may take to be found, taken and moved [s].
PATIENCE = 25.0


def measure_stops(rig: Rig, percent: int, count: int) -> dict[str, Any]:
    """
    Stop many times, on a link that began to lose packets after the match.

    :param rig: network and robot
    :param percent: how many of a hundred packets are lost
    :param count: how many stops
    :returns: the packets counted, an entry for each stop, and why movements ended by themselves
    """
    entries: list[dict[str, Any]] = []
    faults: list[str] = []
    rig.network.lose(0)
    with rig.driver(RATE) as driver:
        rig.meet(driver)
        rig.network.lose(percent)
        while len(entries) < count and len(faults) < count:
            entry = stop_once(rig, driver)
            if 'zeros' in entry:
                entries.append(entry)
                show(f'stops at {percent} % loss', len(entries), count)
            else:
                faults.append(entry['fault'])
                driver.ask('renew')
        lost, arrived = rig.network.counts()
        rig.network.lose(0)
    return {'percent': percent, 'lost': lost, 'arrived': arrived, 'stops': entries,
            'faults': faults}


def stop_once(rig: Rig, driver: Process) -> dict[str, Any]:
    """
    Move, and stop at any time between two messages.

    :param rig: network and robot
    :param driver: the program that drives
    :returns: what came of the stop; or, if the movement ended before it, why
    """
    begin = time.monotonic()
    driver.tell('move', VELOCITY, LONG)
    first = rig.motion(begin, PATIENCE)
    if first is None:
        return {'fault': driver.ask('stop')['ended by'] or 'nothing moved'}
    time.sleep(random.uniform(0.05, 0.25))
    stopped = driver.ask('stop')
    time.sleep(SAID)
    if 'stop_robot()' not in (stopped['ended by'] or ''):
        return {'fault': stopped['ended by'] or 'the movement ended early'}
    return {'until moved': first.time - begin, 'confirmed': stopped['confirmed'],
            **after_stop(rig.log, stopped['began'])}
