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
"""Measure the time to the first velocity, of several robots too, and from a signal to a zero."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import itertools
import os
import random
import signal
import time
from typing import Any

from benchmarks.machine import busy
from benchmarks.robot import LoopProcess, new_namespace, Robot, robots
from benchmarks.run import Scale, show
from benchmarks.stop_matrix.observer import Observer
from benchmarks.wire import displacement, movements
from ros_support import bridge
from waiting import poll

RATE = 10
#: A zero that is not sent within this time counts as never sent [s].
ZERO_TIMEOUT = 1.5
#: The longest time until a program moves the robot [s].
MOTION_TIMEOUT = 30.0
#: The period at which the robot counts publishers [s].
POLL_PERIOD = 0.02
#: The signals that no program can handle.
UNCATCHABLE = ['SIGKILL', 'SIGSTOP']
OTHERS = ('lesson', 'timer', 'rate')


def measure_starts(scale: Scale) -> list[dict[str, Any]]:
    """Start programs, and stop them during a motion; this package's also on a loaded machine."""
    def in_turn(count: int) -> list[str]:
        return [*itertools.islice(itertools.cycle(['SIGINT', 'SIGTERM']), count)]

    entries = stopped('ours', in_turn(scale.starts), 0)
    entries += stopped('ours', UNCATCHABLE * scale.killed, 0)
    for name in OTHERS:
        entries += stopped(name, in_turn(scale.others), 0)
    with busy(scale.busy):
        loaded = in_turn(max(2, scale.starts // 4))
        return entries + stopped('ours', loaded, scale.busy)


def stopped(name: str, names: Sequence[str], load: int) -> list[dict[str, Any]]:
    """Start a program for each signal, and send it the signal during a motion."""
    entries = []
    end_well = name == 'ours' and not set(names) & set(UNCATCHABLE)
    for number, (robot, signum) in enumerate(zip(robots(len(names), end_well), names), 1):
        show(f'{name}: processes stopped in mid-motion', number, len(names))
        mark = len(robot.received)
        with LoopProcess(name, 'drive', RATE, robot.namespace) as process:
            entries.append({
                'loop': name, 'busy': load, 'signal': signum, **start_of(process, robot, mark),
                'zero': zero_after(process, robot, signal.Signals[signum])})
            if not end_well:
                process.process.kill()
    return entries


def start_of(process: LoopProcess, robot: Robot, mark: int) -> dict[str, float | None]:
    """
    Wait for the first velocity of a program that was just started.

    :returns: the time from the start of the process to t = 0, and from the last match to t = 0
        [s]; a match is the discovery of the robot by the program or its guardian, or of a
        publisher by the robot
    """
    known, matched = 0, process.started
    end = time.monotonic() + MOTION_TIMEOUT
    while (first := robot.first(lambda velocity: velocity.moves, mark, POLL_PERIOD)) is None:
        if time.monotonic() > end:
            return {'start': None, 'match': None}
        if robot.publishers > known:
            known, matched = robot.publishers, time.time()
    matched = max(matched, process.read())
    return {
        'start': round(first.time - process.started, 6),
        'match': round(first.time - matched, 6)}


def zero_after(process: LoopProcess, robot: Robot, signum: int) -> float | None:
    """
    Send a signal during a motion, and wait for the first zero.

    :returns: the time from the signal to the zero [s]; None if no zero came; 0 if the movement
        ended by itself just before the signal
    """
    # At a random time between two messages, to include the worst case.
    time.sleep(random.uniform(0.2, 0.4))
    mark = len(robot.received)
    sent = process.send(signum)
    zero = robot.first(lambda velocity: not velocity.moves, mark, ZERO_TIMEOUT)
    return None if zero is None else max(0.0, round(zero.time - sent, 6))


def measure_signals(scale: Scale) -> list[float | None]:
    """
    Send many signals to one process, which moves again after each signal.

    :returns: the time from each signal to the first zero [s]; None if no zero came
    """
    times: list[float | None] = []
    with Robot() as robot, LoopProcess('ours', 'signals', RATE, robot.namespace) as process:
        for number in range(1, scale.signals + 1):
            show('ours: signals to one process', number, scale.signals)
            mark = len(robot.received)
            if robot.first(lambda velocity: velocity.moves, mark, MOTION_TIMEOUT) is None:
                break
            times.append(zero_after(process, robot, signal.SIGINT))
        process.process.kill()
    return times


def measure_firsts(scale: Scale) -> list[dict[str, Any]]:
    """Start the lesson, and measure how much of its first movement reaches the robot."""
    entries = []
    for late, count in ((False, scale.firsts), (True, scale.late)):
        names, measure = ['lesson', 'ours'] * count, late_firsts if late else plain_firsts
        for number, (name, arrived) in enumerate(zip(names, measure(names)), 1):
            show(f'first movements, the robot {"late" if late else "there"}', number, len(names))
            entries.append({'loop': name, 'late': late, 'arrived': round(arrived, 6)})
    return entries


def plain_firsts(names: Sequence[str]) -> Iterator[float]:
    """Start the lesson of each loop with a ready robot; yield the received displacement [m]."""
    for name, robot in zip(names, robots(len(names), lasting=False)):
        with LoopProcess(name, 'lesson', RATE, robot.namespace) as process:
            process.wait(MOTION_TIMEOUT)
        yield moved(robot)


def late_firsts(names: Sequence[str]) -> Iterator[float]:
    """
    Start the lesson of each loop 1.5 s before its robot; yield the received displacement [m].

    When the robot starts, the lesson's loop is in the middle of its first movement.
    """
    for name in names:
        namespace = new_namespace()
        with LoopProcess(name, 'lesson', RATE, namespace) as process:
            process.read()
            time.sleep(1.5)
            with Robot(namespace) as robot:
                process.wait(MOTION_TIMEOUT)
            yield moved(robot)


def moved(robot: Robot) -> float:
    """Return the displacement of all velocities that a robot received [m]."""
    return sum(displacement(rows) for rows in movements(robot.rows()))


def measure_in_step(scale: Scale) -> list[dict[str, Any]]:
    """Start a program that drives simulated robots, several times for each number of robots."""
    return [entry for count, starts in scale.together.items() for entry in in_step(count, starts)]


def in_step(count: int, starts: int) -> Iterator[dict[str, Any]]:
    """
    Start a program that drives robots, several times; yield what was measured.

    That is the time from the start of the process to t = 0 and, at most, between the first
    velocities of two robots [s], None if one did not move, and the number of Python threads.
    """
    with contextlib.ExitStack() as stack:
        observer = Observer(int(os.environ['ROS_DOMAIN_ID']))
        stack.callback(observer.close)
        names = [new_namespace() for _ in range(count)]
        recorders = [*map(observer.record, names)]
        for name in names:
            stack.enter_context(bridge('--namespace', f'/{name}'))
        poll(lambda: all(each.odometry_count for each in recorders), MOTION_TIMEOUT)
        for number in range(1, starts + 1):
            show(f'ours: starts that drive {count}', number, starts)
            with LoopProcess('ours', 'together', RATE, ','.join(names)) as process:
                threads = process.read(MOTION_TIMEOUT)
                process.wait(MOTION_TIMEOUT)
            sent = [[one.time for one in each.sent_since(process.started) if one.moves]
                    for each in recorders]
            firsts = [times[0] for times in sent] if all(sent) else None
            yield {'robots': count, 'threads': threads,
                   'start': firsts and round(min(firsts) - process.started, 6),
                   'apart': firsts and round(max(firsts) - min(firsts), 6)}
