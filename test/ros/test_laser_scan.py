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
"""The obstacle watch over DDS, with real programs: a laser that sees something, or fails."""

import math
import signal
import time

from optional_libraries import MISSING, optional_imports
from program import COMMAND, program
import pytest

qos_profile_sensor_data = MISSING
with optional_imports():
    from kachaka_simple_control.files.cdr import laser_scan, Scan
    from listener import Listener  # noqa: F401 (the fixture makes it)
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import LaserScan

pytestmark = [
    pytest.mark.ros, pytest.mark.distro, pytest.mark.real_time,
    pytest.mark.needs('rclpy', 'nav_msgs', 'sensor_msgs')]

PERIOD = 0.1
#: The motion is long enough for what happens.
WATCHED = """
name: watched
watch: true
rate: 20 Hz
steps:
  - forward: 1.5 m
"""


class Laser:
    """Publishes scans on a listener's node: a wall ahead, or nothing."""

    def __init__(self, listener):
        """Begin, ten times a second."""
        self.wall, self.offset, self.is_frozen = math.inf, 0.0, False
        self.newest = 0.0
        self._stamp = 0
        self.publisher = listener._node.create_publisher(
            LaserScan, 'lidar/scan', qos_profile_sensor_data)
        self.timer = listener._node.create_timer(PERIOD, self._publish)

    def _publish(self):
        if not self.is_frozen:
            self._stamp = time.time_ns() + round(self.offset * 1e9)
            self.newest = time.time() if not self.offset else self.newest
        # The angle 0 of the laser of a Kachaka is at the left of the robot.
        ranges = [math.inf] * 180 + [self.wall] + [math.inf] * 179
        self.publisher.publish(laser_scan(Scan(
            self._stamp, -math.pi - math.pi / 2.0, math.tau / 360.0, 0.05, 8.0, ranges), PERIOD,
            'laser_frame'))


@pytest.fixture
def laser(listener):
    """Return the laser of a listener."""
    return Laser(listener)


@pytest.fixture
def motion(tmp_path):
    """Return the path of a motion."""
    file = tmp_path / 'watched.yaml'
    file.write_text(WATCHED)
    return str(file)


def first_zero(listener, since):
    """Wait until a velocity of zero was sent after a time; return when it was."""
    return listener.wait_for(
        lambda velocity: velocity.time > since and not velocity.moves).time


def test_it_is_held_before_a_wall_and_goes_on(listener, laser, motion, tmp_path):
    with program([*COMMAND, motion], tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.linear_x > 0.29)
        # From the laser; the front of the robot is 8 cm ahead of it.
        laser.wall = 0.35
        appeared = time.time()
        zero = first_zero(listener, appeared)
        # The scan, a message, and the brake from 0.3 m/s, which takes 0.85 s.
        assert zero - appeared < 1.6
        time.sleep(0.5)
        laser.wall = math.inf
        gone = time.time()
        moving = listener.wait_for(lambda velocity: velocity.time > gone and velocity.moves)
        assert 0.9 <= moving.time - gone <= 1.6
        assert started.end(40.0) == 0
        for line in ('Held: obstacle', 'Goes on: it is free'):
            assert started.text.count(line) == 1


@pytest.mark.slow
@pytest.mark.parametrize('fault', ['silent', 'frozen', 'from the future'])
def test_without_new_scans_it_is_held(listener, laser, motion, tmp_path, fault):
    with program([*COMMAND, motion], tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.linear_x > 0.29)
        if fault == 'silent':
            laser.timer.cancel()
        elif fault == 'frozen':
            laser.is_frozen = True
        else:
            laser.offset = 60.0
        time.sleep(0.2)
        newest = laser.newest
        braking = listener.wait_for(
            lambda velocity: velocity.time > newest + 0.2 and velocity.linear_x < 0.299)
        # 0.4 s, a message, and what a machine takes that does other things.
        assert braking.time - newest <= 0.5 + 0.2
        first_zero(listener, newest)
        assert 'no scan of the laser' in started.text
        started.send(signal.SIGINT)
        assert started.end() == 130


def test_without_a_laser_nothing_is_sent(listener, motion, tmp_path):
    with program([*COMMAND, motion], tmp_path) as started:
        assert started.end(40.0) == 3
        assert 'none that says anything has come on /kachaka/lidar/scan' in started.text
        assert 'Traceback' not in started.text
    assert not any(velocity.moves for velocity in listener.received)


def test_a_scan_that_cannot_be_read_stops_the_robot(listener, laser, motion, tmp_path):
    with program([*COMMAND, motion], tmp_path) as started:
        listener.wait_for(lambda velocity: velocity.linear_x > 0.2)
        laser.timer.cancel()
        laser.publisher.publish(laser_scan(Scan(1, 0.0, 1.0, 0.1, 8.0, []), 0.1, 'l')[:20])
        assert started.end(20.0) == 1
        assert 'a callback failed' in started.text
        assert 'Traceback' not in started.text
    assert not listener.received[-1].moves
