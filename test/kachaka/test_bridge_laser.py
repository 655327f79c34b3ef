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
"""The laser of a simulated robot over real DDS, and the contact with its floor."""

from __future__ import annotations

import math
import time

import pytest
from ros_support import bridge
from waiting import TIMEOUT, wait_until

pytestmark = [
    pytest.mark.ros, pytest.mark.distro,
    pytest.mark.needs('rclpy', 'nav_msgs', 'sensor_msgs', 'yaml', 'jsonschema')]
FLOOR = """
walls: [[[0.3 m, -1 m], [0.3 m, 1 m]]]
laser: {noise: 0 cm, holes: 0}
"""


@pytest.fixture
def floor(tmp_path):
    """Return the path of a floor with a wall 6 cm ahead of the robot."""
    file = tmp_path / 'floor.yaml'
    file.write_text(FLOOR)
    return str(file)


def scans(probe, name):
    """Return a list that scans are added to, with the time of their arrival."""
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import LaserScan
    received = []
    probe.node.create_subscription(
        LaserScan, name, lambda message: received.append((time.monotonic(), message)),
        qos_profile_sensor_data)
    return received


def activate(probe, namespace):
    """Call the service; return its response."""
    from std_srvs.srv import Trigger
    client = probe.node.create_client(Trigger, f'{namespace}/lidar/activate')
    assert client.wait_for_service(TIMEOUT)
    future = client.call_async(Trigger.Request())
    wait_until(future.done)
    return future.result()


def test_scans_show_the_wall_and_a_contact_is_an_error_line(probe, namespace, floor):
    with bridge('--namespace', namespace, '--floor', floor, '--frame-prefix', 'r1/') as process:
        received = scans(probe, f'{namespace}/lidar/scan')
        publisher = probe.publisher(namespace, process)
        assert activate(probe, namespace).success
        wait_until(lambda: len(received) > 5)
        _, message = received[0]
        assert message.header.frame_id == 'r1/laser_frame'
        now = probe.node.get_clock().now().nanoseconds
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert 0 <= now - stamp < 60 * 10**9
        assert message.angle_min == pytest.approx(-math.pi)
        assert message.angle_max == pytest.approx(math.pi)
        assert message.scan_time == pytest.approx(0.1)
        assert (message.range_min, message.range_max) == pytest.approx((0.05, 8.0))
        ahead = round((-math.pi / 2.0 - message.angle_min) / message.angle_increment)
        assert message.ranges[ahead] == pytest.approx(0.3 - 0.156, abs=1e-4)
        behind = round((math.pi / 2.0 - message.angle_min) / message.angle_increment)
        assert math.isinf(message.ranges[behind])
        probe.set_enabled(namespace, True)
        probe.send(publisher, 0.3)
        wait_until(lambda: 'contact with a wall at x 0.06' in process.text)
        (line,) = [line for line in process.lines if 'contact with' in line]
        assert line.startswith('[ERROR]')
        assert line.endswith('the robot stays there')


def test_in_an_empty_hall_the_laser_turns_as_well_and_goes_off(probe, namespace):
    with bridge('--namespace', namespace):
        received = scans(probe, f'{namespace}/lidar/scan')
        time.sleep(1.0)
        assert received == []
        began = time.monotonic()
        assert activate(probe, namespace).success
        wait_until(lambda: received)
        time.sleep(max(0.0, began + 7.0 - time.monotonic()))
        times = [arrival for arrival, _ in received]
        assert times[-1] - times[0] == pytest.approx(4.9, abs=1.0)
        assert len(times) == pytest.approx(50, abs=15)
        assert not any(0.0 < distance < math.inf for _, message in received
                       for distance in message.ranges)


def test_robots_of_a_fleet_share_one_floor(probe, floor, tmp_path):
    """The second stands 0.1 m behind the first, and sees the wall farther away."""
    file = tmp_path / 'fleet.yaml'
    file.write_text('robots:\n  laser_a: {motion: spin}\n'
                    '  laser_b: {motion: spin, start: {x: -0.1 m, y: 0.5 m}}\n')
    with bridge('--robots', str(file), '--floor', floor):
        for name, distance in (('laser_a', 0.144), ('laser_b', 0.244)):
            received = scans(probe, f'/{name}/lidar/scan')
            assert activate(probe, f'/{name}').success
            wait_until(lambda seen=received: seen)
            _, message = received[0]
            assert message.header.frame_id == f'{name}/laser_frame'
            ahead = round((-math.pi / 2.0 - message.angle_min) / message.angle_increment)
            assert message.ranges[ahead] == pytest.approx(distance, abs=1e-3)


@pytest.mark.parametrize('text, lines', [
    ('walls: [[[1 m, 0 m]]]\nposts: 1\n', ['floor.yaml:1: walls[0]: ', 'floor.yaml:2: posts: ']),
    (None, ['floor.yaml: there is no such file'])])
def test_a_floor_with_errors_has_a_line_for_each(text, lines, tmp_path):
    file = tmp_path / 'floor.yaml'
    if text is not None:
        file.write_text(text)
    with bridge('--floor', str(file)) as process:
        assert process.end() == 2
    assert len(process.lines) == len(lines)
    for line, words in zip(process.lines, lines):
        assert words in line
