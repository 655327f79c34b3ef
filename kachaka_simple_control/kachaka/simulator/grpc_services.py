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
The gRPC calls that the simulated robot offers to clients.

Tested by test/kachaka/simulator/test_grpc_sdk.py.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
import functools
import json
import math
from typing import Any

import grpc
from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_api.generated.kachaka_api_pb2_grpc import KachakaApiServicer
from kachaka_simple_control.files.robot_profile import KACHAKA_LASER, KACHAKA_LASER_FRAME
from kachaka_simple_control.kachaka.robot_status import (
    ERROR_NOT_A_VELOCITY,
    ERROR_NOTHING_TO_DO,
    ERROR_OUT_OF_RANGE,
    ERROR_UNKNOWN_NAME,
    SUCCESS,
    TEXTS,
)
from kachaka_simple_control.kachaka.simulator import grpc_messages
from kachaka_simple_control.kachaka.simulator.drive_model import (
    ODOMETRY_FRAME,
    ODOMETRY_PERIOD,
    ROBOT_FRAME,
)
from kachaka_simple_control.kachaka.simulator.grpc_state import LongPollValue, SimulatorState
from kachaka_simple_control.motion.floor import Floor
from kachaka_simple_control.motion.geometry import ORIGIN, Pose

MAP_FRAME = 'map'
BODY_FRAME = 'base_link'
#: The height of the laser [m], from kachaka_description in pf-robotics/kachaka-api.
LASER_HEIGHT = 0.1049
EMPTY = Floor()
#: The list of errors in the JSON format of the robot.  The format has texts in two languages; here
#: both texts are English.
ERRORS = json.dumps([
    {'code': code, 'error_type': kind, 'title': text, 'description': '',
     'title_en': text, 'description_en': '', 'ref_url': ''}
    for code, kind, text in TEXTS])
#: The largest allowed values, from protos/kachaka-api.proto; the smallest are 0.
MAX_VOLUME = 10
MAX_INTENSITY = 255


def _with_result(execute: Callable[[Any, Any], int]) -> Callable[..., Awaitable[Any]]:
    """Turn a method that returns a code into a gRPC handler, which also wakes waiting calls."""
    @functools.wraps(execute)
    async def call(self: SimulatedKachakaServicer, request: Any, _context: Any) -> Any:
        code = execute(self, request)
        self.state.notify()
        return getattr(pb2, f'{execute.__name__}Response')(result=grpc_messages.result(code))
    return call


class SimulatedKachakaServicer(KachakaApiServicer):  # type: ignore[misc]
    """
    The gRPC service of a simulated Kachaka robot; each gRPC call is a method.

    Those that read a value are added from ``grpc_messages.READINGS``.  Calls of the real robot
    that are not implemented fail with UNIMPLEMENTED.
    """

    def __init__(self, state: SimulatorState) -> None:
        self.state = state
        self._volume = MAX_VOLUME // 2
        self._auto_homing = False
        self._scan = pb2.RosLaserScan()
        #: the last time and velocity that the IMU has seen
        self._last_motion = state.now(), 0.0
        robot = state.robot
        #: the values that clients read, by name
        self.values: dict[str, LongPollValue[Any]] = {
            'auto_homing': LongPollValue(state, lambda _: self._auto_homing),
            # Values that never change need only a cursor.
            'constant': LongPollValue(state, lambda _: None),
            'dock': LongPollValue(state, lambda _: grpc_messages.pose(robot.dock)),
            'docked': LongPollValue(state, robot.is_docked),
            'errors': LongPollValue(state, robot.errors),
            # Updated every 20 ms; that of the real robot is not published.
            'imu': LongPollValue(state, self._read_imu, ODOMETRY_PERIOD),
            'manual_control': LongPollValue(state, robot.manual_control),
            'map': LongPollValue(state, lambda _: robot.floor or EMPTY),
            # Updated every 20 ms like the official bridge.
            'odometry': LongPollValue(state, self._read_odometry, ODOMETRY_PERIOD),
            'pose': LongPollValue(state, self._read_pose, ODOMETRY_PERIOD),
            'results': LongPollValue(state, robot.task_results),
            'scan': LongPollValue(state, self._read_scan, robot.laser.period, may_pause=True),
            'task': LongPollValue(state, robot.task),
            'transforms': LongPollValue(state, self._read_transforms, ODOMETRY_PERIOD),
            'volume': LongPollValue(state, lambda _: self._volume)}

    async def SetRobotVelocity(
            self, request: pb2.SetRobotVelocityRequest, context: Any
            ) -> pb2.SetRobotVelocityResponse:
        """Let the robot drive within its limits for its command timeout."""
        code = self.state.robot.set_robot_velocity(
            request.linear, request.angular, self.state.now())
        # No notify(): no long poll depends on the velocity, and this call must be fast.
        return pb2.SetRobotVelocityResponse(result=grpc_messages.result(code))

    @_with_result
    def SetManualControlEnabled(self, request: pb2.SetManualControlEnabledRequest) -> int:
        """Switch manual control on for 60 s, or switch it off."""
        return self.state.robot.set_manual_control(request.enable, self.state.now())

    @_with_result
    def SetEmergencyStop(self, request: pb2.EmptyRequest) -> int:
        """Stop the robot, which then refuses to move until its power button is pressed."""
        return self.state.robot.set_emergency_stop(self.state.now())

    @_with_result
    def SetRobotPose(self, request: pb2.SetRobotPoseRequest) -> int:
        """Set the robot's estimate of its pose on the map; it must be finite."""
        state, pose = self.state, request.pose
        if not all(map(math.isfinite, (pose.x, pose.y, pose.theta))):
            return ERROR_NOT_A_VELOCITY
        state.map_to_odom.correct(
            Pose(pose.x, pose.y, pose.theta), state.robot.odometry(state.now())[0])
        return SUCCESS

    @_with_result
    def SetSpeakerVolume(self, request: pb2.SetSpeakerVolumeRequest) -> int:
        """Store the speaker volume, from 0 to 10; no other effect."""
        code = _check(request.volume, MAX_VOLUME)
        if code == SUCCESS:
            self._volume = request.volume
        return code

    @_with_result
    def SetFrontTorchIntensity(self, request: pb2.SetFrontTorchIntensityRequest) -> int:
        """Refuse a torch intensity that is not from 0 to 255, and do nothing else."""
        return _check(request.intensity, MAX_INTENSITY)

    @_with_result
    def SetBackTorchIntensity(self, request: pb2.SetBackTorchIntensityRequest) -> int:
        """Refuse a torch intensity that is not from 0 to 255, and do nothing else."""
        return _check(request.intensity, MAX_INTENSITY)

    @_with_result
    def ActivateLaserScan(self, request: pb2.ActivateLaserScanRequest) -> int:
        """Let the laser turn for a time, also while the robot stands still."""
        return self.state.robot.activate_laser(request.duration_sec, self.state.now())

    @_with_result
    def SetAutoHomingEnabled(self, request: pb2.SetAutoHomingEnabledRequest) -> int:
        """Store whether auto homing is enabled; no other effect."""
        self._auto_homing = request.enable
        return SUCCESS

    @_with_result
    def ResetShelfPose(self, request: pb2.ResetShelfPoseRequest) -> int:
        """Refuse a shelf id, because there are no shelves; without one, do nothing."""
        return ERROR_UNKNOWN_NAME if request.shelf_id else SUCCESS

    @_with_result
    def StartShortcutCommand(self, request: pb2.StartShortcutCommandRequest) -> int:
        """Refuse the request, because no shortcuts are stored in the simulated robot."""
        return ERROR_UNKNOWN_NAME

    @_with_result
    def Proceed(self, request: pb2.EmptyRequest) -> int:
        """End the current lock command, a standstill for a time, early."""
        return self.state.robot.end_standstill(self.state.now())

    async def StartCommand(
            self, request: pb2.StartCommandRequest, context: Any) -> pb2.StartCommandResponse:
        """Start a command, after all others or, with ``cancel_all``, instead of them."""
        state = self.state
        identity = f'{state.new_cursor():016x}'
        task = grpc_messages.task_from_request(request, state, identity)
        if isinstance(task, int):
            return pb2.StartCommandResponse(result=grpc_messages.result(task))
        code = state.robot.start_task(task, state.now(), request.cancel_all)
        state.notify()
        return pb2.StartCommandResponse(
            result=grpc_messages.result(code), command_id=identity if code == SUCCESS else '')

    async def CancelCommand(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.CancelCommandResponse:
        """Cancel all commands; return the running one, or an error code if there is none."""
        task = self.state.robot.cancel_tasks(self.state.now())
        self.state.notify()
        code = ERROR_NOTHING_TO_DO if task is None else SUCCESS
        return pb2.CancelCommandResponse(
            result=grpc_messages.result(code), command=grpc_messages.command_of(task))

    async def IsReady(self, request: pb2.EmptyRequest, context: Any) -> pb2.IsReadyResponse:
        """Respond that the robot is ready; the simulated robot is always ready."""
        return pb2.IsReadyResponse(ready=True)

    async def GetRobotErrorCodeJson(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.GetRobotErrorCodeJsonResponse:
        """Return a JSON list of the robot's error codes and their texts."""
        return pb2.GetRobotErrorCodeJsonResponse(
            json=ERRORS, result=grpc_messages.result(SUCCESS))

    async def GetStaticTransform(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetStaticTransformResponse:
        """Return the fixed transforms base_footprint to base_link to laser_frame."""
        cursor, _ = await self.values['constant'].get(request.metadata.cursor)
        stamp = self.state.clock.stamp()
        laser = grpc_messages.transform(
            KACHAKA_LASER.pose, BODY_FRAME, KACHAKA_LASER_FRAME, stamp)
        laser.translation.z = LASER_HEIGHT
        body = grpc_messages.transform(ORIGIN, ROBOT_FRAME, BODY_FRAME, stamp)
        return pb2.GetStaticTransformResponse(
            metadata=pb2.Metadata(cursor=cursor), transforms=[body, laser])

    async def GetDynamicTransform(
            self, request: pb2.EmptyRequest, context: Any
            ) -> AsyncIterator[pb2.GetDynamicTransformResponse]:
        """Send map to odom to base_footprint every 20 ms until the client disconnects."""
        cursor = 0
        while True:
            cursor, transforms = await self.values['transforms'].get(cursor)
            yield pb2.GetDynamicTransformResponse(transforms=transforms)

    def _read_pose(self, now: float) -> pb2.Pose:
        pose, _ = self.state.robot.odometry(now)
        return grpc_messages.pose(self.state.map_to_odom.to_map(pose))

    def _read_scan(self, now: float) -> pb2.RosLaserScan:
        """Return the newest scan: the same as before while the laser is off, at first an empty."""
        scan = self.state.robot.take_scan(now)
        if scan is not None:
            self._scan = grpc_messages.laser_scan(
                scan, self.state.robot.laser.period, self.state.clock.stamp())
        return self._scan

    def _read_imu(self, now: float) -> pb2.RosImu:
        """Return what an IMU measures; its acceleration is the mean since the last reading."""
        pose, velocity = self.state.robot.state(now)
        (last, speed), self._last_motion = self._last_motion, (now, velocity.linear_x)
        acceleration = (velocity.linear_x - speed) / (now - last) if now > last else 0.0
        return grpc_messages.imu(pose.theta, velocity, acceleration, self.state.clock.stamp())

    def _read_odometry(self, now: float) -> pb2.RosOdometry:
        pose, velocity = self.state.robot.odometry(now)
        return grpc_messages.odometry(pose, velocity, self.state.clock.stamp())

    def _read_transforms(self, now: float) -> list[pb2.RosTransformStamped]:
        pose, _ = self.state.robot.odometry(now)
        stamp, offset = self.state.clock.stamp(), self.state.map_to_odom.offset
        return [
            grpc_messages.transform(offset, MAP_FRAME, ODOMETRY_FRAME, stamp),
            grpc_messages.transform(pose, ODOMETRY_FRAME, ROBOT_FRAME, stamp)]


def _check(value: int, highest: int) -> int:
    return SUCCESS if 0 <= value <= highest else ERROR_OUT_OF_RANGE


def _reading(name: str, value: str, fields: Callable[[Any], dict[str, Any]]) -> Callable[..., Any]:
    """Return the gRPC handler of a call that reads one value: a long poll."""
    async def call(self: SimulatedKachakaServicer, request: pb2.GetRequest, _: Any) -> Any:
        cursor, newest = await self.values[value].get(request.metadata.cursor)
        return getattr(pb2, f'{name}Response')(
            metadata=pb2.Metadata(cursor=cursor), **fields(newest))
    return call


def _refusal(name: str) -> Callable[..., Any]:
    async def call(_self: SimulatedKachakaServicer, _request: Any, context: Any) -> None:
        await context.abort(
            grpc.StatusCode.UNIMPLEMENTED, f'the simulated Kachaka has no {name}')
    return call


for _name, _value_and_fields in grpc_messages.READINGS.items():
    setattr(SimulatedKachakaServicer, _name, _reading(_name, *_value_and_fields))
#: The names of all calls of the robot's service, and of those that are not implemented here.
CALLS = tuple(name for name in vars(KachakaApiServicer) if name[0].isupper())
UNIMPLEMENTED = tuple(
    name for name in CALLS
    if getattr(SimulatedKachakaServicer, name) is getattr(KachakaApiServicer, name))
for _name in UNIMPLEMENTED:
    setattr(SimulatedKachakaServicer, _name, _refusal(_name))
