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
The robot's program; ``python -m benchmarks.lossy_link.robot``; ends with its standard input.

It is the bridge with the simulated robot, and says what reached it and where it was, each as one
line of JSON.  A second subscription beside the bridge's would not do: each one's messages are lost
by themselves.
"""

from __future__ import annotations

import contextlib
import json
import sys
import threading
import time

from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.bridge_node import SimulatedBridge
from kachaka_simple_control.kachaka.error_codes import SUCCESS
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.geometry import Pose, Velocity
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions


class TellingKachaka(SimulatedKachaka):
    """The simulated robot, which says what happens to it."""

    def __init__(self) -> None:
        """Stand still, from now on."""
        super().__init__(time.monotonic())
        self._newest: tuple[float, Pose] | None = None
        self._told: tuple[float, Pose] | None = None

    def set_robot_velocity(self, linear: float, angular: float, now: float) -> int:
        """
        Drive, and say so.

        :param linear: forward velocity, as a part of the largest
        :param angular: turning velocity, as a part of the largest
        :param now: the time [s]
        :returns: 0, or the code of the error
        """
        self._tell_pose(now)
        code = super().set_robot_velocity(linear, angular, now)
        limits = KACHAKA.limits
        say('velocity', now, linear * limits.max_linear_velocity,
            angular * limits.max_angular_velocity, code == SUCCESS)
        return code

    def set_manual_control(self, enabled: bool, now: float) -> int:
        """
        Switch manual control, and say so.

        :param enabled: whether velocities are taken from now on
        :param now: the time [s]
        :returns: 0
        """
        say('manual control', now, enabled)
        return super().set_manual_control(enabled, now)

    def odometry(self, now: float) -> tuple[Pose, Velocity]:
        """
        Return pose and velocity, and say them.

        :param now: the time [s]
        :returns: pose and velocity
        """
        self._tell_pose(now)
        return super().odometry(now)

    def _tell_pose(self, now: float) -> None:
        """Say where the robot is, and where it last was before; nothing while it stands still."""
        before, self._newest = self._newest, (now, self.state(now)[0])
        if self._told is not None and self._told[1] == self._newest[1]:
            return
        for sample in (before, self._newest):
            if sample is not None and sample != self._told:
                self._told = sample
                say('pose', sample[0], sample[1].x, sample[1].y, sample[1].theta)


def say(*words: object) -> None:
    """
    Tell the process that started this one.

    :param words: what
    """
    print(json.dumps(words), flush=True)


def end_with_input() -> None:
    """Shut ROS down when nobody holds the other end of standard input any more."""
    sys.stdin.read()
    rclpy.try_shutdown()


def main() -> None:
    """Be a robot."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = SimulatedBridge(TellingKachaka(), KACHAKA.namespace)
    threading.Thread(target=end_with_input, daemon=True).start()
    say('ready', time.monotonic())
    with contextlib.suppress(ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()


if __name__ == '__main__':
    main()
