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
"""A simulated robot that touches what stands on its floor stays there."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
from kachaka_simple_control.files.robot_profile import KACHAKA
from kachaka_simple_control.kachaka.robot_status import ERROR_STUCK, SUCCESS
from kachaka_simple_control.kachaka.simulator.contact import STEP
from kachaka_simple_control.kachaka.simulator.drive_model import IDEAL, SimulationParameters
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.kachaka.simulator.tasks import drive_straight, Task
from kachaka_simple_control.motion.floor import Floor, Person, Post
from kachaka_simple_control.motion.geometry import integrate, ORIGIN, Pose, Velocity, ZERO
from kachaka_simple_control.motion.separation import Hull
import pytest

HULL = Hull.of(KACHAKA.footprint)
#: The front of a Kachaka is 0.237 m ahead of its axle.
WALL = Floor((((0.8, -1.0), (0.8, 1.0)),))


def drive(robot, velocity, start, end):
    """Send a velocity ten times a second, as parts of the largest."""
    limits = KACHAKA.limits
    for tick in range(round((end - start) * 10.0)):
        robot.set_robot_velocity(
            velocity.linear_x / limits.max_linear_velocity,
            velocity.angular_z / limits.max_angular_velocity, start + 0.1 * tick)


def robot_on(floor, parameters=IDEAL, **more):
    """Return a robot under manual control from 0 s on."""
    robot = SimulatedKachaka(0.0, parameters, floor=floor, **more)
    robot.set_manual_control(True, 0.0)
    return robot


@pytest.mark.parametrize('parameters', [
    IDEAL, SimulationParameters(lag=0.1, dead_time=0.2, velocity_noise=0.05)])
def test_a_wall_ends_a_drive_for_ever(parameters):
    robot = robot_on(WALL, parameters)
    drive(robot, Velocity(0.3), 1.0, 3.5)
    contact = robot.contact(3.6)
    assert contact.kind == 'wall'
    assert contact.pose.x == pytest.approx(0.563, abs=STEP)
    assert contact.time == pytest.approx(1.0 + 0.563 / 0.3 + (
        0.0 if parameters is IDEAL else 0.3), abs=0.02)
    assert str(contact).startswith(
        f'contact with a wall at x {contact.pose.x:.3f} m, y 0.000 m, 0.0 deg after ')
    for now in (4.0, 10.0):
        robot.set_robot_velocity(-1.0, 1.0, now)
        assert robot.state(now + 0.2) == (contact.pose, ZERO)
        assert robot.odometry(now + 0.2)[1] == ZERO
    assert robot.contact(20.0) == contact


def test_a_task_into_a_wall_fails():
    robot = SimulatedKachaka(floor=WALL)
    assert robot.start_task(Task('1', (drive_straight(1.0),)), 1.0) == SUCCESS
    assert [result.code for result in robot.task_results(60.0)] == [ERROR_STUCK]
    assert robot.contact(60.0) is not None


@pytest.mark.slow
@given(
    st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6)), st.floats(0.01, 0.1),
    st.floats(-0.3, 0.3), st.floats(-1.5, 1.5), st.lists(st.floats(1.0, 4.0), max_size=5))
def test_the_contact_is_where_the_path_first_meets_the_floor(
        at, radius, linear, angular, queries):
    """However often the robot is asked."""
    floor = Floor(posts=(Post(at, radius),))
    if floor.nearest(HULL, ORIGIN, 0.0).distance < STEP:
        return
    robot = robot_on(floor)
    velocity = Velocity(linear, angular)
    moments = sorted([(1.0 + 0.1 * tick, True) for tick in range(20)]
                     + [(query, False) for query in queries])
    for now, is_command in moments:
        if is_command:
            drive(robot, velocity, now, now + 0.1)
        else:
            robot.state(now)
    contact = robot.contact(4.0)
    path = [integrate(ORIGIN, velocity, 0.001 * tick) for tick in range(2201)]
    distances = [floor.nearest(HULL, pose, 0.0).distance for pose in path]
    first = next((tick for tick, distance in enumerate(distances) if not distance), None)
    if first is None:
        assert contact is None
        return
    # It may be found later by the way between two looks, if it lasts for so long.
    late = math.ceil(1000.0 * STEP / (abs(linear) + HULL.reach * abs(angular))) + 2
    if first + late < len(path) and not any(distances[first:first + late]):
        assert contact.kind == 'post'
        assert first - 1 <= round(1000.0 * (contact.time - 1.0)) <= first + late


def test_beside_a_wall_it_drives_on():
    robot = robot_on(Floor((((-1.0, 0.122), (3.0, 0.122)), ((-1.0, -0.122), (3.0, -0.122)))))
    drive(robot, Velocity(0.3), 1.0, 4.0)
    assert robot.contact(5.0) is None
    assert robot.state(5.0)[0].x == pytest.approx(0.96)


def test_a_turn_on_the_spot_sweeps_its_corners():
    # The front left corner, 0.266 m from the axle, comes there after 0.93 rad.
    robot = robot_on(Floor(posts=(Post((0.05, 0.265), 0.01),)))
    drive(robot, Velocity(0.0, 1.0), 1.0, 3.0)
    contact = robot.contact(4.0)
    assert contact.kind == 'post'
    assert 0.5 < contact.pose.theta < 1.1
    assert robot.state(4.0)[0] == contact.pose


def test_a_fleets_floor_is_seen_from_where_all_starts_are():
    robot = robot_on(WALL, place=Pose(0.0, -0.9, 0.0))
    drive(robot, Velocity(0.3), 1.0, 4.0)
    pose = robot.contact(4.0).pose
    assert (pose.x, pose.y) == (pytest.approx(0.563, abs=STEP), -0.9)
    robot = robot_on(WALL, place=Pose(0.0, -1.2, 0.0))
    drive(robot, Velocity(0.3), 1.0, 4.0)
    assert robot.contact(4.0) is None


def test_who_walks_into_a_moving_robot_is_touched_and_into_a_standing_one_when_it_moves():
    crossing = Floor(people=(Person((2.0, 0.0), 0.2, 0.0, 4.0, (-2.0, 0.0)),))
    robot = robot_on(crossing)
    drive(robot, Velocity(0.0, 0.1), 0.0, 4.0)
    contact = robot.contact(5.0)
    assert (contact.kind, contact.time) == ('person', pytest.approx(2.0 - 0.437, abs=0.05))
    robot = robot_on(crossing)
    assert robot.contact(2.0) is None  # the person is where the robot is
    assert robot.contact(5.0) is None
    robot = robot_on(crossing)
    drive(robot, Velocity(0.1), 2.0, 2.1)
    assert robot.contact(3.0).time == pytest.approx(2.0, abs=0.002)


def test_who_comes_is_touched_at_once():
    robot = robot_on(Floor(people=(Person((0.5, 0.0), 0.2, 1.5),)))
    drive(robot, Velocity(0.3), 1.0, 3.0)
    assert robot.contact(3.0).time == pytest.approx(1.5, abs=0.005)


def test_an_empty_floor_changes_nothing():
    poses = []
    for floor in (None, Floor()):
        robot = robot_on(floor, SimulationParameters(lag=0.1, velocity_noise=0.1), seed=3)
        drive(robot, Velocity(0.3, 0.5), 1.0, 3.0)
        poses.append(robot.state(4.0))
    assert poses[0] == poses[1]
    assert robot_on(None).contact(1.0) is None
