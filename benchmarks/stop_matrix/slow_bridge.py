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

from kachaka_simple_control.kachaka.bridge_node import BridgeNode
from kachaka_simple_control.kachaka.simulated_robot import SimulatedRobot
from kachaka_simple_control.kachaka.simulator.drive_model import ODOMETRY_PERIOD
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.process.signals import ShutdownEvent
import rclpy
from rclpy.signals import SignalHandlerOptions


class SlowRobot(SimulatedRobot):
    """A slow robot that executes one call after the other, as with the official bridge."""

    def __init__(self, node: BridgeNode, name: str, log: Path, duration: float) -> None:
        super().__init__(node, name, SimulatedKachaka(time.monotonic()))
        self._log, self._duration = log, duration
        # Reentrant: the first velocity switches manual control on.
        self._call = threading.RLock()

    def drive(self, velocity: Velocity, arrival: float) -> None:  # noqa: ARG002
        """Send the robot a velocity, which arrives after the duration of a call."""
        with self._call:
            time.sleep(self._duration)
            with self._log.open('a') as log:
                log.write(f'{time.time()} {velocity.linear_x}\n')
            super().drive(velocity, time.monotonic())

    def set_manual_control(self, enabled: bool) -> str:
        """Enable or disable manual control, after the duration of a call."""
        with self._call:
            time.sleep(self._duration)
            return super().set_manual_control(enabled)


def main(args: Sequence[str]) -> None:
    """Run the bridge until standard input ends; the arguments: namespace, log, duration."""
    with ShutdownEvent() as shutdown:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        node = BridgeNode(args[0], {'': lambda node, name: SlowRobot(
            node, name, Path(args[1]), float(args[2]))}, ODOMETRY_PERIOD)
        for executor in node.executors():
            threading.Thread(target=executor.run, daemon=True).start()
        shutdown.wait(with_parent=True)
        # No cleanup is needed, and a normal exit would abort while other threads spin.
        os._exit(0)


if __name__ == '__main__':
    main(sys.argv[1:])
