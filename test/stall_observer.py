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
Watch from outside the tests whether the machine itself stood still; start it as a program.

One process a core, pinned to it, sleeps a millisecond at a time.  When it wakes 50 ms late, or the
host took 50 ms of its core within a tenth of a second, it writes down when.  A real-time trial
that failed is repeated only if that happened during it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import contextlib
from dataclasses import dataclass
import os
from pathlib import Path
import subprocess
import sys
import time

#: The machine stood still if an observer woke so late, or the host took so much of its core [s].
#: Half of what the guardian allows: a shorter one makes nobody late.
MIN_STALL = 0.05
SLEEP = 0.001
STEAL_PERIOD = 0.1
#: How long an observer may take to write down what it saw [s].
WRITE_TIME = 0.3
#: The part of the trials that may be repeated, beside one.
MAX_REPEATED = 0.05
#: One repetition in so long a time is never too many: a virtual machine on a busy host was seen to
#: stand still twice in 5 minutes [s].
REPEATED_PERIOD = 60.0


@dataclass(frozen=True)
class Stall:
    """
    A time in which the machine stood still.

    :param begin: when it began [s, steady clock]
    :param end: when it ended [s, steady clock]
    """

    begin: float
    end: float
    core: int

    def meets(self, begin: float, end: float) -> bool:
        """Return whether any of it was between two times [s, steady clock]."""
        return self.begin < end and self.end > begin

    def __str__(self) -> str:
        """Return it in words."""
        return f'core {self.core} stood still for {(self.end - self.begin) * 1e3:.0f} ms'


class StallObservers:
    """The observers of all cores, and what they saw."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        #: one a core
        self.processes: list[subprocess.Popen[bytes]] = []

    def start(self) -> None:
        """Start an observer on each core that this process may use."""
        self.processes = [
            subprocess.Popen(
                [sys.executable, '-S', __file__, str(core), str(self._folder / f'core-{core}')],
                stdin=subprocess.DEVNULL, start_new_session=True)
            for core in sorted(os.sched_getaffinity(0))]

    def end(self) -> None:
        """End the observers."""
        for process in self.processes:
            process.kill()
            process.wait()

    def between(self, begin: float, end: float) -> list[Stall]:
        """Return the stalls that were seen between two times [s, steady clock]."""
        time.sleep(WRITE_TIME)
        return [stall for stall in self._seen() if stall.meets(begin, end)]

    def _seen(self) -> Iterator[Stall]:
        for file in sorted(self._folder.glob('core-*')):
            for line in file.read_text().splitlines():
                begin, end = map(float, line.split())
                yield Stall(begin, end, int(file.name.removeprefix('core-')))


def longest(stalls: Iterable[Stall]) -> Stall:
    """Return the longest of some stalls."""
    return max(stalls, key=lambda stall: stall.end - stall.begin)


def describe(stalls: Iterable[Stall]) -> str:
    """Return the longest of some stalls in words."""
    return str(longest(stalls))


def too_many(repeated: int, trials: int, duration: float = 0.0) -> bool:
    """
    Return whether more trials were repeated than a run may repeat to be proof.

    :param duration: how long the run took [s]; trials that take minutes each are few
    """
    return repeated > max(1.0, MAX_REPEATED * trials, duration / REPEATED_PERIOD)


def steal_time(core: int) -> float:
    """Return how long the host has run something else on a core of ours [s, since boot]."""
    with contextlib.suppress(OSError):
        for line in Path('/proc/stat').read_text().splitlines():
            name, *ticks = line.split()
            if name == f'cpu{core}' and len(ticks) > 7:
                return int(ticks[7]) / os.sysconf('SC_CLK_TCK')
    return 0.0


def observe(core: int, file: Path) -> None:
    """Write down each stall of a core, until the parent process has gone."""
    with contextlib.suppress(OSError):  # a core that may not be used is watched from another
        os.sched_setaffinity(0, {core})
    parent = os.getppid()
    before = checked = time.monotonic()
    stolen = steal_time(core)
    with file.open('w', buffering=1) as out:
        while True:
            time.sleep(SLEEP)
            now = time.monotonic()
            if now - before >= MIN_STALL:
                print(before, now, file=out)
            if now - checked >= STEAL_PERIOD:
                stolen, last = steal_time(core), stolen
                if stolen - last >= MIN_STALL:
                    print(checked, now, file=out)
                checked = now
                if os.getppid() != parent:
                    return
            # Not the time after this: a stop of ours in here must be seen, too.
            before = now


if __name__ == '__main__':
    observe(int(sys.argv[1]), Path(sys.argv[2]))
