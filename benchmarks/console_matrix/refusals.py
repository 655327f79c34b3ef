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
"""Connections that may not drive: nothing of them reaches the robot."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from dataclasses import dataclass
import time

from benchmarks.console_matrix.console_run import ConsoleRun
from benchmarks.console_matrix.raw_client import RawClient, RefusedError
from benchmarks.console_matrix.stage import Stage
from benchmarks.console_matrix.stops import MOTION
from benchmarks.console_matrix.trial import Expectation, SpoiltError, Trial
from waiting import poll

#: How long the intruder goes on [s].
DURATION = 0.6
#: The velocity that it wants [m/s].
VELOCITY = 0.1
#: How often an intruder tries in one trial.
ATTEMPTS = 5
#: More than the longest message [bytes], and the number of messages in a flood.
OVERSIZE, FLOOD = 100_000, 1000
#: The largest number of answers to a flood: those of a second, and a few.
MOST_ANSWERED = 60
Intruder = Callable[[ConsoleRun], RawClient]
Sender = Callable[[RawClient, RawClient], tuple[str, list[str]]]


def foreign_origin(console: ConsoleRun) -> RawClient:
    """Connect from a page of another site, with the cookie of the driver."""
    return RawClient(console.port, console.driver, origin='http://example.org')


def other_port(console: ConsoleRun) -> RawClient:
    """Connect from a page of another port of this machine, with the cookie of the driver."""
    return RawClient(console.port, console.driver, origin=f'http://127.0.0.1:{console.port + 1}')


def wrong_host(console: ConsoleRun) -> RawClient:
    """Connect by a name that leads here (DNS rebinding), with the cookie of the driver."""
    host = f'example.org:{console.port}'
    return RawClient(console.port, console.driver, host, f'http://{host}')


def no_token(console: ConsoleRun) -> RawClient:
    """Connect without a token."""
    return RawClient(console.port)


def wrong_token(console: ConsoleRun) -> RawClient:
    """Connect with a token that is almost right."""
    last = 'A' if console.driver[-1] != 'A' else 'B'
    return RawClient(console.port, console.driver[:-1] + last)


def viewer(console: ConsoleRun) -> RawClient:
    """Connect as a viewer, who may look and stop."""
    return RawClient(console.port, console.viewer)


def second_page(console: ConsoleRun) -> RawClient:
    """Connect as a second page of the driver, which has not the lease."""
    return RawClient(console.port, console.driver)


def send_commands(intruder: RawClient, driver: RawClient) -> tuple[str, list[str]]:
    """Send all commands that drive, and velocities of the hand with fresh stamps."""
    numbers = [intruder.request(kind, **values)[0] for kind, values in (
        ('lease', {'want': True}), ('take', {}), ('record', {'on': True}),
        ('speed', {'factor': 0.5}), ('run', {'text': MOTION, 'name': 'long.yaml'}))]
    end = time.monotonic() + DURATION
    while time.monotonic() < end:
        # The stamps of the driver are fresh; the intruder's own would not be.
        for velocity in (0.0, VELOCITY):
            with contextlib.suppress(OSError):
                intruder.hand(velocity, driver.stamp)
        time.sleep(0.05)
    answers = [intruder.answer(number) for number in numbers]
    return answers[0]['text'], [f'it was granted something: {answer}' for answer in answers
                                if answer['is_done']]


def send_oversized(intruder: RawClient, _: RawClient) -> tuple[str, list[str]]:
    """Send a motion that is longer than a message may be."""
    number, _ = intruder.request('run', text=MOTION + '#' * OVERSIZE, name='long.yaml')
    is_cut = poll(lambda: intruder.is_closed, DURATION)
    if intruder.has_answer(number):
        return '', ['an oversized message was answered']
    return ('its connection was closed', []) if is_cut else ('', ['its connection was kept'])


def send_flood(intruder: RawClient, driver: RawClient) -> tuple[str, list[str]]:
    """Send a thousand messages at once: velocities and motions in turn."""
    numbers = []
    for _ in range(FLOOD // 2):
        with contextlib.suppress(OSError):
            numbers.append(intruder.request('run', text=MOTION, name='long.yaml')[0])
            intruder.hand(VELOCITY, driver.stamp)
    time.sleep(DURATION)
    answered = [number for number in numbers if intruder.has_answer(number)]
    broken = [f'it was granted something: {answer}' for number in answered
              if (answer := intruder.answer(number))['is_done']]
    if len(answered) > MOST_ANSWERED:
        broken.append(f'{len(answered)} messages of a flood were answered')
    return f'{len(answered)} of {len(numbers)} answered', broken


@dataclass(frozen=True)
class RefusalRow:
    """A row in which intruders try to drive a robot that an honest driver has taken."""

    expectation: Expectation
    connect: Intruder
    send: Sender = send_commands
    connects: bool = False
    full: int = 20
    quick: int = 1

    def run(self, stage: Stage) -> Trial:
        """Run one trial, with ATTEMPTS intruders, one after the other."""
        console = stage.console_with_token
        driver = RawClient(console.port, console.driver).greet()
        broken: list[str] = []
        try:
            driver.take()
            began = time.time()
            for _ in range(ATTEMPTS):
                note, found = self._intrude(console, driver)
                broken += found
            moved = sum(one.moves for one in console.recorder.sent_since(began))
            self._move(console, driver)
        finally:
            driver.close()
        return Trial(late=moved, note=f'{ATTEMPTS} times: {note}', broken=tuple(broken))

    def _intrude(self, console: ConsoleRun, driver: RawClient) -> tuple[str, list[str]]:
        try:
            intruder = self.connect(console)
        except RefusedError as error:
            return str(error), ['it was refused'] if self.connects else []
        try:
            note, broken = self.send(intruder, driver)
        finally:
            intruder.close()
        return note, broken if self.connects else ['it was let in', *broken]

    @staticmethod
    def _move(console: ConsoleRun, driver: RawClient) -> None:
        """
        Move the robot by the honest driver: it was ready, and would have obeyed.

        :raises SpoiltError: if it does not
        """
        began = time.time()
        for velocity in (0.0, *[VELOCITY] * 4, 0.0):
            driver.hand(velocity)
            time.sleep(0.05)
        if console.recorder.wait_for(lambda velocity: velocity.moves, began, 1.0) is None:
            raise SpoiltError('the robot would not have moved for its driver either')
