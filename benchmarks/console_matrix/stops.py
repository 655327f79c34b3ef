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
"""Rows in which a raw client sends STOP, and the process that floods the console meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, ExitStack, suppress
from dataclasses import dataclass
import json
import random
import socket
import subprocess
import sys
import time

from benchmarks import ROOT
from benchmarks.console_matrix.console_run import ConsoleRun
from benchmarks.console_matrix.proxy import frame
from benchmarks.console_matrix.raw_client import RawClient, RefusedError
from benchmarks.console_matrix.stage import Stage
from benchmarks.console_matrix.trial import Expectation, SpoiltError, Trial
from benchmarks.machine import busy
from program import environment

#: The time after which a flood ends by itself [s].
MAX_DURATION = 120.0
#: The messages of a flood: short and long, valid and invalid.
MESSAGES = (
    {'type': 'hand', 'sequence': 1, 'stamp': 1.0, 'linear_x': 0.3, 'angular_z': 0.0},
    {'type': 'list', 'id': 1}, {'type': 'nonsense'},
    {'type': 'preview', 'id': 2, 'text': 'steps:\n' + '- forward: 0.1 m\n' * 100},
    {'type': 'preview', 'id': 3, 'text': '#' * 60_000})
#: What a flood sends at once.
BURST = b''.join(frame(json.dumps({'v': 1, **message}).encode())
                 for message in (*MESSAGES[:4] * 10, MESSAGES[4]))
#: The motion that is stopped.
MOTION = 'name: long\nsteps: [forward: 20 m]\n'
#: How long the robot drives before the STOP [s].
TIME_TO_STOP = (0.5, 0.9)
#: How long the velocities are recorded after the answer to the STOP [s].
SETTLING_TIME = 1.0
#: How long to wait for a motion that must not begin [s].
WAIT_FOR_MOTION = 3.0
#: The part of the time from the process's start to 'ready' in which the STOP comes.
PART_OF_START = (0.02, 0.95)


@dataclass(frozen=True)
class StopRow:
    """A row in which a client without the lease stops a motion that another one has started."""

    expectation: Expectation
    floods: bool = True
    busy_count: int = 0
    full: int = 20
    quick: int = 1

    def run(self, stage: Stage) -> Trial:
        """Run one trial."""
        stage.leave_page()
        console = stage.console
        with (RawClient(console.port).greet() as driver,
              RawClient(console.port).greet() as stopper):
            driver.take()
            background: list[AbstractContextManager[None]] = [
                *([flood(console)] if self.floods else []), busy(self.busy_count)]
            began = time.time()
            accepted = driver.ask('run', text=MOTION, name='long.yaml')
            if not accepted['is_done']:
                raise RuntimeError(accepted['text'])
            with ExitStack() as stack:
                for one in background:
                    stack.enter_context(one)
                return self._stop(console, stopper, began)

    def _stop(self, console: ConsoleRun, stopper: RawClient, began: float) -> Trial:
        recorder = console.recorder
        first = recorder.wait_for(lambda velocity: velocity.moves, began, 10.0)
        if first is None:
            raise SpoiltError('the robot did not move')
        time.sleep(random.uniform(*TIME_TO_STOP))
        number, sent = stopper.request('stop')
        answer = stopper.answer(number)
        time.sleep(SETTLING_TIME)
        velocities = recorder.sent_since(first.time - 1e-6)
        zeros = [one.time for one in velocities if not one.moves]
        if zeros and zeros[0] < sent:
            raise SpoiltError('the robot stopped before the STOP')
        broken = () if answer['is_confirmed'] else (f'the STOP is not confirmed: {answer}',)
        elapsed = zeros[0] - sent if zeros else None
        return Trial(
            zero=elapsed, since_fault=elapsed, zeros=len(zeros), began=sent,
            ended=zeros[0] if zeros else 0.0,
            late=sum(one.moves and one.time > zeros[0] for one in velocities if zeros),
            note=answer['text'], broken=broken)


@dataclass(frozen=True)
class EarlyStopRow:
    """A row in which a STOP comes after the start of the drive process, and before t = 0."""

    expectation: Expectation
    full: int = 20
    quick: int = 1

    def run(self, stage: Stage) -> Trial:
        """Run one trial."""
        stage.leave_page()
        console = stage.console
        with (RawClient(console.port).greet() as driver,
              RawClient(console.port).greet() as stopper):
            driver.take()
            # After a release the console starts a new process.
            began = self._start(driver, '')
            driver.until(lambda: driver.state['state'] == 'ready')
            start_time = time.time() - began
            self._start(driver, MOTION)
            time.sleep(start_time * random.uniform(*PART_OF_START))
            return self._stop(console, driver, stopper, start_time)

    @staticmethod
    def _start(driver: RawClient, motion: str) -> float:
        """Let a new process start, and at once take its robot and run a motion."""
        driver.request('release')
        driver.until(lambda: driver.state['process'] != 'running')
        driver.until(lambda: driver.state['process'] == 'starting')
        began = time.time()
        driver.request('lease', want=True)
        driver.request('take')
        if motion:
            driver.request('run', text=motion, name='long.yaml')
        return began

    def _stop(
            self, console: ConsoleRun, driver: RawClient, stopper: RawClient,
            start_time: float) -> Trial:
        before = dict(driver.state)
        number, sent = stopper.request('stop')
        time.sleep(max(start_time, WAIT_FOR_MOTION))
        answer = stopper.answer(number)
        velocities = console.recorder.sent_since(sent)
        if before['state'] in ('ready', 'driving'):
            raise SpoiltError('the STOP came after t = 0')
        state = driver.state['state']
        broken = [f'after the STOP the robot is {state}'] * (
            state in ('ready', 'taking', 'driving', 'driving by hand'))
        return Trial(
            zeros=sum(not one.moves for one in velocities),
            late=sum(one.moves for one in velocities),
            note=f'{before["process"]}, {before["state"]}: {answer["text"]}',
            broken=tuple(broken))


@contextmanager
def flood(console: ConsoleRun) -> Iterator[None]:
    """Flood the console from another process during a ``with`` block."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'benchmarks.console_matrix.stops', str(console.port)], cwd=ROOT,
        env=environment(), stdout=subprocess.PIPE, start_new_session=True)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        yield
    finally:
        process.kill()
        process.communicate()


def send_flood(port: int) -> None:
    """Send without a pause, on a new connection whenever one is closed."""
    end, is_first = time.monotonic() + MAX_DURATION, True
    while time.monotonic() < end:
        with suppress(OSError, RefusedError):
            client = RawClient(port)
            client.send('hello')
            if is_first:
                print('flooding', flush=True)
                is_first = False
            while time.monotonic() < end:
                client.send_bytes(BURST)


if __name__ == '__main__':
    with suppress(KeyboardInterrupt, socket.timeout):
        send_flood(int(sys.argv[1]))
