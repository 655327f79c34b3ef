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
"""Measure drives of fleets: how far they are in step, and what program and guardian use."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from pathlib import Path
import threading
import time
from typing import Any, NamedTuple

from benchmarks.fleet import in_step
from benchmarks.fleet.fleet_files import (
    MOVE_TIME,
    write_blind_profile,
    write_fleet,
    write_moves,
)
from benchmarks.fleet.in_step import displacement_errors, lateness, planned_ticks
from benchmarks.fleet.scale import Scale
from benchmarks.fleet.stage import (
    DriveProgram,
    end,
    EXIT_TIMEOUT,
    Stage,
    START_TIMEOUT,
    STARTED,
)
from benchmarks.process_usage import peak_memory, process_time, thread_count
from benchmarks.run import show
from kachaka_simple_control.analysis.message_timing import median
from kachaka_simple_control.files.fleet_file import find_fleet
from kachaka_simple_control.fleet.fleet_plan import plan_fleet

#: How often processes are looked at [s], and how near to the begin and the end of a drive they
#: still prepare or stop [s].
SAMPLE_PERIOD, EDGE = 0.25, 0.3
#: The rate of odometry where that says it is not subscribed to [Hz].
NO_ODOMETRY = 0.0
#: How long the thread that drives takes to send one velocity of many [s].  Measured.
VELOCITY = 60e-6
#: How long a loop is measured that only does as much work [s].
ALONE = 20.0


class Usage(NamedTuple):
    """What processes have used until a time [s, system clock; s of CPU time]."""

    time: float
    process: float
    guardian: float


class UsageSampler:
    """Looks at processes and their guardians a few times a second, during a ``with`` block."""

    def __init__(self, programs: list[DriveProgram]) -> None:
        self._pids = [program.process.pid for program in programs]
        self._guardians = [program.guardian for program in programs]
        self._samples: list[Usage] = []
        #: the most of the first process
        self.threads = 0
        #: the most of all together [MB]
        self.memory = 0.0
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._sample)

    def __enter__(self) -> UsageSampler:
        """Begin."""
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        """End."""
        self._is_over.set()
        self._thread.join()

    def entry(self, begin: float, until: float) -> dict[str, float]:
        """Return the parts of a core [%] between two times, the memory [MB] and the threads."""
        used = [one for one in self._samples if begin + EDGE <= one.time <= until - EDGE]
        if len(used) < 2:
            return {}
        first, last = used[0], used[-1]
        parts = [100.0 * (after - before) / (last.time - first.time)
                 for before, after in zip(first[1:], last[1:])]
        return {
            'cpu': round(parts[0], 2), 'guardian_cpu': round(parts[1], 2),
            'memory': round(self.memory, 1), 'threads': self.threads}

    def _sample(self) -> None:
        while not self._is_over.wait(SAMPLE_PERIOD):
            self._samples.append(Usage(
                time.time(), sum(map(process_time, self._pids)),
                sum(map(process_time, self._guardians))))
            self.memory = max(
                self.memory, sum(map(peak_memory, [*self._pids, *self._guardians])))
            self.threads = max(self.threads, thread_count(self._pids[0]))


def measure_in_step(scale: Scale) -> list[dict[str, Any]]:
    """Drive the square at 20 Hz, with each rate of odometry; return what was measured."""
    entries = []
    for number, rate in enumerate(scale.odometry, 1):
        show('drives of the square', number, len(scale.odometry))
        alone = quantiles(apart_alone(scale.in_step, 20.0, scale.cut or ALONE))
        with robots(scale.in_step, rate) as stage:
            entries.append({
                **measured(stage, 'square', 20.0, rate, scale.cut), 'apart_alone': alone})
    return entries


def apart_alone(count: int, rate: float, duration: float) -> list[float]:
    """
    Return how far apart [s] pieces of work are that each take as long as a velocity.

    A loop does them, without ROS, and without other threads: what this machine can do at best.

    :param count: of the pieces that are due together
    """
    least = min(_duration(10_000) for _ in range(100))
    size = round(10_000 * VELOCITY / least)
    apart, due = [], time.monotonic()
    for _ in range(round(rate * duration)):
        due += 1.0 / rate
        time.sleep(max(0.0, due - time.monotonic()))
        begin = time.monotonic()
        for _ in range(count - 1):
            _duration(size)
        apart.append(time.monotonic() - begin)
    return apart


def _duration(size: int) -> float:
    """Return how long a piece of work takes [s]."""
    begin = time.monotonic()
    sum(range(size))
    return time.monotonic() - begin


def measure_many(scale: Scale) -> list[dict[str, Any]]:
    """Drive fleets of each size to and fro at 10 Hz; return what was measured."""
    entries = []
    for number, count in enumerate(scale.fleets, 1):
        show('fleets of several sizes', number, len(scale.fleets))
        with robots(count, 10.0) as stage:
            motion = write_moves(stage.folder, scale.moves)
            entries.append(measured(stage, motion, 10.0, 10.0, None))
    return entries


@contextlib.contextmanager
def robots(count: int, odometry_rate: float) -> Iterator[Stage]:
    """Have an observer of robots, which are not there yet."""
    with Stage(count, odometry_rate=odometry_rate or 10.0) as stage:
        yield stage


def measured(
        stage: Stage, motion: str, rate: float, odometry: float,
        cut: float | None) -> dict[str, Any]:
    """
    Start a fleet, then its robots; return how it has driven.

    :param cut: after how long the drive is interrupted [s]; None to let it end
    """
    blind = write_blind_profile(stage.folder) if odometry == NO_ODOMETRY else None
    file = write_fleet(
        stage.folder / 'fleet.yaml', stage.names, motion, rate,
        profiles=dict.fromkeys(stage.names, blind) if blind else None)
    # The robots are started when the program waits for them already.
    with stage.fleet(file, patience=START_TIMEOUT) as program:
        program.wait_for(STARTED)
        ready = stage.start_robots()
        stage.run(program)
        with UsageSampler([program]) as sampler:
            code = program.code_within(cut) if cut else program.code_within(EXIT_TIMEOUT * 10.0)
            if cut and code is None:
                code = end(program)
        records = stage.observer.records()
        # Of Python it has one thread; all others are those of ROS and DDS.
        of_ros = thread_count(stage.observer.process.pid) - 1
    began = [first for first in in_step.firsts(records).values() if first is not None]
    until = max(one.time for sent in records.values() for one in sent if one.moves)
    return {
        'robots': len(stage.names), 'motion': Path(motion).stem, 'rate': rate,
        'odometry': odometry, 'code': code, 'is_cut': cut is not None,
        'start': round(min(began) - program.started, 4), 'found': round(min(began) - ready, 4),
        **timing(file, records, cut), **sampler.entry(max(began), until),
        'python_threads': sampler.threads - of_ros}


def timing(file: Path, records: in_step.Records, cut: float | None) -> dict[str, Any]:
    """Return how far the robots of a fleet's file were in step, all of which drive the same."""
    plan = plan_fleet(find_fleet(file)).robots[0].plan
    planned = [tick for tick in planned_ticks(plan) if cut is None or tick.due < cut - EDGE]
    late = lateness(records, planned)
    apart = in_step.spreads(late)
    has_moves = cut is None and plan.max_angular_velocity == 0.0
    errors = [abs(error) for error in displacement_errors(
        records, MOVE_TIME)] if has_moves else []
    return {
        'ticks': len(planned), 'lost': in_step.lost(late),
        'first_apart': rounded(apart[0]), 'apart': quantiles(apart[1:]),
        'late': quantiles(in_step.known(late)),
        'errors': [round(part(errors), 7) for part in (median, max)] if errors else []}


def quantiles(values: list[float]) -> dict[str, float]:
    """Return median, 99th percentile and worst of times [s]."""
    parts: dict[str, Callable[[list[float]], float]] = {
        'median': median, 'p99': in_step.p99, 'worst': max}
    return {name: rounded(part(values)) for name, part in parts.items()} if values else {}


def rounded(seconds: float) -> float:
    """Return a time in microseconds, as results have it."""
    return round(seconds, 6)
