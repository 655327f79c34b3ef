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
"""The simulated laser: what it sees, and when."""

from __future__ import annotations

import math
import statistics

from hypothesis import assume, given
from hypothesis import strategies as st
from kachaka_simple_control.files.floor_file import LaserParameters
from kachaka_simple_control.kachaka.robot_status import ERROR_OUT_OF_RANGE, SUCCESS
from kachaka_simple_control.kachaka.simulator.laser import NEAREST, seen
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.motion.floor import Floor, Person, Post
from kachaka_simple_control.motion.geometry import Pose, transform_point
import pytest

NUMBERS = st.floats(-3.0, 3.0)
POINTS = st.tuples(NUMBERS, NUMBERS)
POSES = st.builds(Pose, NUMBERS, NUMBERS, st.floats(-7.0, 7.0))
EXACT = LaserParameters(noise=0.0, holes=0.0)
#: A wall 1 m ahead of where a Kachaka starts.
WALL = Floor((((1.0, -5.0), (1.0, 5.0)),))


def first_hit(floor, pose, angle):
    """Return how far a ray goes, from the equations of line and circle, each thing alone."""
    heading = pose.theta + angle
    ray = complex(math.cos(heading), math.sin(heading))
    hits = [math.inf]
    for start, end in floor.segments:
        # In the frame of the ray, which is its x axis.
        one, two = ((complex(*point) - complex(pose.x, pose.y)) / ray for point in (start, end))
        if (one.imag > 0.0) != (two.imag > 0.0):
            hits.append(one.real + (two.real - one.real) * one.imag / (one.imag - two.imag))
    for _, at, radius in floor.rounds(0.0):
        middle = (complex(*at) - complex(pose.x, pose.y)) / ray
        if abs(middle.imag) < radius:
            hits.append(middle.real - math.sqrt(radius ** 2 - middle.imag ** 2))
    return min(hit for hit in hits if hit > 0.0)


def is_clear(floor, pose):
    """Return whether the laser is beside all walls, and each is longer than a micrometre."""
    for start, end in floor.segments:
        one, two = (complex(*point) - complex(pose.x, pose.y) for point in (start, end))
        length = abs(two - one)
        if length < 1e-6:
            return False
        share = -(one * (two - one).conjugate()).real / length ** 2
        if abs(one + min(max(share, 0.0), 1.0) * (two - one)) < 1e-6:
            return False
    return True


@given(st.lists(POINTS, min_size=2, max_size=5, unique=True), st.lists(
    st.builds(Post, POINTS, st.floats(0.01, 0.5)), max_size=2), POSES, st.integers(4, 400))
def test_each_ray_ends_where_geometry_says(wall, posts, pose, count):
    floor = Floor((tuple(wall),), tuple(posts))
    assume(is_clear(floor, pose))
    if any(math.dist(post.at, (pose.x, pose.y)) <= post.radius for post in posts):
        assert seen(floor, pose, 0.0, count) == [0.0] * count
        return
    angles = [-math.pi + index * math.tau / (count - 1) for index in range(count)]
    for angle, distance in zip(angles, seen(floor, pose, 0.0, count)):
        near = [first_hit(floor, pose, angle + beside) for beside in (-1e-9, 0.0, 1e-9)]
        # At the end of a wall or beside a post it may be the one or the other.
        assert any(distance == pytest.approx(hit, rel=1e-5, abs=1e-6) for hit in near)


def driving(parameters=EXACT, floor=WALL, **more):
    """Return a robot that has just begun to drive at 0.1 m/s, at 1 s."""
    robot = SimulatedKachaka(floor=floor, laser=parameters, **more)
    robot.set_manual_control(True, 1.0)
    robot.set_robot_velocity(1.0 / 3.0, 0.0, 1.0)
    return robot


def points_of(scan):
    """Return the points of a scan, seen from the wheel axle, each with its range."""
    mount = Pose(0.156, 0.0, math.pi / 2.0)
    return [(*transform_point((distance * math.cos(angle), distance * math.sin(angle)), mount),
             distance) for index, distance in enumerate(scan.ranges)
            if math.isfinite(distance)
            for angle in [scan.angle + index * scan.increment]]


def test_a_wall_ahead_is_where_it_is_and_what_is_behind_is_hidden():
    robot = driving(floor=Floor((*WALL.walls, ((-1.0, -0.5), (-1.0, 0.5)))))
    scan = robot.take_scan(1.1)
    points = points_of(scan)
    assert len(points) > 100
    for x, _, _ in points:
        assert x == pytest.approx(0.99, abs=1e-9)
    robot = driving(LaserParameters(noise=0.0, holes=0.0, view=math.tau), floor=Floor((
        *WALL.walls, ((-1.0, -5.0), (-1.0, 5.0)))))
    assert {round(x, 6) for x, _, _ in points_of(robot.take_scan(1.1))} == {0.99, -1.01}


def test_a_robot_elsewhere_on_the_floor_sees_it_from_there():
    robot = driving(place=Pose(0.0, 0.0, math.pi), floor=Floor((((-1.0, -5.0), (-1.0, 5.0)),)))
    assert points_of(robot.take_scan(1.1))[0][0] == pytest.approx(0.99, abs=1e-9)


def test_noise_and_holes_are_as_large_as_they_are_set():
    robot = driving(LaserParameters())
    ranges, errors, holes, counts = 0, [], [], set()
    for number in range(1, 200):
        now = 1.0 + 0.1 * number
        robot.activate_laser(1.0, now)
        scan = robot.take_scan(now)
        counts.add(len(scan.ranges))
        x = 1.0 - robot.state(now)[0].x - 0.156
        for index, distance in enumerate(scan.ranges):
            angle = math.remainder(scan.angle + index * scan.increment + math.pi / 2.0, math.tau)
            if abs(angle) < 1.0:
                ranges += 1
                if math.isfinite(distance) and distance > 0.0:
                    errors.append(distance - x / math.cos(angle))
                else:
                    holes.append(str(distance))
    assert statistics.stdev(errors) == pytest.approx(0.01, rel=0.02)
    assert statistics.mean(errors) == pytest.approx(0.0, abs=0.0005)
    assert len(holes) / ranges == pytest.approx(0.03, rel=0.1)
    assert set(holes) == {'0.0', 'inf', 'nan'}
    assert counts == {359, 360}


def test_what_is_too_near_or_too_far_says_nothing():
    robot = driving(LaserParameters(noise=0.0, holes=0.0, range=0.5), floor=Floor(posts=(
        Post((0.156, 0.05), 0.049),)))
    assert set(robot.take_scan(1.1).ranges) == {0.0, math.inf}
    assert NEAREST == 0.05
    robot = driving(LaserParameters(noise=0.0, holes=0.0, range=0.5))
    assert set(robot.take_scan(1.1).ranges) == {math.inf}


def test_it_turns_with_the_robot_and_five_seconds_more():
    robot = SimulatedKachaka(floor=WALL)
    assert robot.take_scan(1.0) is None
    robot = driving()
    # The command ends at 1.3 s.
    times = [time for time in (1.0 + 0.02 * tick for tick in range(400)) if robot.take_scan(time)]
    assert times[0] == pytest.approx(1.0)
    assert times[-1] == pytest.approx(6.2, abs=0.11)
    assert len(times) == pytest.approx(53, abs=1)
    robot.set_robot_velocity(0.0, 1.0, 10.0)
    assert robot.take_scan(10.1) is not None


def test_it_turns_when_it_is_asked_to_or_somebody_takes_the_robot():
    robot = SimulatedKachaka(floor=WALL)
    assert robot.activate_laser(5.0, 1.0) == SUCCESS
    assert [robot.is_scanning(time) for time in (1.0, 5.99, 6.01)] == [True, True, False]
    robot.set_manual_control(True, 10.0)
    robot.set_manual_control(True, 14.0)  # it is on already
    assert [robot.is_scanning(time) for time in (14.99, 15.01)] == [True, False]
    for duration in (-1.0, math.inf, math.nan):
        assert robot.activate_laser(duration, 20.0) == ERROR_OUT_OF_RANGE


def test_it_does_not_turn_on_the_dock():
    robot = SimulatedKachaka(docked=True, floor=WALL)
    robot.activate_laser(100.0, 1.0)
    assert not robot.is_scanning(1.0)
    robot.set_manual_control(True, 2.0)
    assert robot.is_scanning(2.1)


def test_a_seed_makes_the_same_noise_and_people_are_seen_while_they_are_there():
    floor = Floor(people=(Person((1.0, 0.0), 0.2, 2.0, 3.0),))

    def scans(seed):
        robot = driving(LaserParameters(holes=0.0), floor=floor, seed=seed)
        return [robot.take_scan(time) for time in (1.5, 2.5, 3.5)]
    assert scans(1) == scans(1)
    assert scans(1) != scans(2)
    assert [bool(points_of(scan)) for scan in scans(1)] == [False, True, False]


def test_an_empty_hall_has_scans_too():
    robot = driving(floor=None)
    assert set(robot.take_scan(1.1).ranges) == {math.inf}
