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
The process of one contender; ``python -m benchmarks.loop_process NAME MODE RATE NAMESPACE``.

Modes: ``serve`` moves as it is told on its standard input; ``drive`` moves once, for long;
``lesson`` plays the beginning of the lesson; ``signals`` makes a new node after every signal.
What it has to say goes to its standard output, a JSON value a line.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
import time

import rclpy

from benchmarks.loops import GIVEN_UP, Loop, LOOPS, Ours  # noqa: I100
from benchmarks.resource_usage import Meter

VELOCITY = 0.1
#: Longer than anybody waits: a movement that is meant to be interrupted.
LONG = 30.0


def say(value: object) -> None:
    """
    Tell the process that started this one.

    :param value: what
    """
    print(json.dumps(value), flush=True)


def serve(loop: Loop, meter: Meter) -> None:
    """
    Meet the robot, then move as often as each line of the input says.

    :param loop: what moves
    :param meter: what measures it
    """
    loop.meet()
    say('ready')
    for line in sys.stdin:
        say(turn(loop, meter, json.loads(line)))


def turn(loop: Loop, meter: Meter, durations: list[float]) -> dict[str, object]:
    """
    Move forwards and backwards in turn, and measure it; a fault ends the turn.

    :param loop: what moves
    :param meter: what measures it
    :param durations: how long each movement is [s]
    :returns: what it cost, and why movements were given up
    """
    faults: list[str] = []
    with meter:
        for count, duration in enumerate(durations):
            faults += move(loop, -VELOCITY if count % 2 else VELOCITY, duration)
            if faults:
                break
    report = meter.report()
    if faults:
        loop.renew()
    return {**report, 'faults': faults}


def move(loop: Loop, velocity: float, duration: float) -> list[str]:
    """
    Move once.

    :param loop: what moves
    :param velocity: forward [m/s]
    :param duration: how long [s]
    :returns: why the movement was given up, if it was
    """
    try:
        loop.move(velocity, duration)
    except GIVEN_UP as error:
        return [str(error)]
    return []


def drive(loop: Loop, meter: Meter) -> None:
    """
    Move at once and for long, telling when the robot was found.

    :param loop: what moves
    :param meter: not used
    """
    del meter
    threading.Thread(target=_tell_match, args=(loop,), daemon=True).start()
    loop.move(VELOCITY, LONG)


def lesson(loop: Loop, meter: Meter) -> None:
    """
    Play the beginning of the lesson: stand still, forward, stand still.

    :param loop: what moves
    :param meter: not used
    """
    del meter
    say('started')
    for velocity, duration in ((0.0, 1.0), (VELOCITY, 1.0), (0.0, 0.5)):
        loop.move(velocity, duration)


def signals(rate: float, namespace: str) -> None:
    """
    Move until a signal comes, then again with a new node, for a signal stops a node for good.

    A handler of the program's own keeps the process alive.  The node still hears each signal by
    itself, in the same way as in a program without such a handler.  There is no guardian: it has
    no part in what is measured, and to start hundreds of them would take ten minutes.

    :param rate: how often a velocity is sent [Hz]
    :param namespace: where the robot is
    """
    signal.signal(signal.SIGINT, lambda *_: None)
    while True:
        loop = Ours(rate, namespace, prime_time=0.0, guardian=False)
        move(loop, VELOCITY, LONG)
        loop.close()


def main() -> None:
    """Do what the arguments say, and leave as the lesson's program does."""
    name, mode, rate, namespace = sys.argv[1], sys.argv[2], float(sys.argv[3]), sys.argv[4]
    meter = Meter()
    rclpy.init()
    if mode == 'signals':
        signals(rate, namespace)
    loop: Loop = LOOPS[name](rate, namespace)
    try:
        {'serve': serve, 'drive': drive, 'lesson': lesson}[mode](loop, meter)
    except KeyboardInterrupt:
        pass
    finally:
        loop.stop()
        loop.close()
        rclpy.try_shutdown()


def _tell_match(loop: Loop) -> None:
    while not loop.has_matched:
        time.sleep(0.005)
    say(time.time())


if __name__ == '__main__':
    main()
