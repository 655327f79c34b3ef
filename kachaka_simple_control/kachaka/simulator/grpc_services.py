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
"""The parts of the simulated robot's gRPC service, except commands."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
import json
import math
from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.kachaka.error_codes import (
    ERROR_NOT_A_VELOCITY,
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
from kachaka_simple_control.kachaka.simulator.grpc_state import (
    LongPollValue,
    Service,
    SimulatorState,
)
from kachaka_simple_control.kachaka.simulator.grpc_tasks import HOME
from kachaka_simple_control.motion.geometry import ORIGIN, Pose


def _constant(response: Callable[..., Any], **fields: Any) -> Callable[..., Awaitable[Any]]:
    """Return a gRPC call with a constant answer: the fields, and the metadata of a long poll."""
    async def call(self: Service, request: pb2.GetRequest, _context: Any) -> Any:
        return response(metadata=await self.constant_metadata(request), **fields)
    return call


class DrivingService(Service):
    """The gRPC calls for manual control, velocities and the emergency stop."""

    def __init__(self, state: SimulatorState) -> None:
        super().__init__(state)
        self._manual_control = LongPollValue(state, state.robot.manual_control)

    async def SetRobotVelocity(
            self, request: pb2.SetRobotVelocityRequest, context: Any
            ) -> pb2.SetRobotVelocityResponse:
        """Drive with a velocity, clipped to the limits, until the command timeout."""
        code = self._state.robot.set_robot_velocity(
            request.linear, request.angular, self._state.now())
        # No notify(): no long poll depends on the velocity, and this call must be fast.
        return pb2.SetRobotVelocityResponse(result=grpc_messages.result(code))

    async def SetManualControlEnabled(
            self, request: pb2.SetManualControlEnabledRequest, context: Any
            ) -> pb2.SetManualControlEnabledResponse:
        """Switch manual control on for 60 s, or off."""
        code = self._state.robot.set_manual_control(request.enable, self._state.now())
        self._state.notify()
        return pb2.SetManualControlEnabledResponse(result=grpc_messages.result(code))

    async def SetEmergencyStop(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.SetEmergencyStopResponse:
        """Stop the robot, and refuse to move until the power button is pressed."""
        code = self._state.robot.set_emergency_stop(self._state.now())
        self._state.notify()
        return pb2.SetEmergencyStopResponse(result=grpc_messages.result(code))

    async def GetManualControlEnabled(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetManualControlEnabledResponse:
        """Return whether manual control is on."""
        cursor, enabled = await self._manual_control.get(request.metadata.cursor)
        return pb2.GetManualControlEnabledResponse(
            metadata=pb2.Metadata(cursor=cursor), enabled=enabled)


class SensingService(Service):
    """The gRPC calls for odometry and poses, updated every 20 ms like the official bridge."""

    def __init__(self, state: SimulatorState) -> None:
        super().__init__(state)
        self._odometry = LongPollValue(state, self._read_odometry, ODOMETRY_PERIOD)
        self._pose = LongPollValue(state, self._read_pose, ODOMETRY_PERIOD)

    async def GetRosOdometry(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRosOdometryResponse:
        """Return the odometry pose and the velocity."""
        cursor, odometry = await self._odometry.get(request.metadata.cursor)
        return pb2.GetRosOdometryResponse(
            metadata=pb2.Metadata(cursor=cursor), odometry=odometry)

    async def GetRosWheelOdometry(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRosWheelOdometryResponse:
        """Return the same odometry as ``GetRosOdometry()``; this is an assumption."""
        cursor, odometry = await self._odometry.get(request.metadata.cursor)
        return pb2.GetRosWheelOdometryResponse(
            metadata=pb2.Metadata(cursor=cursor), odometry=odometry)

    async def GetRobotPose(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRobotPoseResponse:
        """Return the estimated pose on the map."""
        cursor, pose = await self._pose.get(request.metadata.cursor)
        return pb2.GetRobotPoseResponse(metadata=pb2.Metadata(cursor=cursor), pose=pose)

    async def SetRobotPose(
            self, request: pb2.SetRobotPoseRequest, context: Any) -> pb2.SetRobotPoseResponse:
        """Set the estimated pose on the map; the robot does not move."""
        state, pose = self._state, request.pose
        map_pose = Pose(pose.x, pose.y, pose.theta)
        if not all(map(math.isfinite, (pose.x, pose.y, pose.theta))):
            return pb2.SetRobotPoseResponse(result=grpc_messages.result(ERROR_NOT_A_VELOCITY))
        state.map_to_odom.correct(map_pose, state.robot.odometry(state.now())[0])
        state.notify()
        return pb2.SetRobotPoseResponse(result=grpc_messages.result(SUCCESS))

    def _read_pose(self, now: float) -> pb2.Pose:
        pose, _ = self._state.robot.odometry(now)
        return grpc_messages.pose(self._state.map_to_odom.to_map(pose))

    def _read_odometry(self, now: float) -> pb2.RosOdometry:
        pose, velocity = self._state.robot.odometry(now)
        return grpc_messages.odometry(pose, velocity, self._state.clock.stamp())


MAP_FRAME = 'map'
BODY_FRAME = 'base_link'
LASER_FRAME = 'laser_frame'
#: The pose of the laser in the body frame and its height [m], from kachaka_description in
#: pf-robotics/kachaka-api.
LASER, LASER_HEIGHT = Pose(0.156, 0.0, math.pi / 2.0), 0.1049


class TransformService(Service):
    """The gRPC calls for transforms from the map to the robot, and from the robot to its parts."""

    def __init__(self, state: SimulatorState) -> None:
        super().__init__(state)
        self._transforms = LongPollValue(state, self._read_transforms, ODOMETRY_PERIOD)

    async def GetStaticTransform(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetStaticTransformResponse:
        """Return the transforms to the body and to the laser."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        stamp = self._state.clock.stamp()
        laser = grpc_messages.transform(LASER, BODY_FRAME, LASER_FRAME, stamp)
        laser.translation.z = LASER_HEIGHT
        body = grpc_messages.transform(ORIGIN, ROBOT_FRAME, BODY_FRAME, stamp)
        return pb2.GetStaticTransformResponse(
            metadata=pb2.Metadata(cursor=cursor), transforms=[body, laser])

    async def GetDynamicTransform(
            self, request: pb2.EmptyRequest, context: Any
            ) -> AsyncIterator[pb2.GetDynamicTransformResponse]:
        """Stream the transforms from the map to the robot until the client disconnects."""
        cursor = 0
        while True:
            cursor, transforms = await self._transforms.get(cursor)
            yield pb2.GetDynamicTransformResponse(transforms=transforms)

    def _read_transforms(self, now: float) -> list[pb2.RosTransformStamped]:
        state = self._state
        pose, _ = state.robot.odometry(now)
        stamp, offset = state.clock.stamp(), state.map_to_odom.offset
        return [
            grpc_messages.transform(offset, MAP_FRAME, ODOMETRY_FRAME, stamp),
            grpc_messages.transform(pose, ODOMETRY_FRAME, ROBOT_FRAME, stamp)]


#: A chosen serial number that no real robot has.
SERIAL_NUMBER = 'SIMULATED'
#: The release of the robot's software for the implemented version of the SDK.
VERSION = '3.17.5'
#: The list of errors in the robot's format; the texts of both languages are English.
ERRORS = json.dumps([
    {'code': code, 'error_type': kind, 'title': text, 'description': '',
     'title_en': text, 'description_en': '', 'ref_url': ''}
    for code, kind, text in TEXTS])


class StateService(Service):
    """The gRPC calls for serial number, version, readiness and errors."""

    def __init__(self, state: SimulatorState) -> None:
        super().__init__(state)
        self._errors = LongPollValue(state, state.robot.errors)

    #: No real robot has this serial number.
    GetRobotSerialNumber = _constant(
        pb2.GetRobotSerialNumberResponse, serial_number=SERIAL_NUMBER)
    GetRobotVersion = _constant(pb2.GetRobotVersionResponse, version=VERSION)

    async def IsReady(self, request: pb2.EmptyRequest, context: Any) -> pb2.IsReadyResponse:
        """Return that the robot is ready, always."""
        return pb2.IsReadyResponse(ready=True)

    async def GetError(self, request: pb2.GetRequest, context: Any) -> pb2.GetErrorResponse:
        """Return the codes of the current errors."""
        cursor, codes = await self._errors.get(request.metadata.cursor)
        return pb2.GetErrorResponse(metadata=pb2.Metadata(cursor=cursor), error_codes=codes)

    async def GetRobotErrorCodeJson(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.GetRobotErrorCodeJsonResponse:
        """Return the list of error codes and their texts."""
        return pb2.GetRobotErrorCodeJsonResponse(
            json=ERRORS, result=grpc_messages.result(SUCCESS))


#: The upper ends of the ranges in protos/kachaka-api.proto; the lower ends are 0.
MAX_VOLUME = 10
MAX_INTENSITY = 255


class EquipmentService(Service):
    """The gRPC calls for speaker, torches, battery and auto homing, simulated without effect."""

    def __init__(self, state: SimulatorState) -> None:
        super().__init__(state)
        self._volume = MAX_VOLUME // 2
        self._auto_homing = False
        self._volume_value = LongPollValue(state, lambda _: self._volume)
        self._auto_homing_value = LongPollValue(state, lambda _: self._auto_homing)
        self._docked = LongPollValue(state, state.robot.is_docked)

    async def GetBatteryInfo(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetBatteryInfoResponse:
        """Return a full battery; it is charging if the robot is on the dock."""
        cursor, is_docked = await self._docked.get(request.metadata.cursor)
        return pb2.GetBatteryInfoResponse(
            metadata=pb2.Metadata(cursor=cursor), remaining_percentage=100.0,
            power_supply_status=(
                pb2.POWER_SUPPLY_STATUS_CHARGING if is_docked
                else pb2.POWER_SUPPLY_STATUS_DISCHARGING))

    async def GetSpeakerVolume(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetSpeakerVolumeResponse:
        """Return the speaker volume."""
        cursor, volume = await self._volume_value.get(request.metadata.cursor)
        return pb2.GetSpeakerVolumeResponse(metadata=pb2.Metadata(cursor=cursor), volume=volume)

    async def SetSpeakerVolume(
            self, request: pb2.SetSpeakerVolumeRequest, context: Any
            ) -> pb2.SetSpeakerVolumeResponse:
        """Set the volume, 0 to 10; the only effect is on ``GetSpeakerVolume()``."""
        code = _check(request.volume, MAX_VOLUME)
        if code == SUCCESS:
            self._volume = request.volume
            self._state.notify()
        return pb2.SetSpeakerVolumeResponse(result=grpc_messages.result(code))

    async def SetFrontTorchIntensity(
            self, request: pb2.SetFrontTorchIntensityRequest, context: Any
            ) -> pb2.SetFrontTorchIntensityResponse:
        """Check a torch intensity, 0 to 255; there is no other effect."""
        return pb2.SetFrontTorchIntensityResponse(
            result=grpc_messages.result(_check(request.intensity, MAX_INTENSITY)))

    async def SetBackTorchIntensity(
            self, request: pb2.SetBackTorchIntensityRequest, context: Any
            ) -> pb2.SetBackTorchIntensityResponse:
        """Check a torch intensity, 0 to 255; there is no other effect."""
        return pb2.SetBackTorchIntensityResponse(
            result=grpc_messages.result(_check(request.intensity, MAX_INTENSITY)))

    async def GetAutoHomingEnabled(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetAutoHomingEnabledResponse:
        """Return the value set by ``SetAutoHomingEnabled()``."""
        cursor, enabled = await self._auto_homing_value.get(request.metadata.cursor)
        return pb2.GetAutoHomingEnabledResponse(
            metadata=pb2.Metadata(cursor=cursor), enabled=enabled)

    async def SetAutoHomingEnabled(
            self, request: pb2.SetAutoHomingEnabledRequest, context: Any
            ) -> pb2.SetAutoHomingEnabledResponse:
        """Store the setting; the only effect is on ``GetAutoHomingEnabled()``."""
        self._auto_homing = request.enable
        self._state.notify()
        return pb2.SetAutoHomingEnabledResponse(result=grpc_messages.result(SUCCESS))


def _check(value: int, highest: int) -> int:
    return SUCCESS if 0 <= value <= highest else ERROR_OUT_OF_RANGE


class MapService(Service):
    """The gRPC calls for locations, furniture and maps; only the location of the dock exists."""

    def __init__(self, state: SimulatorState) -> None:
        super().__init__(state)
        self._dock = grpc_messages.pose(state.robot.dock)

    async def GetLocations(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLocationsResponse:
        """Return the location of the dock."""
        return pb2.GetLocationsResponse(
            metadata=await self.constant_metadata(request), default_location_id=HOME,
            locations=[pb2.Location(
                id=HOME, name=HOME, pose=self._dock, type=pb2.LOCATION_TYPE_CHARGER)])

    async def GetLocationsDigest(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLocationsDigestResponse:
        """Return the digest of the locations: the dock."""
        return pb2.GetLocationsDigestResponse(
            metadata=await self.constant_metadata(request),
            locations=[pb2.LocationDigest(id=HOME, name=HOME, type=pb2.LOCATION_TYPE_CHARGER)])

    #: There are no shelves and no maps.
    GetShelves = _constant(pb2.GetShelvesResponse)
    GetShelvesDigest = _constant(pb2.GetShelvesDigestResponse)
    GetMovingShelfId = _constant(pb2.GetMovingShelfIdResponse)

    async def ResetShelfPose(
            self, request: pb2.ResetShelfPoseRequest, context: Any) -> pb2.ResetShelfPoseResponse:
        """Do nothing, because there are no shelves; refuse a request with a shelf id."""
        code = ERROR_UNKNOWN_NAME if request.shelf_id else SUCCESS
        return pb2.ResetShelfPoseResponse(result=grpc_messages.result(code))

    GetMapList = _constant(pb2.GetMapListResponse)
    GetCurrentMapId = _constant(pb2.GetCurrentMapIdResponse)
