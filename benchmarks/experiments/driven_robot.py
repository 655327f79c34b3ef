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
Whether a robot that another program drives is left alone; ``python -m`` runs this.

Each trial starts a program that drives the simulated robot, as its user would have started it,
waits, and starts the command.  That must end with exit code 3, and send nothing.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import contextlib
import itertools
import os
from pathlib import Path
import signal
import sys
import tempfile
import time
from typing import TYPE_CHECKING

from benchmarks.run import show
from kachaka_simple_control.ros.dds_transport import PROFILES, RANGE
from program import environment, Program, QUICK_COMMAND, quick_drive
from ros_domain import use_own_domain
from ros_support import bridge

if TYPE_CHECKING:
    from benchmarks.stop_matrix.observer import RobotRecorder

#: The velocity of the other program [m/s]; the command sends 0 and 0.1.
VELOCITY = 0.05
RATES, HEAD_STARTS = (20, 5), (0.5, 1.0, 3.0)
OTHER = f"""
import signal, sys, threading
from geometry_msgs.msg import Twist
import rclpy
from rclpy.signals import SignalHandlerOptions
rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
end = threading.Event()
signal.signal(signal.SIGTERM, lambda *_: end.set())
node = rclpy.create_node('other')
publisher = node.create_publisher(Twist, '/kachaka/manual_control/cmd_vel', 10)
message = Twist()
message.linear.x = {VELOCITY}
while not end.wait(1.0 / float(sys.argv[1])):
    publisher.publish(message)
node.destroy_node()
rclpy.shutdown()
"""


def command(folder: Path, options: Sequence[str]) -> list[str]:
    """Return the command line for a short drive, with the guardian and default times."""
    return [*quick_drive(folder)[:-len(QUICK_COMMAND[3:])], '--ros-args', *options]


def refused(robot: RobotRecorder, rate: float, head_start: float, drive: list[str]) -> str:
    """Start another program and then the command; return what was wrong, or an empty text."""
    began = time.time()
    with Program([sys.executable, '-c', OTHER, str(rate)], env=environment()) as other:
        while len(robot.sent_since(began)) < 2:
            time.sleep(0.01)
        time.sleep(head_start)
        with Program(drive) as ours:
            code = ours.end(60.0)
            time.sleep(0.1)
        other.close(5.0, signal.SIGTERM)
    sent = sum(velocity.linear_x != VELOCITY for velocity in robot.sent_since(began))
    robot.clear()
    return '' if code == 3 and not sent else f'exit code {code}, sent {sent}: {ours.text[-300:]}'


def main(arguments: list[str] | None = None) -> int:
    """Measure and print the results; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--trials', type=int, default=100)
    parser.add_argument('--no-odometry', action='store_true', help='as if the robot had none')
    options = parser.parse_args(arguments)
    use_own_domain()
    os.environ[RANGE] = 'LOCALHOST'
    for name in PROFILES.values():
        os.environ.pop(name, None)
    from benchmarks.stop_matrix.observer import Observer
    failures = []
    with tempfile.TemporaryDirectory() as name, bridge() as robot, contextlib.closing(
            Observer(int(os.environ['ROS_DOMAIN_ID']))) as observer:
        robot.wait_for_text('ready')
        recorder = observer.record('kachaka')
        drive = command(Path(name), ['-p', 'odometry_timeout:=0.0'] if options.no_odometry else [])
        kinds = itertools.cycle(itertools.product(RATES, HEAD_STARTS))
        for number, kind in zip(range(1, options.trials + 1), kinds):
            show('another program drives', number, options.trials)
            if failure := refused(recorder, *kind, drive):
                failures.append((kind, failure))
                print(*failures[-1])
            time.sleep(1.0)
    print(f'refused, with nothing sent: {options.trials - len(failures)} of {options.trials}')
    print('MISSED' if failures else 'kept')
    return int(bool(failures))


if __name__ == '__main__':
    sys.exit(main())
