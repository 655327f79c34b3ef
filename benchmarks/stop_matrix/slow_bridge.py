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
"""A bridge with a simulated robot whose calls take 250 ms; it logs the executed velocities."""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
import sys
import threading
import time

from kachaka_simple_control.kachaka.bridge_node import SimulatedBridge
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.process.signals import ShutdownEvent
import rclpy
from rclpy.signals import SignalHandlerOptions


class SlowBridge(SimulatedBridge):
    """A slow bridge that executes one velocity after the other, like the official bridge."""

    def __init__(self, namespace: str, log: Path, duration: float) -> None:
        super().__init__(SimulatedKachaka(time.monotonic()), namespace)
        self._log, self._duration = log, duration

    def drive(self, velocity: Velocity, now: float) -> None:  # noqa: ARG002
        """Send the robot a velocity, which arrives after the duration of a call."""
        time.sleep(self._duration)
        with self._log.open('a') as log:
            log.write(f'{time.time()} {velocity.linear_x}\n')
        super().drive(velocity, time.monotonic())

    def set_manual_control(self, enabled: bool) -> str:
        """Enable or disable manual control, after the duration of a call."""
        time.sleep(self._duration)
        return super().set_manual_control(enabled)


def main(args: Sequence[str]) -> None:
    """Run the bridge until standard input ends; the arguments: namespace, log, duration."""
    with ShutdownEvent() as shutdown:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        node = SlowBridge(args[0], Path(args[1]), float(args[2]))
        executor = rclpy.get_global_executor()
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()
        shutdown.wait(with_parent=True)
        # No cleanup is needed, and a normal exit would abort while the other thread spins.
        os._exit(0)


if __name__ == '__main__':
    main(sys.argv[1:])
