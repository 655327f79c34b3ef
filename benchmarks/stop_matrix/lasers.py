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
Publish scans as the lasers of robots do, and fail as lasers may; the program has no other part.

Its arguments are the namespaces of the robots; each line on standard input is a ``Mode`` and a
namespace.  It prints a line for each scan: the namespace, the mode, and the time of the scan
[s, system clock].  It ends when standard input is closed.
"""

from __future__ import annotations

from enum import Enum
import math
import subprocess
import sys
import threading
import time

from benchmarks import ROOT
from kachaka_simple_control.files.cdr import laser_scan, Scan
from program import environment, Program
from waiting import poll

#: The topic of the scans, which is not that of the simulated robot's own laser; the robot file
#: that names it (``scripts.LASER``) also says where the laser is.
TOPIC = 'matrix/scan'
#: The time between two scans [s].
PERIOD = 0.1
#: The number of ranges, all around the robot; the first is behind it.
COUNT = 360
#: The distance of an obstacle from the laser [m], and its half width [ranges]: 8 cm ahead of the
#: outline of a robot whose laser is 8 cm behind its front edge.  It moves with the robot.
DISTANCE, HALF_WIDTH = 0.16, 5
#: The time by which the clock of a laser is ahead [s].
AHEAD = 3600.0
#: The part of a message that a broken laser publishes [bytes].
BROKEN_SIZE = 30
#: The longest times until a laser publishes its first scan, and until it obeys [s].
START_TIMEOUT, OBEY_TIMEOUT = 20.0, 2.0


class Mode(Enum):
    """The kinds of scans that a laser publishes."""

    #: a free way
    CLEAR = 'clear'
    #: an obstacle ahead
    OBSTACLE = 'obstacle'
    #: the last scan again and again
    FROZEN = 'frozen'
    #: scans with time stamps of the future
    FUTURE = 'future'
    #: a part of a message
    BROKEN = 'broken'


#: The modes whose scans count.
VALID = (Mode.CLEAR, Mode.OBSTACLE)


class Lasers(Program):
    """The process that publishes the scans of all robots of a domain."""

    def __init__(self, names: list[str], domain: int) -> None:
        #: the namespaces of the robots
        self.names = names
        super().__init__(
            [sys.executable, '-m', 'benchmarks.stop_matrix.lasers', *names], cwd=ROOT,
            stdin=subprocess.PIPE, env=environment(ROS_DOMAIN_ID=str(domain)))

    def wait_until_there(self) -> None:
        """
        Wait for the first scan.

        :raises RuntimeError: if it does not come within START_TIMEOUT
        """
        if not poll(lambda: self.text or self.is_over, START_TIMEOUT) or self.is_over:
            raise RuntimeError(f'no laser came; {self}')

    def switch(self, mode: Mode, name: str | None = None) -> float:
        """
        Switch the mode of a laser; return the time of its first message in this mode.

        :param name: the namespace of its robot; None for the first
        :raises RuntimeError: if no message follows within OBEY_TIMEOUT
        """
        name = name or self.names[0]
        count = len(self._times(name, mode))
        print(mode.value, name, file=self.process.stdin, flush=True)
        times = poll(lambda: self._times(name, mode)[count:], OBEY_TIMEOUT)
        if not times:
            raise RuntimeError(f'a laser did not obey; {self}')
        return times[0]

    def last_valid(self) -> float:
        """Return the time of the last scan of the first laser that counts [s, system clock]."""
        return max(self._times(self.names[0], *VALID))

    def clear(self) -> None:
        """Let all lasers publish a free way again, for another program."""
        for name in self.names:
            print(Mode.CLEAR.value, name, file=self.process.stdin, flush=True)

    def _times(self, name: str, *modes: Mode) -> list[float]:
        values = [mode.value for mode in modes]
        # The last line may not be complete yet.
        lines = [line.split() for line in self.text.split('\n')[:-1]]
        return [float(at) for who, mode, at in lines if who == name and mode in values]


def ranges(mode: Mode) -> list[float]:
    """Return what a laser measures [m]."""
    ahead = COUNT // 2
    return [DISTANCE if mode is Mode.OBSTACLE and abs(number - ahead) <= HALF_WIDTH else math.inf
            for number in range(COUNT)]


def message(mode: Mode, stamp: float) -> bytes:
    """Return a serialized message of a laser, with a time stamp [s]."""
    scan = Scan(
        round(1e9 * stamp), -math.pi, math.tau / COUNT, 0.05, 8.0, ranges(mode))
    data = laser_scan(scan, PERIOD, 'laser')
    return data[:BROKEN_SIZE] if mode is Mode.BROKEN else data


def main(names: list[str]) -> None:
    """Publish scans until standard input is closed."""
    from kachaka_simple_control.ros.dds_transport import use_udp_transport
    use_udp_transport()
    import rclpy
    from rclpy.node import Node
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import LaserScan
    context = rclpy.Context()
    context.init(args=[])
    node = Node('lasers', context=context, enable_rosout=False, start_parameter_services=False)
    publishers = {name: node.create_publisher(LaserScan, f'/{name}/{TOPIC}', (
        qos_profile_sensor_data)) for name in names}
    modes, stamps = dict.fromkeys(names, Mode.CLEAR), dict[str, float]()
    is_over = threading.Event()

    def obey() -> None:
        for line in sys.stdin:
            mode, name = line.split()
            modes[name] = Mode(mode)
        is_over.set()

    threading.Thread(target=obey, daemon=True).start()
    while not is_over.wait(PERIOD - time.time() % PERIOD):
        for name, publisher in publishers.items():
            mode, now = modes[name], time.time()
            if mode is Mode.FUTURE:
                stamps[name] = now + AHEAD
            elif mode is not Mode.FROZEN:
                stamps[name] = now
            publisher.publish(message(mode, stamps[name]))
            print(name, mode.value, repr(now), flush=True)
    node.destroy_node()
    context.try_shutdown()


if __name__ == '__main__':
    main(sys.argv[1:])
