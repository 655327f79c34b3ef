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
Conversions between the simulated robot and its gRPC messages; commands become tasks.

Tested by test/kachaka/simulator/test_grpc_readings.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.files.cdr import Scan
from kachaka_simple_control.files.robot_profile import KACHAKA_LASER_FRAME
from kachaka_simple_control.kachaka.robot_status import (
    ERROR_NO_FURNITURE,
    ERROR_NOT_A_VELOCITY,
    ERROR_OUT_OF_RANGE,
    ERROR_UNKNOWN_NAME,
    SUCCESS,
)
from kachaka_simple_control.kachaka.simulator.drive_model import ODOMETRY_FRAME, ROBOT_FRAME
from kachaka_simple_control.kachaka.simulator.floor_map import floor_map, RESOLUTION
from kachaka_simple_control.kachaka.simulator.grpc_state import SimulatorState
from kachaka_simple_control.kachaka.simulator.tasks import (
    Action,
    drive_straight,
    plan_to_pose,
    StandStill,
    Task,
    TaskResult,
    turn_in_place,
)
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import Pose, Velocity


def result(code: int) -> pb2.Result:
    """Return the gRPC message that says whether a request was successful: code 0."""
    return pb2.Result(success=code == SUCCESS, error_code=code)


def rotation(angle: float) -> pb2.Quaternion:
    """Return the quaternion message of a rotation about the z axis [rad]."""
    return pb2.Quaternion(z=math.sin(angle / 2.0), w=math.cos(angle / 2.0))


def pose(value: Pose) -> pb2.Pose:
    """Return the gRPC message of a pose, with the heading wrapped to [-pi, pi]."""
    return pb2.Pose(x=value.x, y=value.y, theta=math.remainder(value.theta, math.tau))


def odometry(where: Pose, velocity: Velocity, stamp: int) -> pb2.RosOdometry:
    """Return a gRPC odometry message with covariances of 0, and a stamp [ns since 1970]."""
    return pb2.RosOdometry(
        header=pb2.RosHeader(stamp_nsec=stamp, frame_id=ODOMETRY_FRAME),
        child_frame_id=ROBOT_FRAME,
        pose=pb2.Pose3dWithCovariance(
            pose=pb2.Pose3d(
                position=pb2.Vector3(x=where.x, y=where.y),
                orientation=rotation(where.theta)),
            covariance=[0.0] * 36),
        twist=pb2.TwistWithCovariance(
            twist=pb2.Twist(
                linear=pb2.Vector3(x=velocity.linear_x),
                angular=pb2.Vector3(z=velocity.angular_z)),
            covariance=[0.0] * 36))


def transform(where: Pose, frame: str, child: str, stamp: int) -> pb2.RosTransformStamped:
    """Return the gRPC message of the pose of a child frame, with a stamp [ns since 1970]."""
    return pb2.RosTransformStamped(
        header=pb2.RosHeader(stamp_nsec=stamp, frame_id=frame), child_frame_id=child,
        translation=pb2.Vector3(x=where.x, y=where.y), rotation=rotation(where.theta))


#: The frame of the IMU, from kachaka_description; and standard gravity [m/s^2].
IMU_FRAME = 'imu_link'
GRAVITY = 9.80665


def imu(heading: float, velocity: Velocity, acceleration: float, stamp: int) -> pb2.RosImu:
    """
    Return the gRPC message of an inertial measurement unit without errors, on a level floor.

    :param acceleration: forwards [m/s^2]
    """
    return pb2.RosImu(
        header=pb2.RosHeader(stamp_nsec=stamp, frame_id=IMU_FRAME),
        orientation=rotation(heading), orientation_covariance=[0.0] * 9,
        angular_velocity=pb2.Vector3(z=velocity.angular_z),
        angular_velocity_covariance=[0.0] * 9,
        linear_acceleration=pb2.Vector3(
            x=acceleration, y=velocity.linear_x * velocity.angular_z, z=GRAVITY),
        linear_acceleration_covariance=[0.0] * 9)


def laser_scan(scan: Scan, period: float, stamp: int) -> pb2.RosLaserScan:
    """Return the gRPC message of a scan; the angles are those of linspace(min, max)."""
    return pb2.RosLaserScan(
        header=pb2.RosHeader(stamp_nsec=stamp, frame_id=KACHAKA_LASER_FRAME),
        angle_min=scan.angle, angle_max=scan.angle + scan.increment * (len(scan.ranges) - 1),
        angle_increment=scan.increment, scan_time=period, range_min=scan.nearest,
        range_max=scan.farthest, ranges=scan.ranges)


def map_of(floor: Floor) -> pb2.Map:
    """Return the gRPC message of the map of a floor; its origin is the lower left corner."""
    picture = floor_map(floor)
    return pb2.Map(
        data=picture.png, name=MAP_NAME, resolution=RESOLUTION, width=picture.width,
        height=picture.height, origin=pb2.Pose(x=picture.corner[0], y=picture.corner[1]))


#: The name of the map.
MAP_NAME = 'simulated'
#: The duration of a speak command with any text [s].  The duration is assumed, not documented by
#: the manufacturer.  The command makes no sound.
SPEAK_DURATION = 1.0
#: The name of the location of the dock, which every Kachaka has.  The manufacturer's examples use
#: the same name.
HOME = 'home'
#: A chosen serial number that no real robot has.
SERIAL_NUMBER = 'SIMULATED'
#: The release of the robot's software that belongs to the version of the SDK implemented here.
VERSION = '3.17.5'


@dataclass(frozen=True)
class ReceivedCommand:
    """A command that the robot has received from a gRPC client, with its time [s since 1970]."""

    command: pb2.Command
    time: int


def task_from_request(
        request: pb2.StartCommandRequest, state: SimulatorState, identity: str) -> Task | int:
    """Convert a client's request to a task, or return an error code if the robot refuses it."""
    name = request.command.WhichOneof('command')
    if name not in ACTIONS:
        return ERROR_UNKNOWN_NAME
    command = getattr(request.command, name)
    if not all(math.isfinite(value) for _, value in command.ListFields()
               if isinstance(value, float)):
        return ERROR_NOT_A_VELOCITY
    actions = ACTIONS[name](command, state)
    if isinstance(actions, int):
        return actions
    if request.HasField('lock_on_end'):
        locked = _lock(request.lock_on_end, state)
        if isinstance(locked, int):
            return locked
        actions = (*actions, *locked)
    return Task(
        identity, actions,
        ends_docked=name in {'return_home_command', 'move_to_location_command'},
        note=ReceivedCommand(request.command, state.clock.stamp() // 10**9))


def _return_home(command: Any, state: SimulatorState) -> tuple[Action, ...]:
    return state.robot.actions_to_dock(state.now())


def _move_to_location(command: Any, state: SimulatorState) -> tuple[Action, ...] | int:
    if command.target_location_id != HOME:
        return ERROR_UNKNOWN_NAME
    return _return_home(command, state)


def _move_to_pose(command: Any, state: SimulatorState) -> tuple[Action, ...]:
    goal = Pose(command.x, command.y, command.yaw)
    return plan_to_pose(state.map_to_odom.to_odometry(goal))


def _lock(command: Any, state: SimulatorState) -> tuple[Action, ...] | int:
    if not 0.0 <= command.duration_sec < math.inf:
        return ERROR_OUT_OF_RANGE
    return (StandStill(command.duration_sec, can_be_ended=True),)


def _move_by_velocity(command: Any, state: SimulatorState) -> tuple[Action, ...]:
    velocity = command.signed_velocity
    return (drive_straight(velocity * command.move_duration_sec, abs(velocity)),)


def _return_shelf(command: Any, state: SimulatorState) -> int:
    return ERROR_UNKNOWN_NAME if command.target_shelf_id else ERROR_NO_FURNITURE


#: For each command, a function that returns its actions, or an error code if the robot refuses it.
ACTIONS: dict[str, Callable[[Any, SimulatorState], tuple[Action, ...] | int]] = {
    'move_forward_command': lambda command, state: (
        drive_straight(command.distance_meter, command.speed),),
    'rotate_in_place_command': lambda command, state: (turn_in_place(command.angle_radian),),
    'move_to_pose_command': _move_to_pose,
    'move_to_location_command': _move_to_location,
    'return_home_command': _return_home,
    'lock_command': _lock,
    'speak_command': lambda command, state: (StandStill(SPEAK_DURATION),),
    'localize_command': lambda command, state: (turn_in_place(math.tau),),
    'move_by_velocity_with_muted_sensors_command': _move_by_velocity,
    'undock_shelf_command': lambda command, state: ERROR_NO_FURNITURE,
    'return_shelf_command': _return_shelf,
}


def command_of(task: Task | None) -> pb2.Command | None:
    """Return the gRPC command from which a task was made; None if there is none."""
    return task.note.command if task and isinstance(task.note, ReceivedCommand) else None


def _history(result: TaskResult) -> pb2.History:
    note = result.task.note
    return pb2.History(
        id=result.task.identity, command=command_of(result.task), success=result.is_success,
        error_code=result.code,
        command_executed_time=note.time if isinstance(note, ReceivedCommand) else 0)


Fields = dict[str, Any]


def _battery(is_docked: bool) -> Fields:
    """Return charge and charging status: always full; it charges while the robot is docked."""
    status = (pb2.POWER_SUPPLY_STATUS_CHARGING if is_docked
              else pb2.POWER_SUPPLY_STATUS_DISCHARGING)
    return {'remaining_percentage': 100.0, 'power_supply_status': status}


def _command_state(task: Task | None) -> Fields:
    """Return the fields about the command that the robot executes now, None for none."""
    state = pb2.COMMAND_STATE_RUNNING if task else pb2.COMMAND_STATE_PENDING
    return {
        'state': state, 'command': command_of(task), 'command_id': task.identity if task else ''}


def _last_result(results: Sequence[TaskResult]) -> Fields:
    """Return the fields about the command that has ended last: itself, its id and its result."""
    if not results:
        return {}
    last = results[-1]
    return {'result': result(last.code), 'command': command_of(last.task),
            'command_id': last.task.identity}


def _locations(dock: pb2.Pose) -> Fields:
    """Return the fields about the places that the robot knows: its dock."""
    return {'default_location_id': HOME, 'locations': [
        pb2.Location(id=HOME, name=HOME, pose=dock, type=pb2.LOCATION_TYPE_CHARGER)]}


#: The gRPC calls that read a value.  Each call waits until the value is newer than the client's
#: value.  For each call: the name of the value, and a function that returns the message fields of
#: the response for a value.  There are no shelves, and no maps but one.
READINGS: dict[str, tuple[str, Callable[[Any], Fields]]] = {
    'GetAutoHomingEnabled': ('auto_homing', lambda enabled: {'enabled': enabled}),
    'GetBatteryInfo': ('docked', _battery),
    'GetCommandState': ('task', _command_state),
    'GetCurrentMapId': ('constant', lambda _: {}),
    'GetError': ('errors', lambda codes: {'error_codes': codes}),
    # The last 100 commands, newest last; this order is an assumption.
    'GetHistoryList': ('results', lambda results: {'histories': [*map(_history, results)]}),
    'GetLastCommandResult': ('results', _last_result),
    'GetLocations': ('dock', _locations),
    'GetLocationsDigest': ('constant', lambda _: {'locations': [
        pb2.LocationDigest(id=HOME, name=HOME, type=pb2.LOCATION_TYPE_CHARGER)]}),
    'GetManualControlEnabled': ('manual_control', lambda enabled: {'enabled': enabled}),
    'GetMapList': ('constant', lambda _: {}),
    'GetPngMap': ('map', lambda floor: {'map': map_of(floor)}),
    'GetMovingShelfId': ('constant', lambda _: {}),
    # The estimated pose on the map.
    'GetRobotPose': ('pose', lambda pose: {'pose': pose}),
    'GetRobotSerialNumber': ('constant', lambda _: {'serial_number': SERIAL_NUMBER}),
    'GetRobotVersion': ('constant', lambda _: {'version': VERSION}),
    'GetRosImu': ('imu', lambda imu: {'imu': imu}),
    'GetRosLaserScan': ('scan', lambda scan: {'scan': scan}),
    'GetRosOdometry': ('odometry', lambda odometry: {'odometry': odometry}),
    # The same values as for GetRosOdometry; this is an assumption.
    'GetRosWheelOdometry': ('odometry', lambda odometry: {'odometry': odometry}),
    'GetShelves': ('constant', lambda _: {}),
    'GetShelvesDigest': ('constant', lambda _: {}),
    'GetShortcuts': ('constant', lambda _: {}),
    'GetSpeakerVolume': ('volume', lambda volume: {'volume': volume}),
}
