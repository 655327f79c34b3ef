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
"""A drive whose events go to a recorder in this process."""

import math
from pathlib import Path

from kachaka_simple_control.analysis.drive_log import DriveLog
from kachaka_simple_control.control.events import MotionPlanned, SessionStarted
from kachaka_simple_control.motion.geometry import Velocity
from kachaka_simple_control.motion.limits import Limits
from kachaka_simple_control.motion.steps import Motion, Move
from kachaka_simple_control.report.mcap_recorder import McapRecorder
from messages import of_plan
from recordings import sent_velocities, stamp_of

LIMITS = Limits(0.3, 1.5)
TWIST = SessionStarted(
    'test', 'kachaka', LIMITS, 0.3, 1.7e9 + 0.123456789, '/kachaka/manual_control/cmd_vel',
    '/kachaka/odometry/odometry')
STAMPED = SessionStarted(
    'test', 'turtlebot3', LIMITS, 0.5, 1.6e9, '/cmd_vel', '/odom', 'TwistStamped', 'base')
PLANNED = MotionPlanned(Motion('bend', (Move(0.1, 0.5, 3.0),)), LIMITS, 10.0)


class RecordedDrive:
    """Publishes events to a log and to a recorder in a folder."""

    def __init__(self, folder, opened=TWIST):
        self.folder, self.opened = Path(folder), opened
        self.file = self.folder / 'run.mcap'
        self.drive_log = DriveLog()
        self.recorder = McapRecorder(self.folder)
        self.publish(opened, PLANNED)

    def publish(self, *events):
        """Publish events."""
        for event in events:
            self.drive_log.on_event(event)
            self.recorder.on_event(event)

    def send(self, first, count, velocity=0.1):
        """Publish velocities, one every 0.1 s."""
        self.publish(*(of_plan(first + number / 10.0, Velocity(velocity, 0.0))
                       for number in range(count)))

    def expected(self, until=math.inf):
        """Return the velocities that the file must have."""
        return [velocity for velocity in sent_velocities(self.drive_log.sent, self.opened)
                if velocity[0] <= (until if until == math.inf else stamp_of(self.opened, until))]
