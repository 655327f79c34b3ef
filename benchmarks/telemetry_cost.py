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
What it costs to be watched: display and report on and off, in turn; ``python -m`` runs this.

Each drive is one of the real command with a simulated robot, at a terminal.  An independent
subscriber hears the velocities, and goes by the times that DDS stamps on them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import contextlib
from dataclasses import dataclass, field
import fcntl
import importlib.util
import os
from pathlib import Path
import pty
import random
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time

from kachaka_simple_control.report.metrics import median, quantile

from benchmarks.progress import show
from benchmarks.resource_usage import process_time
from benchmarks.tables import number, Table
from benchmarks.wire import jitters, movements, relative_error, Row

ROOT = Path(__file__).resolve().parent.parent
RATE = 50
#: How long each movement takes [s]; forwards and backwards in turn.
DURATION = 1.0
VELOCITY = 0.1
#: How many movements a drive has that are left out at its beginning: all have to settle.
SETTLING = 2
#: How long a drive may take beyond its movements [s].
PATIENCE = 60.0
HELPERS = {'display': 'display.display_process', 'reporter': 'report.report_process',
           'guardian': 'guardian_process'}


@dataclass(frozen=True)
class Way:
    """
    A way of driving.

    :param name: for the table
    :param display: whether the drive is shown
    :param report: whether it is recorded
    """

    name: str
    display: bool
    report: bool

    def command(self, motion: Path, folder: Path, namespace: str) -> list[str]:
        """
        Return the command.

        :param motion: the motion's file
        :param folder: where a report may go
        :param namespace: where the robot is
        :returns: program and arguments
        """
        return [
            sys.executable, '-m', 'kachaka_simple_control', str(motion), '--sim',
            *([] if self.display else ['--quiet']),
            *(['--report', str(folder / 'report')] if self.report else []),
            '--ros-args', '-p', f'robot_namespace:=/{namespace}']


WAYS = (Way('neither', False, False), Way('display', True, False),
        Way('report', False, True), Way('both', True, True))


@dataclass
class Tally:
    """
    What the drives of one way were like.

    :param errors: of each movement, relative
    :param jitters: of each message [s]
    :param rounds: the 99th percentile of the jitter of each drive [s]
    :param worst: the worst error of each drive, relative
    :param cpu: of each process, for each second of each drive, by the process's name
    """

    errors: list[float] = field(default_factory=list)
    jitters: list[float] = field(default_factory=list)
    rounds: list[float] = field(default_factory=list)
    worst: list[float] = field(default_factory=list)
    cpu: dict[str, list[float]] = field(default_factory=dict)

    def add(self, found: Sequence[Sequence[Row]], cpu: dict[str, float]) -> None:
        """
        Take note of a drive.

        :param found: its movements, as heard
        :param cpu: what each process had, for each second
        """
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
    # Before anything loads rclpy: no robot, and no other run, may hear this one.
    os.environ.setdefault('ROS_DOMAIN_ID', str(random.randint(1, 100)))
    from kachaka_simple_control.ros.dds_transport import use_localhost_only
    use_localhost_only()
    rounds, count = (2, 6) if options.quick else (6, 30)
    for table in tables(measure(rounds, count)):
        print(f'\n{table.text()}', end='')


def measure(rounds: int, count: int) -> dict[str, Tally]:
    """
    Drive each way in turn, each round in another order.

    :param rounds: how often
    :param count: how many movements each drive has
    :returns: what they were like, by the way's name
    """
    has_reporter = importlib.util.find_spec('kachaka_simple_control.report.report_process')
    ways = [way for way in WAYS if has_reporter or not way.report]
    tallies = {way.name: Tally() for way in ways}
    for turn in range(rounds):
        show('rounds', turn + 1, rounds)
        start = turn % len(ways)
        for way in ways[start:] + ways[:start]:
            tallies[way.name].add(*drive(way, count))
    return tallies


def drive(way: Way, count: int) -> tuple[list[list[Row]], dict[str, float]]:
    """
    Drive once.

    :param way: how
    :param count: how many movements
    :returns: the movements as heard, and the CPU of each process for each second
    :raises RuntimeError: if a drive did not go well
    """
    from benchmarks.robot import Listener, new_namespace
    namespace = f'{new_namespace()}_{os.getpid()}'
    with tempfile.TemporaryDirectory() as folder, Listener(namespace, serves=False) as observer:
        def heard() -> list[list[Row]]:
            return movements(Row(one.time, one.linear_x) for one in observer.heard)

        motion = Path(folder) / 'motion.yaml'
        motion.write_text(motion_text(count))
        with at_terminal(way.command(motion, Path(folder), namespace)) as process:
            wait_for(lambda: len(heard()) > SETTLING, process, PATIENCE)
            pids, begin = processes(process.pid), time.monotonic()
            before = {name: process_time(str(pid)) for name, pid in pids.items()}
            wait_for(lambda: len(heard()) == count, process, PATIENCE + count)
            length = time.monotonic() - begin
            cpu = {name: (process_time(str(pid)) - before[name]) / length
                   for name, pid in pids.items()}
            if process.wait(PATIENCE) != 0:
                raise RuntimeError(f'{way.name}: the drive ended with {process.returncode}')
        found = heard()
    if len(found) != count:
        raise RuntimeError(f'{way.name}: {len(found)} of {count} movements were heard')
    return found[SETTLING:], cpu


def motion_text(count: int) -> str:
    """
    Return a motion of movements forwards and backwards, in turn.

    :param count: how many
    :returns: its file
    """
    steps = [f'  - move: {{linear_x: {VELOCITY * (-1) ** place} m/s, angular_z: 0 rad/s, '
             f'duration: {DURATION} s}}' for place in range(count)]
    return '\n'.join(['name: there and back', f'rate: {RATE} Hz', 'steps:', *steps, ''])


@contextlib.contextmanager
def at_terminal(command: Sequence[str]) -> Iterator[subprocess.Popen[bytes]]:
    """
    Run a program at a terminal that nobody looks at.

    :param command: the program
    :returns: a context manager for its process
    """
    leader, follower = pty.openpty()
    fcntl.ioctl(leader, termios.TIOCSWINSZ, struct.pack('HHHH', 30, 100, 0, 0))
    process = subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=follower, stderr=follower,
        start_new_session=True, env={**os.environ, 'TERM': 'xterm-256color'})
    os.close(follower)
    reader = threading.Thread(target=swallow, args=(leader,), daemon=True)
    reader.start()
    try:
        yield process
    finally:
        if process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE)
        reader.join(PATIENCE)
        os.close(leader)


def swallow(leader: int) -> None:
    """
    Read what a terminal is written to, until nobody is left who writes.

    :param leader: the terminal's other end
    """
    with contextlib.suppress(OSError):
        while os.read(leader, 65536):
            pass


def wait_for(
        condition: Callable[[], bool], process: subprocess.Popen[bytes], timeout: float) -> None:
    """
    Wait until something is so.

    :param condition: tells whether it is
    :param process: what must go on meanwhile
    :param timeout: how long to wait [s]
    :raises RuntimeError: if it does not become so
    """
    end = time.monotonic() + timeout
    while not condition():
        if process.poll() is not None or time.monotonic() > end:
            raise RuntimeError(f'the drive ended early, with {process.poll()}')
        time.sleep(0.25)


def processes(pid: int) -> dict[str, int]:
    """
    Return the processes of a drive, but for its robot.

    :param pid: the one that drives
    :returns: their ids by name
    """
    found = {'drive': pid}
    files = Path(f'/proc/{pid}/task').glob('*/children')
    for child in [child for file in files for child in file.read_text().split()]:
        line = Path(f'/proc/{child}/cmdline').read_bytes().decode()
        found.update({name: int(child) for name, part in HELPERS.items() if part in line})
    return found


def tables(tallies: dict[str, Tally]) -> list[Table]:
    """
    Put what was measured as tables.

    :param tallies: what the drives were like, by the way's name
    :returns: the tables
    """
    plain = tallies['neither']
    names = ['drive', *HELPERS]
    return [
        Table(
            f'On the wire, {DURATION:g} s movements at {RATE} Hz; each way in turn, in one run',
            ('', 'drives', 'displacement error, median / worst [%]',
             'interval - period, median / p99 / worst [ms]',
             'worst error of a drive, least to most [%]',
             'p99 of a drive, least to most [ms]', 'beside neither'),
            tuple((
                name, str(len(tally.rounds)),
                ' / '.join(number(100.0 * of) for of in (
                    median(tally.errors), max(tally.errors))),
                ' / '.join(number(1000.0 * quantile(tally.jitters, part))
                           for part in (0.5, 0.99, 1.0)),
                span(tally.worst, 100.0), span(tally.rounds, 1000.0), verdict(tally, plain))
                for name, tally in tallies.items())),
        Table(
            'CPU for each second of a drive [ms]', ('', *names), tuple(
                (name, *(number(1000.0 * median(tally.cpu[one])) if one in tally.cpu else '-'
                         for one in names))
                for name, tally in tallies.items()))]


def span(values: Sequence[float], factor: float) -> str:
    """
    Return the least and the most of some figures.

    :param values: the figures
    :param factor: for their unit
    :returns: text
    """
    return f'{number(factor * min(values))} to {number(factor * max(values))}'


def verdict(tally: Tally, plain: Tally) -> str:
    """
    Tell whether being watched can be told from noise.

    :param tally: the drives of one way
    :param plain: those that nobody watched
    :returns: within noise, if its middle lies within the extremes of theirs, or what does not
    """
    worse = [name for name, own, others in (
        ('error', tally.worst, plain.worst), ('jitter', tally.rounds, plain.rounds))
        if median(own) > max(others)]
    return f'worse: {" and ".join(worse)}' if worse else 'within noise'


if __name__ == '__main__':
    main()
