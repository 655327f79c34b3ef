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
"""The second half of the run: how programs find the robot, and how they leave it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import itertools
import random
import signal
import time
from typing import Any

from benchmarks.load import busy
from benchmarks.process import Contender
from benchmarks.progress import show
from benchmarks.robot import moves, new_namespace, rests, Robot, robots
from benchmarks.scale import Scale
from benchmarks.wire import displacement, movements

RATE = 10
#: How long a zero is waited for before it counts as never sent [s].
NEVER = 1.5
#: How long a program may take to make the robot move [s].
PATIENCE = 30.0
#: How often the robot looks whether it has met another publisher [s].
GLANCE = 0.02
#: What no program can catch.
HARD = ['SIGKILL', 'SIGSTOP']
OTHERS = ('lesson', 'timer', 'rate')


def measure_starts(scale: Scale) -> list[dict[str, Any]]:
    """
    Start programs, and stop them in mid-motion; on an idle machine, and ours on a busy one.

    :param scale: how often
    :returns: an entry for each process
    """
    def in_turn(count: int) -> list[str]:
        return [*itertools.islice(itertools.cycle(['SIGINT', 'SIGTERM']), count)]

    entries = stopped('ours', in_turn(scale.starts), 0) + stopped('ours', HARD * scale.killed, 0)
    for name in OTHERS:
        entries += stopped(name, in_turn(scale.others), 0)
    with busy(scale.busy):
        loaded = in_turn(max(2, scale.starts // 4))
        return entries + stopped('ours', loaded, scale.busy)


def stopped(name: str, names: Sequence[str], load: int) -> list[dict[str, Any]]:
    """
    Start a program for each signal, and send it the signal in mid-motion.

    :param name: the loop
    :param names: the signals
    :param load: how many busy processes run beside it
    :returns: an entry for each process
    """
    entries = []
    end_well = name == 'ours' and not set(names) & set(HARD)
    for number, (robot, signum) in enumerate(zip(robots(len(names), end_well), names), 1):
        show(f'{name}: processes stopped in mid-motion', number, len(names))
        mark = len(robot.heard)
        with Contender(name, 'drive', RATE, robot.namespace) as contender:
            entries.append({
                'loop': name, 'busy': load, 'signal': signum, **start_of(contender, robot, mark),
                'zero': zero_after(contender, robot, signal.Signals[signum])})
            if not end_well:
                contender.process.kill()
    return entries


def start_of(contender: Contender, robot: Robot, mark: int) -> dict[str, float | None]:
    """
    Wait for the first velocity of a program that was just started.

    :param contender: the program
    :param robot: who waits
    :param mark: how many messages that robot had heard before
    :returns: the time from the start of the process to t = 0, and to t = 0 from the last match:
        the program's with the robot (ours: its guardian's, too), or the robot's with the last
        publisher that it met [s]
    """
    known, matched = 0, contender.started
    end = time.monotonic() + PATIENCE
    while (first := robot.first(moves, mark, GLANCE)) is None:
        if time.monotonic() > end:
            return {'start': None, 'match': None}
        if robot.publishers > known:
            known, matched = robot.publishers, time.time()
    matched = max(matched, contender.hear())
    return {
        'start': round(first.time - contender.started, 6),
        'match': round(first.time - matched, 6)}


def zero_after(contender: Contender, robot: Robot, signum: int) -> float | None:
    """
    Send a signal in mid-motion, and wait for the first zero.

    :param contender: who gets the signal
    :param robot: who waits for the zero
    :param signum: the signal
    :returns: the time between the two [s]; None if no zero came; 0 if the movement had ended by
        itself just before
    """
    # At any time between two messages: what is asked for is the worst of them.
    time.sleep(random.uniform(0.2, 0.4))
    mark = len(robot.heard)
    sent = contender.send(signum)
    zero = robot.first(rests, mark, NEVER)
    return None if zero is None else max(0.0, round(zero.time - sent, 6))


def measure_signals(scale: Scale) -> list[float | None]:
    """
    Send many signals to one process, which moves again after each of them.

    :param scale: how many
    :returns: the time from each signal to the first zero [s]; None where no zero came
    """
    times: list[float | None] = []
    with Robot() as robot, Contender('ours', 'signals', RATE, robot.namespace) as contender:
        for number in range(1, scale.signals + 1):
            show('ours: signals to one process', number, scale.signals)
            if robot.first(moves, len(robot.heard), PATIENCE) is None:
                break
            times.append(zero_after(contender, robot, signal.SIGINT))
        contender.process.kill()
    return times


def measure_firsts(scale: Scale) -> list[dict[str, Any]]:
    """
    Play the beginning of the lesson, and see what arrives of its first movement.

    :param scale: how often
    :returns: an entry for each process
    """
    entries = []
    for late, count in ((False, scale.firsts), (True, scale.late)):
        names, measure = ['lesson', 'ours'] * count, late_firsts if late else plain_firsts
        for number, (name, arrived) in enumerate(zip(names, measure(names)), 1):
            show(f'first movements, the robot {"late" if late else "there"}', number, len(names))
            entries.append({'loop': name, 'late': late, 'arrived': round(arrived, 6)})
    return entries


def plain_firsts(names: Sequence[str]) -> Iterator[float]:
    """
    Play the beginning of the lesson to robots that have been there for a while.

    :param names: the loops, in order
    :returns: for each the displacement that arrived [m]
    """
    for name, robot in zip(names, robots(len(names), lasting=False)):
        with Contender(name, 'lesson', RATE, robot.namespace) as contender:
            contender.wait(PATIENCE)
        yield moved(robot)


def late_firsts(names: Sequence[str]) -> Iterator[float]:
    """
    Play the beginning of the lesson to robots that come 1.5 s after the program.

    By then the lesson's loop is in the middle of its first movement.

    :param names: the loops, in order
    :returns: for each the displacement that arrived [m]
    """
    for name in names:
        namespace = new_namespace()
        with Contender(name, 'lesson', RATE, namespace) as contender:
            contender.hear()
            time.sleep(1.5)
            with Robot(namespace) as robot:
                contender.wait(PATIENCE)
            yield moved(robot)


def moved(robot: Robot) -> float:
    """
    Add up what a robot was told.

    :param robot: the robot
    :returns: the displacement [m]
    """
    return sum(displacement(rows) for rows in movements(robot.rows()))
