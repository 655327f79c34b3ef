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
"""Calls about what the robot has beside its wheels: settings that are kept, and do nothing."""

from __future__ import annotations

from typing import Any

from kachaka_api.generated import kachaka_api_pb2 as pb2
from kachaka_simple_control.robot.error_codes import ERROR_OUT_OF_RANGE, SUCCESS
from kachaka_simple_control.robot.grpc_server import messages
from kachaka_simple_control.robot.grpc_server.station import Station
from kachaka_simple_control.robot.grpc_server.topic import Topic

#: Ranges of the maker (protos/kachaka-api.proto).
LOUDEST = 10
BRIGHTEST = 255


class EquipmentService:
    """Speaker, torches, battery, and whether it drives home by itself (it never does)."""

    def __init__(self, station: Station) -> None:
        """
        Serve a robot.

        :param station: where it is
        """
        self._station = station
        self._volume = LOUDEST // 2
        self._homes = False
        self._volumes = Topic(station, lambda _: self._volume)
        self._homing = Topic(station, lambda _: self._homes)
        self._docked = Topic(station, station.robot.is_docked)

    async def GetBatteryInfo(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetBatteryInfoResponse:
        """Tell a battery that is always full, and charged on the dock."""
        cursor, is_docked = await self._docked.get(request.metadata.cursor)
        return pb2.GetBatteryInfoResponse(
            metadata=messages.metadata(cursor), remaining_percentage=100.0,
            power_supply_status=(
                pb2.POWER_SUPPLY_STATUS_CHARGING if is_docked
                else pb2.POWER_SUPPLY_STATUS_DISCHARGING))

    async def GetSpeakerVolume(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetSpeakerVolumeResponse:
        """Tell the volume."""
        cursor, volume = await self._volumes.get(request.metadata.cursor)
        return pb2.GetSpeakerVolumeResponse(metadata=messages.metadata(cursor), volume=volume)

    async def SetSpeakerVolume(
            self, request: pb2.SetSpeakerVolumeRequest, context: Any
            ) -> pb2.SetSpeakerVolumeResponse:
        """Keep a volume from 0 to 10."""
        code = _check(request.volume, LOUDEST)
        if code == SUCCESS:
            self._volume = request.volume
            self._station.announce()
        return pb2.SetSpeakerVolumeResponse(result=messages.result(code))

    async def SetFrontTorchIntensity(
            self, request: pb2.SetFrontTorchIntensityRequest, context: Any
            ) -> pb2.SetFrontTorchIntensityResponse:
        """Take an intensity from 0 to 255."""
        return pb2.SetFrontTorchIntensityResponse(
            result=messages.result(_check(request.intensity, BRIGHTEST)))

    async def SetBackTorchIntensity(
            self, request: pb2.SetBackTorchIntensityRequest, context: Any
            ) -> pb2.SetBackTorchIntensityResponse:
        """Take an intensity from 0 to 255."""
        return pb2.SetBackTorchIntensityResponse(
            result=messages.result(_check(request.intensity, BRIGHTEST)))

    async def GetAutoHomingEnabled(
            self, request: pb2.GetRequest, context: Any) -> pb2.GetAutoHomingEnabledResponse:
        """Tell what was set."""
        cursor, enabled = await self._homing.get(request.metadata.cursor)
        return pb2.GetAutoHomingEnabledResponse(
            metadata=messages.metadata(cursor), enabled=enabled)

    async def SetAutoHomingEnabled(
            self, request: pb2.SetAutoHomingEnabledRequest, context: Any
            ) -> pb2.SetAutoHomingEnabledResponse:
        """Keep it; the simulated robot never drives home by itself."""
        self._homes = request.enable
        self._station.announce()
        return pb2.SetAutoHomingEnabledResponse(result=messages.result(SUCCESS))


def _check(value: int, most: int) -> int:
    return SUCCESS if 0 <= value <= most else ERROR_OUT_OF_RANGE
