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
"""Tasks of the simulated robot: they arrive, they can be stopped, and the robot stays stopped."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st
from kachaka_simple_control.kachaka.robot_status import (
    ERROR_CANCELLED,
    ERROR_NO_MANUAL_CONTROL,
    ERROR_NOTHING_TO_DO,
    ERROR_PAUSED,
    ERROR_STUCK,
    SUCCESS,
)
from kachaka_simple_control.kachaka.simulator.drive_model import SimulationParameters
from kachaka_simple_control.kachaka.simulator.robot import SimulatedKachaka
from kachaka_simple_control.kachaka.simulator.tasks import (
    drive_straight,
    plan_to_pose,
    StandStill,
    Task,
    turn_in_place,
)
from kachaka_simple_control.motion.geometry import ORIGIN, Pose, ZERO
import pytest


def send(robot, *actions, now=0.0, name='task', drop_others=True, ends_docked=False):
    """Start a task."""
    return robot.start_task(Task(name, actions, ends_docked), now, drop_others)


def results(robot, now):
    """Return names and codes of the results of the tasks."""
    return [(result.task.identity, result.code) for result in robot.task_results(now)]


def test_a_straight_line_is_exact_and_takes_its_time():
    """0.3 m at 0.1 m/s: 3 s."""
    robot = SimulatedKachaka()
    assert send(robot, drive_straight(0.3, 0.1), now=1.0) == SUCCESS
    assert robot.state(2.5)[0].x == pytest.approx(0.15, abs=1e-12)
    assert robot.task(3.98).identity == 'task'
    assert robot.task(4.05) is None
    assert robot.state(9.0) == (Pose(pytest.approx(0.3, abs=1e-12)), ZERO)
    assert results(robot, 9.0) == [('task', SUCCESS)]


@pytest.mark.parametrize(('action', 'pose'), [
    (drive_straight(-0.4), Pose(-0.4)), (drive_straight(1.0, 9.0), Pose(1.0)),
    (turn_in_place(math.pi), Pose(theta=math.pi)), (turn_in_place(-7.0), Pose(theta=-7.0)),
    (drive_straight(0.0), ORIGIN)])
def test_a_task_ends_at_its_goal(action, pose):
    """Backwards, faster than it can, more than a turn, and nothing at all."""
    robot = SimulatedKachaka()
    send(robot, action)
    assert robot.state(20.0)[0].x == pytest.approx(pose.x, abs=1e-9)
    assert robot.state(20.0)[0].theta == pytest.approx(pose.theta, abs=1e-9)
    assert results(robot, 20.0) == [('task', SUCCESS)]


@pytest.mark.parametrize('lag', [0.1, 0.3])
def test_a_robot_with_lag_does_not_overshoot(lag):
    """It arrives within 10 s."""
    robot = SimulatedKachaka(parameters=SimulationParameters(lag=lag))
    send(robot, drive_straight(0.3))
    assert max(robot.state(0.01 * tick)[0].x for tick in range(1000)) < 0.3 + 1e-3
    assert results(robot, 10.0) == [('task', SUCCESS)]


@settings(max_examples=25)
@given(
    x=st.floats(-1.0, 1.0), y=st.floats(-1.0, 1.0), theta=st.floats(-10.0, 10.0))
def test_a_pose_is_reached_from_anywhere(x, y, theta):
    """With the heading of the pose, whichever turn it is in."""
    robot = SimulatedKachaka()
    send(robot, turn_in_place(1.0), drive_straight(0.3))
    send(robot, *plan_to_pose(Pose(x, y, theta)), now=10.0)
    pose, _ = robot.state(60.0)
    assert (pose.x, pose.y) == (pytest.approx(x, abs=2e-4), pytest.approx(y, abs=2e-4))
    assert math.remainder(pose.theta - theta, math.tau) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize('error', [
    {'odometry_scale': 0.95}, {'wheel_ratio': 1.02}, {'track_ratio': 1.1}])
def test_with_wrong_odometry_it_arrives_by_odometry(error):
    """As a goal is given in its frame; the robot knows no other."""
    robot = SimulatedKachaka(parameters=SimulationParameters(**error))
    send(robot, *plan_to_pose(Pose(0.5, 0.4, 2.0)))
    pose, _ = robot.odometry(60.0)
    assert results(robot, 60.0) == [('task', SUCCESS)]
    assert (pose.x, pose.y, pose.theta) == pytest.approx((0.5, 0.4, 2.0), abs=2e-4)
    assert robot.state(60.0)[0] != pose


def test_a_robot_that_cannot_reach_its_goal_fails_and_stops():
    """Its wheels turn and it does not move."""
    robot = SimulatedKachaka(parameters=SimulationParameters(linear_gain=0.0))
    send(robot, drive_straight(0.3), turn_in_place(1.0))
    assert robot.task(12.0) is not None
    assert results(robot, 14.0) == [('task', ERROR_STUCK)]
    assert robot.state(20.0) == (ORIGIN, ZERO)


def test_a_task_ends_the_one_before_unless_it_waits():
    """The robot goes on from where it is."""
    robot = SimulatedKachaka()
    send(robot, drive_straight(1.0, 0.1), name='a')
    send(robot, drive_straight(1.0, 0.1), now=1.0, name='b')
    send(robot, drive_straight(-0.3, 0.1), now=2.0, name='c', drop_others=False)
    assert robot.task(10.9).identity == 'b'
    assert robot.task(11.1).identity == 'c'
    assert results(robot, 20.0) == [('a', ERROR_CANCELLED), ('b', SUCCESS), ('c', SUCCESS)]
    assert robot.state(20.0)[0].x == pytest.approx(0.1 + 1.0 - 0.3, abs=1e-9)


def test_cancelling_stops_at_once_and_drops_all_tasks():
    """It returns the running task; a second time none."""
    robot = SimulatedKachaka()
    send(robot, drive_straight(1.0, 0.1), name='a')
    send(robot, drive_straight(1.0, 0.1), name='b', drop_others=False)
    assert robot.cancel_tasks(1.0).identity == 'a'
    assert robot.cancel_tasks(1.0) is None
    assert robot.state(9.0) == (Pose(pytest.approx(0.1, abs=1e-12)), ZERO)
    assert results(robot, 9.0) == [('a', ERROR_CANCELLED), ('b', ERROR_CANCELLED)]


def test_a_standstill_that_may_be_ended_can_be_ended():
    """And no other."""
    robot = SimulatedKachaka()
    assert robot.end_standstill(0.0) == ERROR_NOTHING_TO_DO
    send(robot, StandStill(30.0), now=0.0)
    assert robot.end_standstill(1.0) == ERROR_NOTHING_TO_DO
    send(robot, StandStill(30.0, can_be_ended=True), drive_straight(0.1, 0.1), now=2.0)
    assert robot.end_standstill(5.0) == SUCCESS
    assert robot.state(5.5)[0].x == pytest.approx(0.05, abs=1e-12)
    assert results(robot, 7.0)[-1] == ('task', SUCCESS)


def test_tasks_and_manual_control_end_each_other():
    """The last one has the robot."""
    robot = SimulatedKachaka()
    robot.set_manual_control(True, 0.0)
    # Its command timeout would end within a control period of the task and must not stop it.
    robot.set_robot_velocity(1.0, 0.0, 0.91)
    send(robot, drive_straight(1.0, 0.1), now=1.0)
    assert robot.manual_control(1.1) is False
    assert robot.set_robot_velocity(1.0, 0.0, 1.1) == ERROR_NO_MANUAL_CONTROL
    assert robot.state(2.0)[0].x == pytest.approx(0.027 + 0.1, abs=1e-12)
    robot.set_manual_control(True, 2.0)
    assert robot.state(3.0) == (Pose(pytest.approx(0.127, abs=1e-12)), ZERO)
    assert results(robot, 3.0) == [('task', ERROR_CANCELLED)]


def test_on_the_dock_a_task_that_moves_undocks_first():
    """One that does not move stays there."""
    robot = SimulatedKachaka(docked=True)
    send(robot, StandStill(1.0), now=0.0)
    assert robot.is_docked(2.0) is True
    send(robot, turn_in_place(1.0), now=2.0)
    assert robot.is_docked(2.0) is False
    pose, _ = robot.state(9.0)
    assert (pose.x, pose.theta) == (pytest.approx(0.2), pytest.approx(1.0))


@pytest.mark.parametrize('docked', [True, False])
def test_the_robot_docks_from_any_pose(docked):
    """Backwards onto its dock; a docked robot needs no actions."""
    robot = SimulatedKachaka(docked=docked)
    send(robot, drive_straight(0.4), turn_in_place(2.0), drive_straight(0.3))
    send(robot, *robot.actions_to_dock(20.0), now=20.0, ends_docked=True)
    assert robot.is_docked(25.0) is False
    pose, velocity = robot.state(60.0)
    assert robot.is_docked(60.0) is True
    assert (pose.x, pose.y) == (pytest.approx(robot.dock.x), pytest.approx(0.0, abs=1e-9))
    assert math.cos(pose.theta) == pytest.approx(1.0)
    assert velocity == ZERO
    assert robot.actions_to_dock(60.0) == ()


@pytest.mark.parametrize('docked', [True, False])
def test_emergency_stop_ends_everything_at_once(docked):
    """A task, undocking, manual control; and nothing moves after the pause."""
    robot = SimulatedKachaka(docked=docked)
    if docked:
        robot.set_manual_control(True, 0.0)
    else:
        send(robot, drive_straight(1.0, 0.1))
    assert robot.set_emergency_stop(1.0) == SUCCESS
    assert robot.errors(1.0) == (ERROR_PAUSED,)
    assert robot.set_manual_control(True, 2.0) == ERROR_PAUSED
    assert robot.set_robot_velocity(1.0, 0.0, 2.0) == ERROR_PAUSED
    assert send(robot, drive_straight(1.0), now=2.0) == ERROR_PAUSED
    assert robot.set_manual_control(False, 2.0) == SUCCESS
    assert send(robot, StandStill(1.0), now=2.0) == SUCCESS
    robot.press_power_button(4.0)
    assert robot.errors(4.0) == ()
    assert robot.state(9.0) == (Pose(pytest.approx(0.1, abs=1e-12)), ZERO)
    assert robot.manual_control(9.0) is False
    assert robot.set_manual_control(True, 9.0) == SUCCESS


def test_the_power_button_pauses_a_moving_robot():
    """As an emergency stop does."""
    robot = SimulatedKachaka()
    robot.set_manual_control(True, 0.0)
    robot.set_robot_velocity(1.0, 0.0, 1.0)
    robot.press_power_button(1.1)
    assert robot.state(9.0)[0].x == pytest.approx(0.03)
    assert robot.errors(9.0) == (ERROR_PAUSED,)


def test_the_next_change_is_what_ends_first():
    """A command timeout, manual control; a robot at rest never changes."""
    robot = SimulatedKachaka()
    assert robot.next_change(0.0) == math.inf
    robot.set_manual_control(True, 0.0)
    robot.set_robot_velocity(1.0, 0.0, 1.0)
    assert robot.next_change(1.0) == pytest.approx(1.3)
    assert robot.next_change(1.3) == 60.0
    assert robot.next_change(60.0) == math.inf
