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
"""What a client of the simulated robot gets of its floor: scans, the map and the IMU."""

from __future__ import annotations

import io
import math
import time

from kachaka_simple_control.files.floor_file import LaserParameters
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.floor import Floor, Post
from optional_libraries import MISSING, optional_imports
import pytest

kachaka_api = pb2 = serving = MISSING
with optional_imports():
    from grpc_support import bench
    import kachaka_api
    from kachaka_api.generated import kachaka_api_pb2 as pb2
    from kachaka_simple_control.kachaka.simulator.grpc_server import serving

pytestmark = [pytest.mark.real_time, pytest.mark.needs('grpc', 'kachaka_api')]
WALL = ((0.8, -1.0), (0.8, 1.0))
FLOOR = Floor((WALL,), (Post((-0.5, 0.5), 0.1),))
EXACT = LaserParameters(noise=0.0, holes=0.0)


@pytest.fixture
def robot():
    """Yield a robot before a wall, which takes velocities."""
    with bench(floor=FLOOR, laser=EXACT) as started:
        yield started


def test_scans_come_ten_times_a_second_until_the_laser_rests(robot):
    empty = robot.get('GetRosLaserScan')
    assert len(empty.scan.ranges) == 0
    robot.enable()
    later = robot.later('GetRosLaserScan', empty.metadata.cursor)
    robot.pass_time(0.1)
    first = later.result()
    assert first.scan.header.frame_id == 'laser_frame'
    assert first.scan.header.stamp_nsec == robot.clock.stamp()
    assert len(first.scan.ranges) in (359, 360)
    angles = [first.scan.angle_min + first.scan.angle_increment * index
              for index in range(len(first.scan.ranges))]
    assert (angles[0], angles[-1]) == pytest.approx((-math.pi, first.scan.angle_max))
    # Ahead is at -90 deg of the laser.
    ahead = min(range(len(angles)), key=lambda index: abs(angles[index] + math.pi / 2.0))
    assert first.scan.ranges[ahead] == pytest.approx(0.8 - 0.156, abs=1e-3)
    robot.pass_time(0.1)
    second = robot.get('GetRosLaserScan')
    assert second.metadata.cursor > first.metadata.cursor
    # Five seconds after manual control came on.
    robot.pass_time(5.0)
    last = robot.get('GetRosLaserScan')
    assert robot.is_silent('GetRosLaserScan', last.metadata.cursor)
    robot.pass_time(1.0)
    assert robot.get('GetRosLaserScan') == last
    assert robot.call('ActivateLaserScan', pb2.ActivateLaserScanRequest(
        duration_sec=1.0)).result.success
    robot.pass_time(0.1)
    assert robot.get('GetRosLaserScan').metadata.cursor > last.metadata.cursor
    assert not robot.call('ActivateLaserScan', pb2.ActivateLaserScanRequest(
        duration_sec=-1.0)).result.success


def test_the_activator_of_the_sdk_keeps_the_laser_on():
    vision = pytest.importorskip('kachaka_api.util.vision')
    with serving(SimulatedKachaka(time.monotonic(), floor=FLOOR, laser=EXACT)) as server:
        client = kachaka_api.KachakaApiClient(server.address)
        assert len(client.get_ros_laser_scan().ranges) == 0
        with vision.LaserScanActivator(server.address).activate():
            end = time.monotonic() + 10.0
            while not client.get_ros_laser_scan().ranges and time.monotonic() < end:
                time.sleep(0.05)
        assert any(map(math.isfinite, client.get_ros_laser_scan().ranges))


def test_the_map_shows_walls_and_posts_where_they_are(robot):
    pillow = pytest.importorskip('PIL.Image')
    geometry = pytest.importorskip('kachaka_api.util.geometry')
    answer = robot.get('GetPngMap').map
    picture = pillow.open(io.BytesIO(answer.data))
    assert picture.size == (answer.width, answer.height)
    assert answer.resolution == 0.05
    places = geometry.MapImage2DGeometry(answer)
    occupied = set()
    for column in range(answer.width):
        for row in range(answer.height):
            if picture.getpixel((column, row)) == 174:
                place = places.calculate_robot_pose_matrix_from_pixel((column, row))
                occupied.add((round(float(place[0, 2]), 3), round(float(place[1, 2]), 3)))
            else:
                assert picture.getpixel((column, row)) == 253
    walls = {(x, y) for x, y in occupied if x > 0.5}
    assert {x for x, _ in walls} <= {0.775, 0.825}
    assert len(walls) >= 40
    for x, y in occupied - walls:
        assert math.dist((x, y), (-0.5, 0.5)) < 0.15
    assert len(occupied - walls) >= 12


def test_the_imu_feels_turns_and_accelerations(robot):
    robot.enable()
    robot.pass_time(0.02)
    at_rest = robot.get('GetRosImu').imu
    assert (at_rest.linear_acceleration.x, at_rest.angular_velocity.z) == (0.0, 0.0)
    assert at_rest.linear_acceleration.z == pytest.approx(9.8, abs=0.01)
    robot.velocity(0.5, 0.5)
    robot.pass_time(0.021)
    imu = robot.get('GetRosImu').imu
    assert imu.header.frame_id == 'imu_link'
    assert imu.angular_velocity.z == pytest.approx(0.785)
    assert imu.linear_acceleration.x == pytest.approx(0.15 / 0.021, rel=0.1)
    assert imu.linear_acceleration.y == pytest.approx(0.15 * 0.785)
    assert imu.orientation.z == pytest.approx(math.sin(0.785 * 0.021 / 2.0))
    assert len(imu.orientation_covariance) == 9


def test_a_contact_is_told_at_once():
    told = []
    with serving(SimulatedKachaka(time.monotonic(), floor=Floor((
            ((0.25, -1.0), (0.25, 1.0)),))), on_contact=told.append) as server:
        client = kachaka_api.KachakaApiClient(server.address)
        client.set_manual_control_enabled(True)
        client.set_robot_velocity(0.2, 0.0)
        end = time.monotonic() + 10.0
        while not told and time.monotonic() < end:
            time.sleep(0.02)
        (contact,) = told
        assert contact.pose.x == pytest.approx(0.013, abs=0.002)
        client.set_robot_velocity(-0.2, 0.0)
        time.sleep(0.2)
        assert client.get_robot_pose().x == pytest.approx(contact.pose.x)
    assert len(told) == 1
