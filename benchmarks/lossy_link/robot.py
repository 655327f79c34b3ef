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
The robot's program, ``python -m benchmarks.lossy_link.robot``; it ends with its standard input.

The program runs the bridge with a simulated robot.  The robot reports the received velocities and
its poses, one JSON array per line.  A second subscription would lose other messages than the
bridge, so it cannot replace these reports.
"""

from __future__ import annotations

import contextlib
import json
import sys
import threading
import time

from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.bridge_node import SimulatedBridge
from kachaka_simple_control.kachaka.robot_status import SUCCESS
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import Pose, Velocity
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions


class ReportingKachaka(SimulatedKachaka):
    """A simulated robot that reports velocities, manual control and poses."""

    def __init__(self) -> None:
        super().__init__(time.monotonic())
        self._newest: tuple[float, Pose] | None = None
        self._reported: tuple[float, Pose] | None = None

    def set_robot_velocity(self, linear: float, angular: float, now: float) -> int:
        """Drive at a velocity, and report the velocity."""
        self._report_pose(now)
        code = super().set_robot_velocity(linear, angular, now)
        limits = KACHAKA.limits
        report('velocity', now, linear * limits.max_linear_velocity,
               angular * limits.max_angular_velocity, code == SUCCESS)
        return code

    def set_manual_control(self, enabled: bool, now: float) -> int:
        """Enable or disable manual control, and report the change."""
        report('manual control', now, enabled)
        return super().set_manual_control(enabled, now)

    def odometry(self, now: float) -> tuple[Pose, Velocity]:
        """Return the pose and the velocity, and report the pose."""
        self._report_pose(now)
        return super().odometry(now)

    def _report_pose(self, now: float) -> None:
        """Report a new pose and the pose before it; do nothing while the robot is at rest."""
        before, self._newest = self._newest, (now, self.state(now)[0])
        if self._reported is not None and self._reported[1] == self._newest[1]:
            return
        for sample in (before, self._newest):
            if sample is not None and sample != self._reported:
                self._reported = sample
                report('pose', sample[0], sample[1].x, sample[1].y, sample[1].theta)


def report(*words: object) -> None:
    """Write a report to standard output as one JSON array."""
    print(json.dumps(words), flush=True)


def end_with_input() -> None:
    """Shut ROS down when standard input ends."""
    sys.stdin.read()
    rclpy.try_shutdown()


def main() -> None:
    """Run the bridge and the simulated robot."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = SimulatedBridge(ReportingKachaka(), KACHAKA.namespace)
    threading.Thread(target=end_with_input, daemon=True).start()
    report('ready', time.monotonic())
    with contextlib.suppress(ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()


if __name__ == '__main__':
    main()
