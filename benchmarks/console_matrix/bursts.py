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
"""A lag and then a burst, with a client that goes on sending whatever happens."""

from __future__ import annotations

from dataclasses import dataclass, replace
import random
import threading
import time

from benchmarks.console_matrix.faults import LAG, LATENCY, SETTLING_TIME, TIME_TO_FAULT
from benchmarks.console_matrix.proxy import Proxy
from benchmarks.console_matrix.raw_client import RawClient
from benchmarks.console_matrix.stage import Stage
from benchmarks.console_matrix.trial import Expectation, hand_trial, SpoiltError, Trial

VELOCITY = 0.1
PERIOD = 0.05


class _Hand:
    """Sends a velocity with the newest stamp 20 times a second, in a thread."""

    def __init__(self, client: RawClient) -> None:
        self._client = client
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._is_over.set()
        self._thread.join(5.0)

    def _run(self) -> None:
        self._client.hand(0.0)
        while not self._is_over.wait(PERIOD):
            self._client.hand(VELOCITY)


@dataclass(frozen=True)
class BurstRow:
    """
    A row in which a client's velocities are held back for 1 s, and then delivered all at once.

    A page notices a lag and ends its hold; this client does neither, and the newest stamps of its
    burst are fresh.
    """

    expectation: Expectation
    full: int = 20
    quick: int = 1

    def run(self, stage: Stage) -> Trial:
        """Run one trial."""
        stage.leave_page()
        console = stage.console
        client = RawClient(console.port, address=Proxy.ADDRESS).greet()
        try:
            client.take()
            began, hand = time.time(), _Hand(client)
            try:
                first = console.recorder.wait_for(lambda velocity: velocity.moves, began, 3.0)
                if first is None:
                    raise SpoiltError('the robot did not move')
                time.sleep(random.uniform(*TIME_TO_FAULT))
                fault = console.proxy.hold('browser')
                time.sleep(LAG)
                before, burst = len(console.proxy.commands), console.proxy.release()
                time.sleep(SETTLING_TIME)
            finally:
                hand.close()
            time.sleep(LATENCY)
            commands = console.proxy.commands
            count = sum(one.moves and one.time < burst + 0.03 for one in commands[before:])
            trial = hand_trial(
                console.recorder.sent_since(first.time - 1e-6),
                [one for one in commands if one.time > began], fault)
            return replace(trial, note=f'motions in the burst: {count}')
        finally:
            client.close()
