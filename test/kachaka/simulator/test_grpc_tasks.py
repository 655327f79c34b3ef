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
"""Commands over gRPC: their state, their results, and how they end each other."""

from __future__ import annotations

import math

from kachaka_simple_control.kachaka.robot_status import (
    ERROR_NO_FURNITURE,
    ERROR_NOT_A_VELOCITY,
    ERROR_NOTHING_TO_DO,
    ERROR_OUT_OF_RANGE,
    ERROR_UNKNOWN_NAME,
)
from optional_libraries import MISSING, optional_imports
import pytest

pb2 = MISSING
with optional_imports():
    from grpc_support import bench
    from kachaka_api.generated import kachaka_api_pb2 as pb2

pytestmark = pytest.mark.needs('grpc', 'kachaka_api')

FORWARD = pb2.Command(
    move_forward_command=pb2.MoveForwardCommand(distance_meter=0.5, speed=0.1))


@pytest.fixture
def robot():
    """Yield an idle robot."""
    with bench() as started:
        yield started


def start(robot, command, **more):
    """Send a command; return the response."""
    return robot.call('StartCommand', pb2.StartCommandRequest(command=command, **more))


def test_a_new_robot_reports_no_command(robot):
    """No command, no result, and nothing to cancel."""
    state = robot.get('GetCommandState')
    assert state.state == pb2.COMMAND_STATE_PENDING
    assert not state.HasField('command')
    last = robot.get('GetLastCommandResult')
    assert (last.command_id, last.HasField('result')) == ('', False)
    assert robot.call('CancelCommand').result.error_code == ERROR_NOTHING_TO_DO
    assert robot.call('Proceed').result.error_code == ERROR_NOTHING_TO_DO


def test_a_command_is_reported_from_its_begin_to_its_end(robot):
    """To long polls, as those of the SDK and of the official bridge."""
    state = robot.later('GetCommandState', robot.get('GetCommandState').metadata.cursor)
    result = robot.later(
        'GetLastCommandResult', robot.get('GetLastCommandResult').metadata.cursor)
    started = start(robot, FORWARD)
    assert started.result.success
    running = state.result()
    assert (running.state, running.command, running.command_id) == (
        pb2.COMMAND_STATE_RUNNING, FORWARD, started.command_id)
    over = robot.later('GetCommandState', running.metadata.cursor)
    robot.pass_time(4.9)
    assert not result.done()
    robot.pass_time(0.2)
    last = result.result()
    assert (last.result.success, last.command, last.command_id) == (
        True, FORWARD, started.command_id)
    assert over.result().state == pb2.COMMAND_STATE_PENDING
    assert robot.x() == pytest.approx(0.5, abs=1e-9)
    history = robot.get('GetHistoryList').histories
    assert [(item.id, item.success, item.command_executed_time) for item in history] == [
        (started.command_id, True, 1000)]


def test_home_is_the_dock(robot):
    """By its name, too; the next command undocks the robot."""
    start(robot, FORWARD)
    robot.pass_time(9.0)
    assert start(robot, pb2.Command(return_home_command=pb2.ReturnHomeCommand())).result.success
    robot.pass_time(30.0)
    dock = robot.get('GetLocations').locations[0]
    assert dock.type == pb2.LOCATION_TYPE_CHARGER
    assert robot.x() == pytest.approx(dock.pose.x, abs=1e-9)
    assert robot.get('GetBatteryInfo').power_supply_status == pb2.POWER_SUPPLY_STATUS_CHARGING
    home = pb2.MoveToLocationCommand(target_location_id=dock.id)
    assert start(robot, pb2.Command(move_to_location_command=home)).result.success
    robot.pass_time(1.0)
    assert robot.get('GetLastCommandResult').result.success
    start(robot, FORWARD)
    robot.pass_time(20.0)
    assert robot.x() == pytest.approx(dock.pose.x + 0.2 + 0.5, abs=1e-9)


def test_a_pose_is_one_of_the_map(robot):
    """Its map frame may differ from odometry."""
    robot.call('SetRobotPose', pb2.SetRobotPoseRequest(pose=pb2.Pose(x=1.0, theta=math.pi)))
    goal = pb2.MoveToPoseCommand(x=0.0, y=0.5, yaw=0.3)
    assert start(robot, pb2.Command(move_to_pose_command=goal)).result.success
    robot.pass_time(60.0)
    pose = robot.get('GetRobotPose').pose
    assert (pose.x, pose.y, pose.theta) == pytest.approx((0.0, 0.5, 0.3), abs=1e-6)
    assert robot.x() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(('command', 'distance'), [
    (pb2.Command(localize_command=pb2.LocalizeCommand()), 0.0),
    (pb2.Command(speak_command=pb2.SpeakCommand(text='hello')), 0.0),
    (pb2.Command(move_by_velocity_with_muted_sensors_command=(
        pb2.MoveByVelocityWithMutedSensorsCommand(
            signed_velocity=-0.1, move_duration_sec=2.0))), -0.2)])
def test_other_commands_succeed(robot, command, distance):
    assert start(robot, command).result.success
    robot.pass_time(20.0)
    assert robot.get('GetLastCommandResult').result.success
    assert robot.x() == pytest.approx(distance, abs=1e-9)


@pytest.mark.parametrize(('command', 'code'), [
    (pb2.Command(), ERROR_UNKNOWN_NAME),
    (pb2.Command(undock_shelf_command=pb2.UndockShelfCommand()), ERROR_NO_FURNITURE),
    (pb2.Command(return_shelf_command=pb2.ReturnShelfCommand()), ERROR_NO_FURNITURE),
    (pb2.Command(return_shelf_command=pb2.ReturnShelfCommand(target_shelf_id='S01')),
     ERROR_UNKNOWN_NAME),
    (pb2.Command(move_shelf_command=pb2.MoveShelfCommand(target_shelf_id='S01')),
     ERROR_UNKNOWN_NAME),
    (pb2.Command(dock_shelf_command=pb2.DockShelfCommand()), ERROR_UNKNOWN_NAME),
    (pb2.Command(move_to_location_command=pb2.MoveToLocationCommand(target_location_id='L01')),
     ERROR_UNKNOWN_NAME),
    (pb2.Command(move_forward_command=pb2.MoveForwardCommand(distance_meter=math.nan)),
     ERROR_NOT_A_VELOCITY),
    (pb2.Command(rotate_in_place_command=pb2.RotateInPlaceCommand(angle_radian=math.inf)),
     ERROR_NOT_A_VELOCITY),
    (pb2.Command(lock_command=pb2.LockCommand(duration_sec=-1.0)), ERROR_OUT_OF_RANGE)])
def test_impossible_commands_are_refused_and_change_nothing(robot, command, code):
    """The running command goes on."""
    running = start(robot, FORWARD).command_id
    answer = start(robot, command, cancel_all=True)
    assert (answer.result.success, answer.result.error_code, answer.command_id) == (
        False, code, '')
    assert robot.get('GetCommandState').command_id == running
