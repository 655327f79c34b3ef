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
"""Start and control the process of one loop."""

from __future__ import annotations

import sys
import time
from typing import Any

from benchmarks import ROOT
from program import JsonProcess


class LoopProcess(JsonProcess):
    """
    The process of one loop.

    :param name: the name of the loop
    :param mode: the mode, see ``benchmarks.loop_process``
    :param rate: the rate of velocity messages [Hz]
    :param namespace: the namespace of the robot
    """

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
