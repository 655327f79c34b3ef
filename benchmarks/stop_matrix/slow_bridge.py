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
"""The bridge with a simulated robot for which each call takes 250 ms; logs what it executes."""

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

#: Duration of a call to the robot over a slow link [s].
CALL_DURATION = 0.25


class SlowBridge(SimulatedBridge):
    """
    As the official bridge, executes one velocity after the other, and waits for each.

    :param namespace: of the robot
    :param log: gets a line for each executed velocity: time [s, system clock] and [m/s]
    """

    def __init__(self, namespace: str, log: Path) -> None:
        super().__init__(SimulatedKachaka(time.monotonic()), namespace)
        self._log = log

    def drive(self, velocity: Velocity, now: float) -> None:  # noqa: ARG002
        """Send the robot a velocity, which it has after the duration of a call."""
        time.sleep(CALL_DURATION)
        with self._log.open('a') as log:
            log.write(f'{time.time()} {velocity.linear_x}\n')
        super().drive(velocity, time.monotonic())

    def set_manual_control(self, enabled: bool) -> str:
        """
        Enable or disable manual control, after the duration of a call.

        :returns: why the robot refuses; empty if it does not
        """
        time.sleep(CALL_DURATION)
        return super().set_manual_control(enabled)


def main(args: Sequence[str]) -> None:
    """Run the bridge until standard input ends; the arguments are namespace and log file."""
    with ShutdownEvent() as shutdown:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        node = SlowBridge(args[0], Path(args[1]))
        executor = rclpy.get_global_executor()
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()
        shutdown.wait(with_parent=True)
        # It has nothing to clean up, and would abort while the other thread spins.
        os._exit(0)


if __name__ == '__main__':
    main(sys.argv[1:])
