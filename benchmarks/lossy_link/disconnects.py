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
"""Measure node and robot when the network is disconnected during a motion and reconnected."""

from __future__ import annotations

from collections.abc import Callable
import random
import time
from typing import Any

from benchmarks.lossy_link.fixture import Fixture
from benchmarks.lossy_link.network import NODE
from benchmarks.lossy_link.process import NetworkProcess
from benchmarks.progress import show

#: The lesson's program, started like a user starts it.
COMMAND = ['-m', 'kachaka_simple_control']
#: The time of the reconnect: after the disconnect, or, if this is None, after the end of the
#: program [s].  The kernel keeps undelivered packets for 3 s while it resolves the robot's
#: address.
CASES: dict[str, tuple[float | None, float]] = {
    'after 0.6 s': (0.6, 0.0), 'after 1.2 s, while the node stops': (1.2, 0.0),
    'at once when the program has ended': (None, 0.0),
    '5 s after the program has ended': (None, 5.0)}
#: The time of observing the robot after the end of the program and the reconnect [s].
OBSERVATION_TIME = 2.0
#: The longest time until the program moves the robot, and until its end [s].
PROGRAM_TIMEOUT = 30.0


def measure_disconnects(fixture: Fixture, count: int) -> list[dict[str, Any]]:
    """Disconnect the network ``count`` times in each case; return an entry for each disconnect."""
    entries = []
    for case in CASES:
        for number in range(1, count + 1):
            entries.append(disconnect_once(fixture, case))
            show(f'cable back {case}', number, count)
    return entries


def disconnect_once(fixture: Fixture, case: str) -> dict[str, Any]:
    """
    Disconnect the network in the lesson's first turn, and reconnect it.

    :param fixture: the network and the robot
    :param case: the name of the case, which sets the time of the reconnect
    :returns: the times from the disconnect until the robot was at rest (``still``) and until the
        program ended (``ended``) [s]; the angle that the robot turned before the reconnect
        [rad]; the exit code and the messages of the program; the number of motion commands that
        reached the robot after the reconnect, and the angle that it turned then [rad]
    """
    network, log = fixture.network, fixture.log
    network.set_loss(0)
    with NetworkProcess(network, NODE, COMMAND) as program:
        if fixture.wait_for_motion(time.monotonic(), PROGRAM_TIMEOUT,
                                   lambda velocity: velocity.angular_z != 0.0) is None:
            raise RuntimeError(f'the program did not turn the robot:\n{program.text}')
        time.sleep(random.uniform(0.2, 0.4))
        begin = time.monotonic()
        network.disconnect()
        back, code, ended = _reconnect(fixture, program, begin, *CASES[case])
        time.sleep(OBSERVATION_TIME)
        return {
            'case': case, 'still': log.at_rest_since(begin, back) - begin,
            'turned': log.driven(begin, back)[1],
            'ended': ended - begin, 'code': code, 'said': messages(program.text),
            'motions': len(log.motions_since(back)), 'moved': log.driven(back)[1],
            'taken': len(log.enabled_since(begin))}


def messages(text: str) -> list[str]:
    """Return the printed lines of a program, without its log lines."""
    return [line for line in text.splitlines() if line and not line.startswith('[')]


def _reconnect(
        fixture: Fixture, program: NetworkProcess, begin: float, after: float | None,
        later: float) -> tuple[float, int | None, float]:
    """Reconnect the network; return its time [s], the program's exit code and end time [s]."""
    back = None
    if after is not None:
        time.sleep(max(0.0, begin + after - time.monotonic()))
        back = _timed(fixture.network.connect)
    code, ended = program.code_within(PROGRAM_TIMEOUT), time.monotonic()
    if back is None:
        time.sleep(later)
        back = _timed(fixture.network.connect)
    return back, code, ended


def _timed(action: Callable[[], None]) -> float:
    """Call a function; return the time before the call [s]."""
    now = time.monotonic()
    action()
    return now
