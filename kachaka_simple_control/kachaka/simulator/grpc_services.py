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
"""The gRPC services of the simulated robot, but for commands."""

from __future__ import annotations

from collections.abc import AsyncIterator
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
from kachaka_simple_control.kachaka.simulator.drive_model import ODOMETRY_PERIOD
from kachaka_simple_control.kachaka.simulator.grpc_messages import (
    MAP_FRAME,
    ODOMETRY_FRAME,
    ROBOT_FRAME,
)
from kachaka_simple_control.kachaka.simulator.grpc_state import (
    constant,
    LongPollValue,
    SimulatorState,
)
from kachaka_simple_control.kachaka.simulator.grpc_tasks import HOME
from kachaka_simple_control.motion.geometry import ORIGIN, Pose


class DrivingService:
    """Manual control, velocities, and the emergency stop."""

    def __init__(self, station: SimulatorState) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._manual_control = LongPollValue(station, station.robot.manual_control)

    async def SetRobotVelocity(
            self, request: pb2.SetRobotVelocityRequest, context: Any
            ) -> pb2.SetRobotVelocityResponse:
        """Drive with a velocity, for the hold; more than the largest is the largest."""
        code = self._station.robot.set_robot_velocity(
            request.linear, request.angular, self._station.now())
        # Not announced: nobody waits for it, and it has to be quick.
        return pb2.SetRobotVelocityResponse(result=grpc_messages.result(code))

    async def SetManualControlEnabled(
            self, request: pb2.SetManualControlEnabledRequest, context: Any
            ) -> pb2.SetManualControlEnabledResponse:
        """Take velocities for 60 s, or none."""
        code = self._station.robot.set_manual_control(request.enable, self._station.now())
        self._station.notify()
        return pb2.SetManualControlEnabledResponse(result=grpc_messages.result(code))

    async def SetEmergencyStop(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.SetEmergencyStopResponse:
        """Stop, and stay until the power button is pressed."""
        code = self._station.robot.set_emergency_stop(self._station.now())
        self._station.notify()
        return pb2.SetEmergencyStopResponse(result=grpc_messages.result(code))

    async def GetManualControlEnabled(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetManualControlEnabledResponse:
        """Tell whether velocities are taken."""
        cursor, enabled = await self._manual_control.get(request.metadata.cursor)
        return pb2.GetManualControlEnabledResponse(
            metadata=grpc_messages.metadata(cursor), enabled=enabled)


class SensingService:
    """Odometry and its relatives, new every 20 ms (chosen: the official bridge asks as often)."""

    def __init__(self, station: SimulatorState) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._odometry = LongPollValue(station, self._read_odometry, ODOMETRY_PERIOD)
        self._pose = LongPollValue(station, self._read_pose, ODOMETRY_PERIOD)

    async def GetRosOdometry(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRosOdometryResponse:
        """Tell where the robot thinks it is, and how fast."""
        cursor, odometry = await self._odometry.get(request.metadata.cursor)
        return pb2.GetRosOdometryResponse(
            metadata=grpc_messages.metadata(cursor), odometry=odometry)

    async def GetRosWheelOdometry(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRosWheelOdometryResponse:
        """Tell the same as the wheels have it (chosen)."""
        cursor, odometry = await self._odometry.get(request.metadata.cursor)
        return pb2.GetRosWheelOdometryResponse(
            metadata=grpc_messages.metadata(cursor), odometry=odometry)

    async def GetRobotPose(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRobotPoseResponse:
        """Tell where the robot believes to be on its map."""
        cursor, pose = await self._pose.get(request.metadata.cursor)
        return pb2.GetRobotPoseResponse(metadata=grpc_messages.metadata(cursor), pose=pose)

    async def SetRobotPose(
            self, request: pb2.SetRobotPoseRequest, context: Any) -> pb2.SetRobotPoseResponse:
        """Let the robot believe to be somewhere; it stays where it is."""
        station, pose = self._station, request.pose
        believed = Pose(pose.x, pose.y, pose.theta)
        if not all(map(math.isfinite, (pose.x, pose.y, pose.theta))):
            return pb2.SetRobotPoseResponse(result=grpc_messages.result(ERROR_NOT_A_VELOCITY))
        station.localisation.correct(believed, station.robot.odometry(station.now())[0])
        station.notify()
        return pb2.SetRobotPoseResponse(result=grpc_messages.result(SUCCESS))

    def _read_pose(self, now: float) -> pb2.Pose:
        pose, _ = self._station.robot.odometry(now)
        return grpc_messages.pose(self._station.localisation.to_map(pose))

    def _read_odometry(self, now: float) -> pb2.RosOdometry:
        pose, velocity = self._station.robot.odometry(now)
        return grpc_messages.odometry(pose, velocity, self._station.clock.stamp())


BODY_FRAME = 'base_link'
LASER_FRAME = 'laser_frame'
#: Where the laser looks from; figures of kachaka_description in pf-robotics/kachaka-api.
LASER, LASER_HEIGHT = Pose(0.156, 0.0, math.pi / 2.0), 0.1049


class TransformService:
    """From the map to the robot, and from the robot to its parts."""

    def __init__(self, station: SimulatorState) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._moving = LongPollValue(station, self._read, ODOMETRY_PERIOD)
        self._constant = constant(station)

    async def GetStaticTransform(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetStaticTransformResponse:
        """Tell where the body and the laser are on the robot."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        stamp = self._station.clock.stamp()
        laser = grpc_messages.transform(LASER, BODY_FRAME, LASER_FRAME, stamp)
        laser.translation.z = LASER_HEIGHT
        body = grpc_messages.transform(ORIGIN, ROBOT_FRAME, BODY_FRAME, stamp)
        return pb2.GetStaticTransformResponse(
            metadata=grpc_messages.metadata(cursor), transforms=[body, laser])

    async def GetDynamicTransform(
            self, request: pb2.EmptyRequest, context: Any
            ) -> AsyncIterator[pb2.GetDynamicTransformResponse]:
        """Tell where the robot is, again and again until the client goes."""
        cursor = 0
        while True:
            cursor, transforms = await self._moving.get(cursor)
            yield pb2.GetDynamicTransformResponse(transforms=transforms)

    def _read(self, now: float) -> list[pb2.RosTransformStamped]:
        station = self._station
        pose, _ = station.robot.odometry(now)
        stamp, offset = station.clock.stamp(), station.localisation.offset
        return [
            grpc_messages.transform(offset, MAP_FRAME, ODOMETRY_FRAME, stamp),
            grpc_messages.transform(pose, ODOMETRY_FRAME, ROBOT_FRAME, stamp)]


#: Chosen, so that nobody takes it for a real one.
SERIAL_NUMBER = 'SIMULATED'
#: The release of the robot's software that the SDK we read belongs to.
VERSION = '3.17.5'
#: The list of errors in the robot's form; both of its languages are English here.
ERRORS = json.dumps([
    {'code': code, 'error_type': kind, 'title': text, 'description': '',
     'title_en': text, 'description_en': '', 'ref_url': ''}
    for code, kind, text in TEXTS])


class StateService:
    """Names, readiness, errors."""

    def __init__(self, station: SimulatorState) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._errors = LongPollValue(station, station.robot.errors)
        self._constant = constant(station)

    async def GetRobotSerialNumber(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRobotSerialNumberResponse:
        """Tell a serial number that no real robot has."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        return pb2.GetRobotSerialNumberResponse(
            metadata=grpc_messages.metadata(cursor), serial_number=SERIAL_NUMBER)

    async def GetRobotVersion(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetRobotVersionResponse:
        """Tell the release of the software."""
        cursor, _ = await self._constant.get(request.metadata.cursor)
        return pb2.GetRobotVersionResponse(
            metadata=grpc_messages.metadata(cursor), version=VERSION)

    async def IsReady(self, request: pb2.EmptyRequest, context: Any) -> pb2.IsReadyResponse:
        """Say yes."""
        return pb2.IsReadyResponse(ready=True)

    async def GetError(self, request: pb2.GetRequest, context: Any) -> pb2.GetErrorResponse:
        """Tell what is wrong now."""
        cursor, codes = await self._errors.get(request.metadata.cursor)
        return pb2.GetErrorResponse(metadata=grpc_messages.metadata(cursor), error_codes=codes)

    async def GetRobotErrorCodeJson(
            self, request: pb2.EmptyRequest, context: Any) -> pb2.GetRobotErrorCodeJsonResponse:
        """Tell what the codes mean."""
        return pb2.GetRobotErrorCodeJsonResponse(
            json=ERRORS, result=grpc_messages.result(SUCCESS))


#: Ranges of the maker (protos/kachaka-api.proto).
LOUDEST = 10
BRIGHTEST = 255


class EquipmentService:
    """Speaker, torches, battery, and whether it drives home by itself (it never does)."""

    def __init__(self, station: SimulatorState) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._volume = LOUDEST // 2
        self._homes = False
        self._volumes = LongPollValue(station, lambda _: self._volume)
        self._homing = LongPollValue(station, lambda _: self._homes)
        self._docked = LongPollValue(station, station.robot.is_docked)

    async def GetBatteryInfo(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetBatteryInfoResponse:
        """Tell a battery that is always full, and charged on the dock."""
        cursor, is_docked = await self._docked.get(request.metadata.cursor)
        return pb2.GetBatteryInfoResponse(
            metadata=grpc_messages.metadata(cursor), remaining_percentage=100.0,
            power_supply_status=(
                pb2.POWER_SUPPLY_STATUS_CHARGING if is_docked
                else pb2.POWER_SUPPLY_STATUS_DISCHARGING))

    async def GetSpeakerVolume(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetSpeakerVolumeResponse:
        """Tell the volume."""
        cursor, volume = await self._volumes.get(request.metadata.cursor)
        return pb2.GetSpeakerVolumeResponse(metadata=grpc_messages.metadata(cursor), volume=volume)

    async def SetSpeakerVolume(
            self, request: pb2.SetSpeakerVolumeRequest, context: Any
            ) -> pb2.SetSpeakerVolumeResponse:
        """Keep a volume from 0 to 10."""
        code = _check(request.volume, LOUDEST)
        if code == SUCCESS:
            self._volume = request.volume
            self._station.notify()
        return pb2.SetSpeakerVolumeResponse(result=grpc_messages.result(code))

    async def SetFrontTorchIntensity(
            self, request: pb2.SetFrontTorchIntensityRequest, context: Any
            ) -> pb2.SetFrontTorchIntensityResponse:
        """Take an intensity from 0 to 255."""
        return pb2.SetFrontTorchIntensityResponse(
            result=grpc_messages.result(_check(request.intensity, BRIGHTEST)))

    async def SetBackTorchIntensity(
            self, request: pb2.SetBackTorchIntensityRequest, context: Any
            ) -> pb2.SetBackTorchIntensityResponse:
        """Take an intensity from 0 to 255."""
        return pb2.SetBackTorchIntensityResponse(
            result=grpc_messages.result(_check(request.intensity, BRIGHTEST)))

    async def GetAutoHomingEnabled(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetAutoHomingEnabledResponse:
        """Tell what was set."""
        cursor, enabled = await self._homing.get(request.metadata.cursor)
        return pb2.GetAutoHomingEnabledResponse(
            metadata=grpc_messages.metadata(cursor), enabled=enabled)

    async def SetAutoHomingEnabled(
            self, request: pb2.SetAutoHomingEnabledRequest, context: Any
            ) -> pb2.SetAutoHomingEnabledResponse:
        """Keep it; the simulated robot never drives home by itself."""
        self._homes = request.enable
        self._station.notify()
        return pb2.SetAutoHomingEnabledResponse(result=grpc_messages.result(SUCCESS))


def _check(value: int, most: int) -> int:
    return SUCCESS if 0 <= value <= most else ERROR_OUT_OF_RANGE


class MapService:
    """Places, furniture and maps; of all this there is the dock alone."""

    def __init__(self, station: SimulatorState) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._dock = grpc_messages.pose(station.robot.dock)
        self._constant = constant(station)

    async def GetLocations(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLocationsResponse:
        """Tell where the dock is."""
        return pb2.GetLocationsResponse(
            metadata=await self._metadata(request), default_location_id=HOME,
            locations=[pb2.Location(
                id=HOME, name=HOME, pose=self._dock, type=pb2.LOCATION_TYPE_CHARGER)])

    async def GetLocationsDigest(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetLocationsDigestResponse:
        """Tell that there is a dock."""
        return pb2.GetLocationsDigestResponse(
            metadata=await self._metadata(request),
            locations=[pb2.LocationDigest(id=HOME, name=HOME, type=pb2.LOCATION_TYPE_CHARGER)])

    async def GetShelves(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetShelvesResponse:
        """Tell that there are none."""
        return pb2.GetShelvesResponse(metadata=await self._metadata(request))

    async def GetShelvesDigest(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetShelvesDigestResponse:
        """Tell that there are none."""
        return pb2.GetShelvesDigestResponse(metadata=await self._metadata(request))

    async def GetMovingShelfId(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetMovingShelfIdResponse:
        """Tell that the robot carries none."""
        return pb2.GetMovingShelfIdResponse(metadata=await self._metadata(request))

    async def ResetShelfPose(
            self, request: pb2.ResetShelfPoseRequest, context: Any) -> pb2.ResetShelfPoseResponse:
        """Reset all there are, or refuse the one that there is not."""
        code = ERROR_UNKNOWN_NAME if request.shelf_id else SUCCESS
        return pb2.ResetShelfPoseResponse(result=grpc_messages.result(code))

    async def GetMapList(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetMapListResponse:
        """Tell that there are none."""
        return pb2.GetMapListResponse(metadata=await self._metadata(request))

    async def GetCurrentMapId(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetCurrentMapIdResponse:
        """Tell that there is none."""
        return pb2.GetCurrentMapIdResponse(metadata=await self._metadata(request))

    async def _metadata(self, request: pb2.GetRequest) -> pb2.Metadata:
        cursor, _ = await self._constant.get(request.metadata.cursor)
        return grpc_messages.metadata(cursor)
