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
"""
Whether a robot drives after ``~/run`` and ``~/stop`` of one client; ``python -m`` runs this.

Each pair is sent 0 to 10 ms apart, in either order, to a command that stands by with a simulated
robot.  When both are answered, nothing may move.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import random
import sys
import tempfile
import time
from typing import Any

from benchmarks.experiments.driven_robot import Observer
from benchmarks.progress import show
from kachaka_simple_control.control.timing import STOP_REQUEST_WINDOW
from kachaka_simple_control.ros.dds_transport import PROFILES, RANGE
from program import Program, quick_drive
from ros_domain import use_own_domain
from waiting import poll, wait_until

NODE = '/kachaka_simple_control'
#: The longest time between the two requests of a pair [s].
MAX_DELAY = 0.01
#: The time to look for a motion after both answers [s]; a robot is taken again within 1 s.
LOOK_TIME = 2.0
#: The wait before a pair [s], until the stop of the last pair and its window are over.
PAUSE = 1.0


class Client:
    """Calls the services of the node."""

    def __init__(self, observer: Observer) -> None:
        from std_srvs.srv import Trigger
        self._request = Trigger.Request
        self._clients = {
            name: observer.node.create_client(Trigger, f'{NODE}/{name}')
            for name in ('run', 'stop')}
        for client in self._clients.values():
            assert client.wait_for_service(20.0), client.srv_name

    def call(self, name: str) -> dict[str, Any]:
        """Call a service; return a dictionary that receives the answer and its time [s]."""
        called: dict[str, Any] = {}
        future = self._clients[name].call_async(self._request())
        future.add_done_callback(
            lambda future: called.update(time=time.time(), answer=future.result()))
        return called


def pair(observer: Observer, client: Client, names: list[str], delay: float) -> tuple[bool, str]:
    """
    Call both services, and check that no motion follows.

    :param names: the names of the services, in order
    :param delay: the time between the calls [s]
    :returns: whether the run was accepted, and what was wrong as text
    """
    called = {names[0]: client.call(names[0])}
    time.sleep(delay)
    called[names[1]] = client.call(names[1])
    wait_until(lambda: all('answer' in each for each in called.values()))
    answered = time.time()
    moves = poll(lambda: any(when > answered and velocity for when, velocity in observer.ours),
                 LOOK_TIME)
    run, stop = called['run'], called['stop']
    # If the machine stalled, the run may be accepted long after the stop; that run is valid.
    is_beside = run['time'] - stop['time'] < STOP_REQUEST_WINDOW
    if not stop['answer'].success:
        return run['answer'].success, f'the stop failed: {stop["answer"].message}'
    return run['answer'].success, 'it drives' if moves and is_beside else ''


def main(arguments: list[str] | None = None) -> int:
    """Measure and print the results; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--pairs', type=int, default=200)
    options = parser.parse_args(arguments)
    use_own_domain()
    os.environ[RANGE] = 'LOCALHOST'
    for name in PROFILES.values():
        os.environ.pop(name, None)
    numbers, accepted, failures = random.Random(26), 0, []
    with tempfile.TemporaryDirectory() as folder:
        command = quick_drive(Path(folder), '--wait', '--sim', duration=60.0)
        # Without the test parameters for a quick start: with the guardian, as in normal use.
        with Program(command[:command.index('--ros-args')]) as node:
            node.wait_for_text('Standing by')
            observer = Observer()
            client = Client(observer)
            client.call('run')
            wait_until(lambda: any(velocity for _, velocity in observer.ours))
            for number in range(1, options.pairs + 1):
                client.call('stop')
                time.sleep(PAUSE)
                observer.ours.clear()
                names = numbers.sample(['run', 'stop'], 2)
                delay = numbers.uniform(0.0, MAX_DELAY)
                was_accepted, failure = pair(observer, client, names, delay)
                accepted += was_accepted
                if failure:
                    failures.append(failure)
                    print(f'{" ".join(names)}, {delay * 1e3:.1f} ms: {failure}')
                show('pairs', number, options.pairs)
    print(f'runs accepted: {accepted} of {options.pairs}; '
          f'drives afterwards: {len(failures)} of {options.pairs}')
    print('MISSED' if failures else 'kept')
    return int(bool(failures))


if __name__ == '__main__':
    sys.exit(main())
