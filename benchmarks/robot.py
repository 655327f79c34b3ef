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
"""The robot, which receives the velocities of the loops, and the process of each loop."""

from __future__ import annotations

from collections.abc import Iterator
import itertools
import sys
import time
from typing import Any

from benchmarks import ROOT
from benchmarks.wire import Row
from listener import Listener
from program import JsonProcess

#: The time between the start of a robot and the start of a program [s].
SETTLING_TIME = 2.0
#: The numbers of the namespaces.
_NUMBERS = itertools.count(1)


class Robot(Listener):
    """
    Subscribes to velocities like the official bridge: best effort, a queue of five.

    Times are the source timestamps of DDS, so that delays of this process do not matter.  Each
    robot has its own namespace, because a killed program stays on the graph for some time, and
    counts as another publisher.

    :param namespace: the namespace of the robot; None for a new namespace
    """

    def __init__(self, namespace: str | None = None) -> None:
        self.namespace = namespace or new_namespace()
        super().__init__(self.namespace)

    def __enter__(self) -> Robot:
        """Subscribe to the velocities."""
        super().__enter__()
        return self

    def rows(self, mark: int = 0) -> list[Row]:
        """Return the time and the forward velocity of each message after the first ``mark``."""
        return [Row(velocity.time, velocity.linear_x) for velocity in self.received[mark:]]

    @property
    def publishers(self) -> int:
        """Return the number of velocity publishers that this robot has discovered."""
        return self._node.count_publishers(self._subscription.topic_name)


def new_namespace() -> str:
    """Return a new namespace."""
    return f'bench_{next(_NUMBERS)}'


def robots(count: int, lasting: bool) -> Iterator[Robot]:
    """Yield a robot for each of several programs, when the robot is ready."""
    for _ in range(1 if lasting else count):
        with Robot() as robot:
            time.sleep(SETTLING_TIME)
            yield from itertools.repeat(robot, count if lasting else 1)


class LoopProcess(JsonProcess):
    """The process of one loop."""

    def __init__(self, name: str, mode: str, rate: float, namespace: str) -> None:
        self.name = name
        self.started = time.time()
        super().__init__([
            sys.executable, '-m', 'benchmarks.loop_process', name, mode, str(rate), namespace],
            cwd=ROOT)

    def move(self, durations: list[float]) -> dict[str, Any]:
        """Make the loop move for durations [s]; return the used resources and the faults."""
        self.write(durations)
        costs: dict[str, Any] = self.read(20.0 + 3.0 * sum(durations))
        return costs

    def wait(self, timeout: float) -> None:
        """Wait until the process ends by itself; print its output if it fails."""
        if self.end(timeout) != 0:
            print(f'\n{self.name} ended with {self.process.returncode}; {self}')
