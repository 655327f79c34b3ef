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
What display and report cost a drive: each on and off, in turn; ``python -m`` runs this.

Each drive is the command with a simulated robot, at a terminal.  An independent subscriber records
the velocities with the source timestamps of DDS.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import importlib.util
import os
from pathlib import Path
import sys
import tempfile
import time

from benchmarks.progress import show
from benchmarks.resource_usage import process_time
from benchmarks.tables import number, Table
from benchmarks.wire import jitters, movements, relative_error, Row
from kachaka_simple_control.analysis.message_timing import median, quantile
from program import children_of
from ros_domain import isolate_ros
from terminals import at_terminal, TerminalProgram
from waiting import poll

RATE = 50
#: The duration of each movement [s]; movements alternate between forward and backward.
DURATION = 1.0
VELOCITY = 0.1
#: The number of movements at the start of a drive that are not measured.
SETTLING_COUNT = 2
#: The longest duration of a drive beyond its movements [s].
DRIVE_TIMEOUT = 60.0
HELPERS = {'display': 'display.display_program', 'reporter': 'report.report_program',
           'guardian': 'guardian_program'}


@dataclass(frozen=True)
class Telemetry:
    """
    The telemetry of a drive.

    :param name: its name in the table
    :param display: whether the drive has a display
    :param report: whether the drive has a report
    """

    name: str
    display: bool
    report: bool

    def command(self, motion: Path, folder: Path, namespace: str) -> list[str]:
        """Return the command for a motion file; a report is written to the folder."""
        return [
            sys.executable, '-m', 'kachaka_simple_control', str(motion), '--sim',
            *([] if self.display else ['--quiet']),
            *(['--report', str(folder / 'report')] if self.report else []),
            '--ros-args', '-p', f'robot_namespace:=/{namespace}']


CHOICES = (Telemetry('neither', False, False), Telemetry('display', True, False),
           Telemetry('report', False, True), Telemetry('both', True, True))


@dataclass
class DriveStatistics:
    """
    The measurements of all drives with the same telemetry.

    :param errors: the relative error of each movement
    :param jitters: the jitter of each message [s]
    :param rounds: the 99th percentile of the jitter of each drive [s]
    :param worst: the worst relative error of each drive
    :param cpu: the CPU time per second of each drive [s], by the name of the process
    """

    errors: list[float] = field(default_factory=list)
    jitters: list[float] = field(default_factory=list)
    rounds: list[float] = field(default_factory=list)
    worst: list[float] = field(default_factory=list)
    cpu: dict[str, list[float]] = field(default_factory=dict)

    def add(self, found: Sequence[Sequence[Row]], cpu: dict[str, float]) -> None:
        """Add a drive: its received movements, and the CPU time of each process."""
        errors = [abs(relative_error(rows, DURATION)) for rows in found]
        late = [jitter for rows in found for jitter in jitters(rows, 1.0 / RATE)]
        self.errors += errors
        self.jitters += late
        self.rounds.append(quantile(late, 0.99))
        self.worst.append(max(errors))
        for name, value in cpu.items():
            self.cpu.setdefault(name, []).append(value)


def main() -> None:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--quick', action='store_true', help='two short drives each way')
    options = parser.parse_args()
    isolate_ros()
    rounds, count = (2, 6) if options.quick else (6, 30)
    for table in tables(measure(rounds, count)):
        print(f'\n{table.text()}', end='')


def measure(rounds: int, count: int) -> dict[str, DriveStatistics]:
    """
    Drive with each telemetry in turn; each round has a different order.

    :param rounds: the number of rounds
    :param count: the number of movements of each drive
    :returns: the measurements by the name of the telemetry
    """
    has_reporter = importlib.util.find_spec('kachaka_simple_control.report.report_program')
    choices = [one for one in CHOICES if has_reporter or not one.report]
    statistics = {one.name: DriveStatistics() for one in choices}
    for turn in range(rounds):
        show('rounds', turn + 1, rounds)
        start = turn % len(choices)
        for telemetry in choices[start:] + choices[:start]:
            statistics[telemetry.name].add(*drive(telemetry, count))
    return statistics


def drive(telemetry: Telemetry, count: int) -> tuple[list[list[Row]], dict[str, float]]:
    """
    Drive once.

    :param telemetry: the telemetry of the drive
    :param count: the number of movements
    :returns: the received movements, and the CPU time per second of each process
    :raises RuntimeError: if the drive fails
    """
    from benchmarks.robot import Listener, new_namespace
    namespace = f'{new_namespace()}_{os.getpid()}'
    with tempfile.TemporaryDirectory() as folder, Listener(namespace, serves=False) as observer:
        def received() -> list[list[Row]]:
            return movements(Row(one.time, one.linear_x) for one in observer.received)

        motion = Path(folder) / 'motion.yaml'
        motion.write_text(motion_text(count))
        command = telemetry.command(motion, Path(folder), namespace)
        with at_terminal(command, rows=30) as process:
            wait_for(lambda: len(received()) > SETTLING_COUNT, process, DRIVE_TIMEOUT)
            pids, begin = processes(process.process.pid), time.monotonic()
            before = {name: process_time(pid) for name, pid in pids.items()}
            wait_for(lambda: len(received()) == count, process, DRIVE_TIMEOUT + count)
            length = time.monotonic() - begin
            cpu = {name: (process_time(pid) - before[name]) / length
                   for name, pid in pids.items()}
            if (code := process.end(DRIVE_TIMEOUT)) != 0:
                raise RuntimeError(f'{telemetry.name}: the drive ended with {code}')
        found = received()
    if len(found) != count:
        raise RuntimeError(f'{telemetry.name}: {len(found)} of {count} movements were received')
    return found[SETTLING_COUNT:], cpu


def motion_text(count: int) -> str:
    """Return the text of a motion file with a number of forward and backward movements."""
    steps = [f'  - move: {{linear_x: {VELOCITY * (-1) ** place} m/s, angular_z: 0 rad/s, '
             f'duration: {DURATION} s}}' for place in range(count)]
    return '\n'.join(['name: there and back', f'rate: {RATE} Hz', 'steps:', *steps, ''])


def wait_for(
        condition: Callable[[], bool], process: TerminalProgram, timeout: float) -> None:
    """
    Wait for a condition, and read the output of the program meanwhile.

    :raises RuntimeError: if the condition is not met within the timeout [s], or the process ends
        before
    """
    poll(lambda: process.text and (condition() or process.is_over), timeout, 0.1)
    if not condition():
        raise RuntimeError(f'the drive ended early; {process}')


def processes(pid: int) -> dict[str, int]:
    """Return the process ids of a drive by name, without the process of the robot."""
    found = {'drive': pid}
    for child in children_of(pid):
        line = Path(f'/proc/{child}/cmdline').read_bytes().decode()
        found.update({name: child for name, part in HELPERS.items() if part in line})
    return found


def tables(statistics: dict[str, DriveStatistics]) -> list[Table]:
    """Return the tables of the measurements."""
    plain = statistics['neither']
    names = ['drive', *HELPERS]
    return [
        Table(
            f'On the wire, {DURATION:g} s movements at {RATE} Hz; each way in turn, in one run',
            ('', 'drives', 'displacement error, median / worst [%]',
             'interval - period, median / p99 / worst [ms]',
             'worst error of a drive, least to most [%]',
             'p99 of a drive, least to most [ms]', 'beside neither'),
            tuple((
                name, str(len(drives.rounds)),
                ' / '.join(number(100.0 * of) for of in (
                    median(drives.errors), max(drives.errors))),
                ' / '.join(number(1000.0 * quantile(drives.jitters, part))
                           for part in (0.5, 0.99, 1.0)),
                span(drives.worst, 100.0), span(drives.rounds, 1000.0),
                compare_with_plain(drives, plain))
                for name, drives in statistics.items())),
        Table(
            'CPU for each second of a drive [ms]', ('', *names), tuple(
                (name, *(number(1000.0 * median(drives.cpu[one])) if one in drives.cpu else '-'
                         for one in names))
                for name, drives in statistics.items()))]


def span(values: Sequence[float], factor: float) -> str:
    """Return the smallest and the largest of values, multiplied by a factor, as text."""
    return f'{number(factor * min(values))} to {number(factor * max(values))}'


def compare_with_plain(drives: DriveStatistics, plain: DriveStatistics) -> str:
    """
    Compare the drives with telemetry to the drives without.

    :returns: ``within noise`` if the medians lie within the extremes of ``plain``, else the
        values that do not
    """
    worse = [name for name, own, others in (
        ('error', drives.worst, plain.worst), ('jitter', drives.rounds, plain.rounds))
        if median(own) > max(others)]
    return f'worse: {" and ".join(worse)}' if worse else 'within noise'


if __name__ == '__main__':
    main()
