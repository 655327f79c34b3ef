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
"""What a piece of work costs: CPU of its thread and of its process, messages, memory."""

from __future__ import annotations

from pathlib import Path
import time
from typing import Any

from rclpy.publisher import Publisher


class Meter:
    """
    Adds up what happens between entering and leaving it; made before any publisher is used.

    Helpers are the processes that this one has started, such as a guardian.
    """

    def __init__(self) -> None:
        """Count every message that any publisher of this process sends from now on."""
        self._sent = 0
        self._marks: tuple[float, ...] = ()
        self._publish = Publisher.publish
        Publisher.publish = self._counted()  # type: ignore[method-assign]

    def __enter__(self) -> None:
        """Begin."""
        self._marks = self._now()

    def __exit__(self, *error: object) -> None:
        """End; ``report`` tells what was in between."""
        self._marks = tuple(new - old for new, old in zip(self._now(), self._marks))

    def report(self) -> dict[str, float]:
        """
        Return what the work cost.

        :returns: CPU of the thread, of the process and of its helpers [s], messages sent, and
            the most memory that process and helpers have held so far [MB]
        """
        names = ('sent', 'thread', 'process', 'helpers')
        return {
            **dict(zip(names, self._marks)),
            'memory': peak_memory('self'),
            'helper_memory': sum(peak_memory(child) for child in children())}

    def _now(self) -> tuple[float, ...]:
        return (
            self._sent, time.thread_time(), time.process_time(),
            sum(process_time(child) for child in children()))

    def _counted(self) -> Any:
        def publish(publisher: Publisher, message: Any) -> None:
            self._sent += 1
            self._publish(publisher, message)
        return publish


def children() -> list[str]:
    """
    Return the processes that this one has started and that are still there.

    :returns: their ids
    """
    tasks = Path('/proc/self/task').glob('*/children')
    return [child for task in tasks for child in task.read_text().split()]


def process_time(pid: str) -> float:
    """
    Return how much CPU another process has had.

    :param pid: its id
    :returns: the time [s]; 0 if it has ended
    """
    try:
        # How Linux names the CPU clock of a process; see clock_getcpuclockid(3).
        return time.clock_gettime((~int(pid) << 3) | 2)
    except OSError:
        return 0.0


def peak_memory(pid: str) -> float:
    """
    Return the most memory that a process has held.

    :param pid: its id, or ``self``
    :returns: the peak of its resident set [MB]; 0 if it has ended
    """
    try:
        status = Path(f'/proc/{pid}/status').read_text()
    except OSError:
        return 0.0
    lines = [line for line in status.splitlines() if line.startswith('VmHWM')]
    return int(lines[0].split()[1]) / 1000 if lines else 0.0
