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
waits, and starts the command.  That must end with exit code 3, and send nothing.  Afterwards,
without the other program: how long the command takes from its start to t = 0.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import itertools
import os
from pathlib import Path
import re
import signal
import sys
import tempfile
import threading
import time
from typing import Any

from benchmarks.run import show
from kachaka_simple_control.analysis.message_timing import median
from kachaka_simple_control.ros.dds_transport import PROFILES, RANGE
from program import environment, Program, QUICK_COMMAND, quick_drive
from ros_domain import use_own_domain
from ros_support import bridge

#: The velocity of the other program [m/s]; the command sends 0 and 0.1.
VELOCITY = 0.05
RATES, HEAD_STARTS = (20, 5), (0.5, 1.0, 3.0)
#: The thresholds of the time from start to t = 0, median and worst [s].
MAX_MEDIAN, MAX_WORST = 2.2, 4.0
#: Matches the end time of a motion [s, system clock] and its duration [s].
COMPLETED = re.compile(r'\[([\d.]+)\] .*Motion completed: .* ([\d.]+) seconds')
TOPIC = '/kachaka/manual_control/cmd_vel'
OTHER = f"""
import signal, sys, threading
from geometry_msgs.msg import Twist
import rclpy
from rclpy.signals import SignalHandlerOptions
rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
end = threading.Event()
signal.signal(signal.SIGTERM, lambda *_: end.set())
node = rclpy.create_node('other')
publisher = node.create_publisher(Twist, '{TOPIC}', 10)
message = Twist()
message.linear.x = {VELOCITY}
while not end.wait(1.0 / float(sys.argv[1])):
    publisher.publish(message)
node.destroy_node()
rclpy.shutdown()
"""


class Observer:
    """Subscribes to the velocities, and records all that the other program did not send."""

    def __init__(self) -> None:
        from geometry_msgs.msg import Twist
        import rclpy
        from rclpy.qos import qos_profile_sensor_data
        rclpy.init(args=[])
        self.node = rclpy.create_node('observer')
        #: the arrival time [s, system clock] and the forward velocity [m/s] of each message
        self.ours: list[tuple[float, float]] = []
        self.others = 0
        self._subscription = self.node.create_subscription(
            Twist, TOPIC, self._on_velocity, qos_profile_sensor_data)
        threading.Thread(target=rclpy.spin, args=(self.node,), daemon=True).start()

    def _on_velocity(self, message: Any) -> None:
        if message.linear.x == VELOCITY:
            self.others += 1
        else:
            self.ours.append((time.time(), message.linear.x))


def command(folder: Path, options: Sequence[str]) -> list[str]:
    """Return the command line for a short drive, with the guardian and default times."""
    drive = quick_drive(folder)
    return [*drive[:len(drive) - len(QUICK_COMMAND[3:])], '--ros-args', *options]


def refused(observer: Observer, rate: float, head_start: float, drive: list[str]) -> str:
    """Start another program and then the command; return what was wrong, or an empty text."""
    observer.others = 0
    with Program([sys.executable, '-c', OTHER, str(rate)], env=environment()) as other:
        while observer.others < 2:
            time.sleep(0.01)
        time.sleep(head_start)
        observer.ours.clear()
        with Program(drive) as ours:
            code = ours.end(60.0)
            time.sleep(0.1)
            sent = len(observer.ours)
            text = ours.text
        other.close(5.0, signal.SIGTERM)
    return '' if code == 3 and not sent else f'exit code {code}, {sent} messages: {text[-300:]}'


def start_time(drive: list[str]) -> float:
    """
    Start the command, and return the time from its start to t = 0 [s].

    The time is from the command's log, because an observer may discover it later than the robot.
    """
    began = time.time()
    with Program(drive) as ours:
        ours.end(60.0)
        completed = COMPLETED.search(ours.text)
        assert completed is not None, ours.text
    return float(completed[1]) - float(completed[2]) - began


def main(arguments: list[str] | None = None) -> int:
    """Measure and print the results; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--trials', type=int, default=100)
    parser.add_argument('--starts', type=int, default=50)
    parser.add_argument('--no-odometry', action='store_true', help='as if the robot had none')
    options = parser.parse_args(arguments)
    use_own_domain()
    os.environ[RANGE] = 'LOCALHOST'
    for name in PROFILES.values():
        os.environ.pop(name, None)
    failures = []
    with tempfile.TemporaryDirectory() as name, bridge() as robot:
        robot.wait_for_text('ready')
        observer = Observer()
        drive = command(Path(name), [
            *(['-p', 'odometry_timeout:=0.0'] if options.no_odometry else [])])
        kinds = itertools.cycle(itertools.product(RATES, HEAD_STARTS))
        for number, kind in zip(range(1, options.trials + 1), kinds):
            show('another program drives', number, options.trials)
            if failure := refused(observer, *kind, drive):
                failures.append((kind, failure))
                print(*failures[-1])
            time.sleep(1.0)
        starts = []
        for number in range(1, options.starts + 1):
            show('starts', number, options.starts)
            starts.append(start_time(drive))
    print(f'refused, with nothing sent: {options.trials - len(failures)} of {options.trials}')
    print(f'start to t = 0: median {median(starts):.2f} s, worst {max(starts):.2f} s'
          if starts else '')
    is_kept = not failures and (
        not starts or (median(starts) <= MAX_MEDIAN and max(starts) <= MAX_WORST))
    print('kept' if is_kept else 'MISSED')
    return int(not is_kept)


if __name__ == '__main__':
    sys.exit(main())
