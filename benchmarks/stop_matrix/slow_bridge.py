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
"""The bridge with a simulated robot that takes 250 ms for each call, and tells what it plays."""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
import sys
import threading
import time

from kachaka_simple_control.control.signals import ShutdownEvent
from kachaka_simple_control.kachaka.bridge_node import SimulatedBridge
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import Velocity
import rclpy
from rclpy.signals import SignalHandlerOptions

#: How long a call to the robot takes over a slow link [s].
CALL = 0.25


class SlowBridge(SimulatedBridge):
    """As the official bridge does, it plays one velocity after the other, waiting for each."""

    def __init__(self, namespace: str, log: Path) -> None:
        """
        Show a robot from now on.

        :param namespace: where
        :param log: a file; each velocity played adds a line, time [s, system clock] and [m/s]
        """
        super().__init__(SimulatedKachaka(time.monotonic()), namespace)
        self._log = log

    def drive(self, velocity: Velocity, now: float) -> None:  # noqa: ARG002
        """
        Let the robot have a velocity, after the time that a call takes.

        :param velocity: the velocity
        :param now: when it came; the robot has it later
        """
        time.sleep(CALL)
        with self._log.open('a') as log:
            log.write(f'{time.time()} {velocity.linear_x}\n')
        super().drive(velocity, time.monotonic())

    def set_manual_control(self, enabled: bool) -> str:
        """
        Let the robot take velocities, or none, after the time that a call takes.

        :param enabled: whether it takes them
        :returns: why it refuses; nothing if it does not
        """
        time.sleep(CALL)
        return super().set_manual_control(enabled)


def main(args: Sequence[str]) -> None:
    """
    Show the robot until standard input ends.

    :param args: the namespace and the log
    """
    with ShutdownEvent() as ending:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        node = SlowBridge(args[0], Path(args[1]))
        executor = rclpy.get_global_executor()
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()
        ending.wait(with_parent=True)
        # Nothing of it is worth a clean end, and a spinning thread would abort one.
        os._exit(0)


if __name__ == '__main__':
    main(sys.argv[1:])
