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
"""Measure the accuracy of each loop's timing, and the resources that each loop uses."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from dataclasses import asdict
import time
from typing import Any

from benchmarks.figures import where
from benchmarks.loops import LOOPS
from benchmarks.machine import busy
from benchmarks.robot import LoopProcess, Robot
from benchmarks.run import Scale, show
from benchmarks.wire import jitters, movements, relative_error, Row, ticks
from kachaka_simple_control.analysis.message_timing import quantile

DURATION = 1.0
#: The pause between two turns [s]; the stop of this package takes 0.4 s, which is not measured.
PAUSE = 0.6
#: The wait after the start of the last loop [s]; during discovery, DDS may delay the publisher of
#: any loop by some hundred milliseconds.
SETTLING_TIME = 4.0
COSTS = ('sent', 'thread', 'process', 'helpers')
PEAKS = ('memory', 'helper_memory')


def measure_timing(scale: Scale) -> list[dict[str, Any]]:
    """Measure each loop at each rate on an idle and a loaded machine; return all entries."""
    entries: list[dict[str, Any]] = []
    for load, moves in ((0, scale.moves), (scale.busy, scale.loaded)):
        for rate, count in moves.items():
            entries += at_rate(rate, count, scale.turn, load)
    return entries


def at_rate(rate: int, count: int, turn: int, load: int) -> list[dict[str, Any]]:
    """
    Measure each loop at one rate.

    The loops take turns in a changing order, so that other work of the machine affects all loops
    equally.
    """
    statistics = {name: LoopStatistics(name, rate, load) for name in LOOPS}
    with loop_processes(rate) as started, busy(load):
        for number in range(-(-count // turn)):
            done = min(count, (number + 1) * turn)
            show(f'{where(rate, load)}: movements by each loop'.removeprefix('at '), done, count)
            start = number % len(started)
            for process, robot in started[start:] + started[:start]:
                mark = len(robot.received)
                costs = process.move([DURATION] * min(turn, count - number * turn))
                time.sleep(PAUSE)
                statistics[process.name].add(costs, movements(robot.rows(mark)))
    return [one.entry() for one in statistics.values()]


@contextlib.contextmanager
def loop_processes(rate: int) -> Iterator[list[tuple[LoopProcess, Robot]]]:
    """Start a process for each loop at a rate [Hz], and wait until each one finds its robot."""
    with contextlib.ExitStack() as stack:
        started = []
        for name in LOOPS:
            robot = stack.enter_context(Robot())
            process = LoopProcess(name, 'serve', rate, robot.namespace)
            started.append((stack.enter_context(process), robot))
        for process, _ in started:
            process.read()
        time.sleep(SETTLING_TIME)
        yield started


class LoopStatistics:
    """The measurements of one loop at one rate."""

    def __init__(self, name: str, rate: int, load: int) -> None:
        self._head = {'loop': name, 'rate': rate, 'busy': load}
        self._period = 1.0 / rate
        self._costs = dict.fromkeys(COSTS, 0.0)
        self._peaks = dict.fromkeys(PEAKS, 0.0)
        self._faults: list[str] = []
        self._errors: list[float] = []
        self._jitters: list[float] = []
        self._ticks = {'due': 0, 'late': 0, 'lost': 0}
        self._seen = 0

    def add(self, costs: dict[str, Any], found: list[list[Row]]) -> None:
        """Add a turn: the used resources, and the movements that the robot received."""
        for name in COSTS:
            self._costs[name] += costs[name]
        for name in PEAKS:
            self._peaks[name] = max(self._peaks[name], costs[name])
        self._faults += costs['faults']
        for rows in found:
            self._seen += len(rows)
            self._errors.append(relative_error(rows, DURATION))
            self._jitters += jitters(rows, self._period)
            for name, number in asdict(ticks(rows, self._period, DURATION)).items():
                self._ticks[name] += number

    def entry(self) -> dict[str, Any]:
        """Return all measurements as plain data."""
        return {
            **self._head, 'errors': [round(error, 7) for error in self._errors], **self._ticks,
            'seen': self._seen, 'jitter': {
                str(part): round(quantile(self._jitters or [0.0], part), 7)
                for part in (0.5, 0.99, 1.0)},
            **self._costs, **self._peaks, 'faults': self._faults}
