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
A console for pictures: its scripted robot drives the plan of a motion, and turns a little less.

With the option ``--port`` this is the console, otherwise its drive process.
"""

from __future__ import annotations

import argparse
from functools import partial
import sys

from kachaka_simple_control.files.included_texts import find_among
from kachaka_simple_control.files.motion_reader import loads
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.motion.drive_order import DriveOrder
from kachaka_simple_control.motion.geometry import integrate, ORIGIN, Velocity
from scripted_drive import PERIOD, ScriptedDrive

RATE = 20.0
#: The turn that the robot makes, of the one that it should.
TURNED = 0.993


class PlannedDrive(ScriptedDrive):
    """A drive process whose robot follows the plan of a motion."""

    def _obey(self, command):
        super()._obey(command)
        if hasattr(command, 'text'):
            motion = loads(
                command.text, command.name, command.values, find_among(command.included)).motion
            self.plan = DriveOrder.of(motion, KACHAKA.planning_limits, RATE).plan
            self.planned, self.pose = ORIGIN, (0.0, 0.0, 0.0)
            self._set(motion=motion.name, steps=len(self.plan.steps), start=self.pose)

    def _advance_motion(self):
        self.elapsed += PERIOD * self.factor
        segment = next((part for part in self.plan.segments if part.end > self.elapsed), None)
        if segment is None:
            self._hold(0.0, 0.0)
            self._set(state='ready', progress=1.0, remaining=0.0, reason='done')
            return
        velocity = Velocity(
            self.factor * segment.velocity.linear_x, self.factor * segment.velocity.angular_z)
        self.planned = integrate(self.planned, velocity, PERIOD)
        self._hold(velocity.linear_x, velocity.angular_z * TURNED)
        self._set(
            progress=self.elapsed / self.plan.duration,
            step=1 + self.plan.step_index(self.elapsed),
            remaining=(self.plan.duration - self.elapsed) / self.factor,
            planned=(self.planned.x, self.planned.y, self.planned.theta))


if __name__ == '__main__':
    if len(sys.argv) > 1:
        from kachaka_simple_control.console.console_command import parse, run
        from kachaka_simple_control.console.drive_process import DriveProcess
        sys.exit(run(
            parse([*sys.argv[1:], '--no-browser']),
            partial(DriveProcess, lambda: [sys.executable, __file__])))
    options = argparse.Namespace(
        record=None, refuse=False, deaf=False, no_odometry=False, stopped=None,
        duration=4.0, start_delay=0.0,
        battery=0.8, errors='', report=None, floor=False)
    sys.exit(PlannedDrive(options).run())
