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
"""Pull the cable in mid-motion, put it back, and see what both ends do."""

from __future__ import annotations

from collections.abc import Callable
import random
import time
from typing import Any

from benchmarks.lossy_link.fixture import Rig
from benchmarks.lossy_link.network import NODE
from benchmarks.lossy_link.process import Process
from benchmarks.progress import show

#: The lesson's program, as a person starts it.
COMMAND = ['-m', 'kachaka_simple_control']
#: When the cable comes back: so long after it was pulled, and so long after the program ended [s].
#: The kernel keeps what it cannot deliver for 3 s, in the hope of finding the robot's address.
CASES: dict[str, tuple[float | None, float]] = {
    'after 0.6 s': (0.6, 0.0), 'after 1.2 s, while the node stops': (1.2, 0.0),
    'at once when the program has ended': (None, 0.0),
    '5 s after the program has ended': (None, 5.0)}
#: How long the robot is watched after program and cable are done [s].
WATCHED = 2.0
#: How long the program may take to move the robot, and to end [s].
PATIENCE = 30.0


def measure_cable(rig: Rig, count: int) -> list[dict[str, Any]]:
    """
    Pull the cable in each case.

    :param rig: network and robot
    :param count: how often in each
    :returns: an entry for each time
    """
    entries = []
    for case in CASES:
        for number in range(1, count + 1):
            entries.append(pull_once(rig, case))
            show(f'cable back {case}', number, count)
    return entries


def pull_once(rig: Rig, case: str) -> dict[str, Any]:
    """
    Pull the cable in the lesson's first turn, and put it back.

    :param rig: network and robot
    :param case: when it comes back
    :returns: times since the cable was pulled [s]: when the robot stood still, when the program
        ended; by how much the robot turned in that time [rad]; the program's exit code and its
        words; what reached the robot once the cable was back, and by how much it turned then
    """
    rig.network.lose(0)
    with Process(rig.network, NODE, COMMAND) as program:
        if rig.motion(time.monotonic(), PATIENCE, lambda told: told.angular_z != 0.0) is None:
            raise RuntimeError(f'the program did not turn the robot:\n{program.text}')
        time.sleep(random.uniform(0.2, 0.4))
        pulled = time.monotonic()
        rig.network.pull()
        back, code, ended = _plug(rig, program, pulled, *CASES[case])
        time.sleep(WATCHED)
        motions = rig.log.motions_from(back)
        return {
            'case': case, 'still': rig.log.still_from(pulled, back) - pulled,
            'turned': rig.log.driven(pulled, back)[1],
            'ended': ended - pulled, 'code': code, 'said': last_words(program.text),
            'motions': len(motions), 'moved': rig.log.driven(back)[1],
            'taken': len(rig.log.enabled_from(pulled))}


def last_words(text: str) -> list[str]:
    """
    Return what the program said to the person who started it, beside its log.

    :param text: all that it printed
    :returns: its lines
    """
    return [line for line in text.splitlines() if line and not line.startswith('[')]


def _plug(
        rig: Rig, program: Process, pulled: float, after: float | None, later: float,
) -> tuple[float, int | None, float]:
    """Put the cable back in time; return when, the program's exit code, and when that came."""
    back = None
    if after is not None:
        time.sleep(max(0.0, pulled + after - time.monotonic()))
        back = _timed(rig.network.plug)
    code, ended = program.end(PATIENCE), time.monotonic()
    if back is None:
        time.sleep(later)
        back = _timed(rig.network.plug)
    return back, code, ended


def _timed(do: Callable[[], None]) -> float:
    """Do something; return when it began [s]."""
    now = time.monotonic()
    do()
    return now
